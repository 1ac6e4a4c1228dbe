"""The command line: parse, call, print. Everything below it raises; only this file prints and exits."""

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from pipeline import __version__, checks
from pipeline.plan.plan import Plan, make_plan
from pipeline.study.load import load
from pipeline.study.problems import StudyError
from pipeline.study.sweep import Study

if TYPE_CHECKING:
    from pipeline.run.progress import Terminal
    from pipeline.run.record import Record
    from pipeline.workflow import Opened, Outcome

DONE, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

app = typer.Typer(
    help="How fine must a mesh be, and where, for the reaction force of a surgical tool?",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Files = Annotated[list[Path], typer.Argument(help="Study files (TOML).", show_default=False)]
File = Annotated[Path, typer.Argument(help="A study file (TOML).", show_default=False)]
Output = Annotated[Path, typer.Option(help="Folder of the results.")]
StoreFile = Annotated[Path | None, typer.Option("--store", help="Case store [default: OUTPUT/cases.sqlite].")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]
DEFAULT_OUTPUT = Path("results")


def main() -> None:
    """Run the command ``epsmesh``."""
    app(prog_name="epsmesh")


@app.command()
def validate(files: Files, as_json: Json = False) -> None:
    """Check study files, and say everything that is wrong with them.

    Example: epsmesh validate studies/*.toml
    """
    failed = False
    report: list[dict[str, Any]] = []
    for file in files:
        try:
            study = load(file)
        except StudyError as error:
            failed = True
            report.append({"file": str(file), "errors": [str(p) for p in error.problems], "warnings": []})
            if not as_json:
                _error(str(error))
            continue
        cases = len(make_plan(study).keys)
        report.append({"file": str(file), "errors": [], "warnings": list(study.warnings), "cases": cases})
        if not as_json:
            _warn(study)
            print(f"{file}: fine; {cases} cases{_axes(study)}")
    if as_json:
        print(json.dumps(report, indent=2))
    raise typer.Exit(BAD_INPUT if failed else DONE)


@app.command()
def run(
    files: Files,
    output: Annotated[Path, typer.Option(help="Folder for <study>.nc and the figure.")] = DEFAULT_OUTPUT,
    store: StoreFile = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute again what is stored.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")] = False,
) -> None:
    """Run studies: forces, timings, dataset and figure. Under mpirun, on all ranks.

    Cases that are stored already are read back, so an interrupted run goes on where it was.

    Example: epsmesh run studies/figure3.toml

    Example: mpirun -n 4 epsmesh run studies/figure3.toml
    """
    studies = _load_all(files)
    from mpi4py import MPI

    from pipeline import workflow
    from pipeline.run.store import StoreError

    comm, failed = MPI.COMM_WORLD, False
    speaks = comm.rank == 0
    for study in studies:
        try:
            plan, opened = workflow.prepare(study, comm, store or output / "cases.sqlite", fresh=fresh)
            if speaks:
                _announce(plan, opened, quiet)
            with workflow.abort_on_exception(comm):
                outcome = workflow.run(plan, opened, comm, output, _progress(plan) if speaks and not quiet else None)
        except StoreError as error:
            _fail(str(error))
        if speaks:
            _conclude(plan, outcome, quiet)
        if outcome.interrupted:
            workflow.end_ranks(comm, INTERRUPTED)
            raise typer.Exit(INTERRUPTED)
        failed = failed or outcome.counts["failed"] > 0
    raise typer.Exit(SOME_FAILED if failed else DONE)


@app.command()
def status(file: File, output: Output = DEFAULT_OUTPUT, store: StoreFile = None, as_json: Json = False) -> None:
    """Say which cases of a study are done, failed, or still to be run.

    Example: epsmesh status studies/figure3.toml
    """
    (study,) = _load_all([file])
    plan = make_plan(study)
    path = store or output / "cases.sqlite"
    records = _stored(path, plan) if path.exists() else {}
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
    print(f"{file}: {counts['ok']} done, {counts['failed']} failed, {counts['pending']} pending{_axes(study)}")
    for failure in failed:
        print(f"  failed: {failure['case']}: {failure['message']}")


@app.command()
def plot(
    file: Annotated[Path, typer.Argument(help="A dataset (.nc), or a study file whose dataset exists.")],
    output: Output = DEFAULT_OUTPUT,
) -> None:
    """Draw the figure of a dataset again, as PNG and SVG.

    Example: epsmesh plot results/figure3.nc
    """
    path = file if file.suffix == ".nc" else output / f"{file.stem}.nc"
    if not path.exists():
        _fail(f"{path}: no such dataset; make it with `epsmesh run {file}`")
    import xarray as xr

    from pipeline.report.figures import draw

    with xr.open_dataset(path) as dataset:
        for picture in draw(dataset.load(), path.with_suffix("")):
            print(picture)


@app.command()
def version() -> None:
    """Print the versions of the program and of the libraries that a force depends on."""
    from pipeline.run.provenance import provenance

    for name, value in {"version_epsmesh": __version__, **provenance(ranks=1)}.items():
        if name.startswith("version_"):
            print(f"{name.removeprefix('version_'):10} {value}")


app.command()(checks.verify)
app.command()(checks.benchmark)


# ---- words ------------------------------------------------------------------------------------------


def _load_all(files: list[Path]) -> list[Study]:
    """Load studies, or exit with every problem of every file; on several ranks only the first one speaks."""
    studies, messages = [], []
    for file in files:
        try:
            studies.append(load(file))
        except StudyError as error:
            messages.append(str(error))
    names = [study.name for study in studies]
    messages += [
        f"{s.file}: another study given is called {s.name}, too: both would write {s.name}.nc"
        for s in studies
        if names.count(s.name) > 1
    ]
    if messages:
        _fail("\n".join(messages))
    return studies


def _stored(path: Path, plan: Plan) -> dict[str, "Record"]:
    from pipeline.run.store import Store, StoreError

    try:
        store = Store(path)
    except StoreError as error:
        _fail(str(error))
    records = store.get(set(plan.keys))
    store.close()
    return records


def _progress(plan: Plan) -> "Terminal":
    from pipeline.run.progress import Terminal

    return Terminal(len(plan.solves))


def _announce(plan: Plan, opened: "Opened", quiet: bool) -> None:
    """Say, before the run, what is to be done and what is not, and why."""
    if opened.notice:
        _error(opened.notice)
    if quiet:
        return
    study = plan.study
    _warn(study)
    print(f"{study.title}: {len(plan.keys)} cases{_axes(study)}")
    for struck in plan.struck:
        print(f"  {struck.count} struck out: {struck.reason}")
    if study.solve.timing:
        print(f"  timing: every case afresh and alone, median of {study.solve.repeats}; nothing is struck out")
    if plan.solves:
        print(f"  to do: {len(plan.meshes)} meshes, {len(plan.solves)} solves", flush=True)


def _conclude(plan: Plan, outcome: "Outcome", quiet: bool) -> None:
    """Say, after the run, what came of it and where it is."""
    study = plan.study
    for case, message in outcome.failures:
        _error(f"failed: {case}: {message}")
    if not quiet:
        counts = ", ".join(f"{count} {state}" for state, count in outcome.counts.items() if count)
        print(f"{study.file}: {counts}; wrote {', '.join(map(str, outcome.files))}", flush=True)
    if outcome.interrupted:
        done = len(plan.keys) - outcome.counts["pending"]
        again = f"`epsmesh run {study.file}` goes on from there"
        _error(f"interrupted: {done} of {len(plan.keys)} cases are on record; {again}")


def _axes(study: Study) -> str:
    text = " × ".join(f"{len(axis)} {axis.name}" for axis in study.axes)
    return f" ({text})" if text else ""


def _warn(study: Study) -> None:
    for warning in study.warnings:
        _error(f"warning: {warning}")


def _error(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _fail(text: str) -> NoReturn:
    if _is_first_rank():
        _error(text)
    raise typer.Exit(BAD_INPUT)


def _is_first_rank() -> bool:
    """Tell, before MPI is started, whether this is the rank that speaks."""
    ranks = (os.environ.get(name) for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"))
    return next((rank for rank in ranks if rank is not None), "0") == "0"
