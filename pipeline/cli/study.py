"""The commands that run studies and show what came of them."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import __version__
from pipeline.cli.words import (
    BAD_INPUT,
    DEFAULT_OUTPUT,
    DONE,
    INTERRUPTED,
    SOME_FAILED,
    File,
    Files,
    Json,
    Output,
    StoreFile,
    Without,
    axes_of,
    check_names,
    check_shard,
    error,
    fail,
    load_all,
    stored_records,
    warn,
)
from pipeline.plan.plan import Plan, make_plan
from pipeline.plan.shard import Shard
from pipeline.study.load import load
from pipeline.study.problems import StudyError

if TYPE_CHECKING:
    from pipeline.run.progress import Terminal
    from pipeline.workflow import Opened, Outcome


def validate(files: Files, as_json: Json = False) -> None:
    """Check study files, and say everything that is wrong with them.

    Example: epsmesh validate studies/*.toml
    """
    failed = False
    report: list[dict[str, Any]] = []
    for file in files:
        try:
            study = load(file)
        except StudyError as wrong:
            failed = True
            report.append({"file": str(file), "errors": [str(p) for p in wrong.problems], "warnings": []})
            if not as_json:
                error(str(wrong))
            continue
        cases = len(make_plan(study).keys)
        report.append({"file": str(file), "errors": [], "warnings": list(study.warnings), "cases": cases})
        if not as_json:
            warn(study)
            print(f"{file}: fine; {cases} cases{axes_of(study)}")
    if as_json:
        print(json.dumps(report, indent=2))
    raise typer.Exit(BAD_INPUT if failed else DONE)


def run(
    files: Files,
    output: Annotated[Path, typer.Option(help="Folder for <study>.nc and the figure.")] = DEFAULT_OUTPUT,
    store: StoreFile = None,
    meshes: Annotated[Path, typer.Option(help="Folder of the meshes that are kept.")] = Path("meshes/cache"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute again what is stored.")] = False,
    without: Without = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Do part I of N only, for `epsmesh merge`; kept in OUTPUT/shards."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
) -> None:
    """Run studies: forces, timings, dataset and figure. Under mpirun, on all ranks.

    Cases that are stored already are read back, so an interrupted run goes on where it was. With --shard I/N no dataset
    is written: N such runs, which need not know of each other, do the study, and `epsmesh merge` brings them together.

    Example: epsmesh run studies/figure3.toml

    Example: mpirun -n 4 epsmesh run studies/figure3.toml

    Example: epsmesh run studies/figure3.toml --shard 3/8
    """
    studies, left_out = load_all(files), check_names(without)
    part = check_shard(shard, studies)
    from mpi4py import MPI

    from pipeline import workflow
    from pipeline.run.store import StoreError

    comm, failed = MPI.COMM_WORLD, False
    speaks = comm.rank == 0
    for study in studies:
        try:
            main = output / "cases.sqlite"
            path = store or (part.store(output, study) if part else main)
            plan, opened = workflow.prepare(
                study,
                comm,
                path,
                fresh=fresh,
                without=left_out,
                meshes=meshes,
                shard=part,
                beside=main if part else None,
            )
            if speaks:
                _announce(plan, opened, quiet)
            with workflow.abort_on_exception(comm):
                outcome = workflow.run(plan, opened, comm, output, _progress(plan) if speaks and not quiet else None)
        except StoreError as wrong:
            fail(str(wrong))
        if speaks:
            _conclude(plan, outcome, part, path, quiet)
        if outcome.interrupted:
            workflow.end_ranks(comm, INTERRUPTED)
            raise typer.Exit(INTERRUPTED)
        failed = failed or outcome.counts["failed"] > 0
    raise typer.Exit(SOME_FAILED if failed else DONE)


def status(file: File, output: Output = DEFAULT_OUTPUT, store: StoreFile = None, as_json: Json = False) -> None:
    """Say which cases of a study are done, failed, or still to be run.

    Example: epsmesh status studies/figure3.toml
    """
    (study,) = load_all([file])
    plan = make_plan(study)
    path = store or output / "cases.sqlite"
    records = stored_records(path, plan) if path.exists() else {}
    counts = dict.fromkeys(("ok", "failed", "pending"), 0)
    failed = []
    for key, case in zip(plan.keys, study.cases(), strict=True):
        record = records.get(key)
        counts[record.status if record else "pending"] += 1
        if record and record.status == "failed":
            failed.append({"case": str(case), "message": record.message})
    if as_json:
        print(json.dumps({"file": str(file), **counts, "failures": failed}, indent=2))
        return
    print(f"{file}: {counts['ok']} done, {counts['failed']} failed, {counts['pending']} pending{axes_of(study)}")
    for failure in failed:
        print(f"  failed: {failure['case']}: {failure['message']}")


def plot(
    file: Annotated[Path, typer.Argument(help="A dataset (.nc), or a study file whose dataset exists.")],
    output: Output = DEFAULT_OUTPUT,
) -> None:
    """Draw the figure of a dataset again, as PNG and SVG.

    Example: epsmesh plot results/figure3.nc
    """
    path = file if file.suffix == ".nc" else output / f"{file.stem}.nc"
    if not path.exists():
        fail(f"{path}: no such dataset; make it with `epsmesh run {file}`")
    import xarray as xr

    from pipeline.report.figures import draw

    with xr.open_dataset(path) as dataset:
        for picture in draw(dataset.load(), path.with_suffix("")):
            print(picture)


def version() -> None:
    """Print the versions of the program and of the libraries that a force depends on."""
    from pipeline.run.provenance import provenance

    for name, value in {"version_epsmesh": __version__, **provenance(ranks=1)}.items():
        if name.startswith("version_"):
            print(f"{name.removeprefix('version_'):10} {value}")


def _progress(plan: Plan) -> "Terminal":
    from pipeline.run.progress import Terminal

    return Terminal(len(plan.solves))


def _announce(plan: Plan, opened: "Opened", quiet: bool) -> None:
    """Say, before the run, what is to be done and what is not, and why."""
    if opened.notice:
        error(opened.notice)
    if quiet:
        return
    study = plan.study
    warn(study)
    print(f"{study.title}: {len(plan.keys)} cases{axes_of(study)}")
    for struck in plan.struck:
        print(f"  {struck.name:13} {struck.count:6}  {struck.reason}")
    if study.solve.timing:
        print(f"  timing: every case afresh and alone, median of {study.solve.repeats}; nothing is struck out")
    if plan.solves:
        print(f"  to do: {len(plan.meshes)} meshes, {len(plan.solves)} solves", flush=True)


def _conclude(plan: Plan, outcome: "Outcome", shard: Shard | None, store: Path, quiet: bool) -> None:
    """Say, after the run, what came of it and where it is."""
    study = plan.study
    for case, message in outcome.failures:
        error(f"failed: {case}: {message}")
    name = f"{study.file}, shard {shard}" if shard else study.file
    if not quiet:
        counts = ", ".join(f"{count} {state}" for state, count in outcome.counts.items() if count)
        where = f"in {store}; when all shards are done: `epsmesh merge {study.file}`"
        wrote = where if shard else f"wrote {', '.join(map(str, outcome.files))}"
        # A shard may hold F_exact and no case, or nothing where there are fewer steps than shards.
        idle = "F_exact" if plan.part else "nothing to do"
        print(f"{name}: {counts or idle}; {wrote}", flush=True)
    if outcome.interrupted:
        cases = sum(outcome.counts.values())
        done = cases - outcome.counts["pending"]
        again = f"`epsmesh run {study.file}{f' --shard {shard}' if shard else ''}` goes on from there"
        error(f"interrupted: {done} of {cases} cases are on record; {again}")
