"""The command line: parse, call, print. Everything below it raises; only this file prints and exits."""

import json
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from pipeline import __version__
from pipeline.plan.plan import Plan, make_plan
from pipeline.study.load import load
from pipeline.study.problems import StudyError
from pipeline.study.sweep import Study

if TYPE_CHECKING:
    from pipeline.run.record import Record
    from pipeline.run.store import Store

DONE, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
# Seconds that the first rank has, when a parallel run is interrupted, to write what is finished.
_GRACE = 30

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

    from pipeline.run.execute import abort_on_exception

    comm = MPI.COMM_WORLD
    status = DONE
    with abort_on_exception(comm):
        for study in studies:
            status = max(status, _run_study(study, comm, output, store or output / "cases.sqlite", fresh, quiet))
    raise typer.Exit(status)


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


# ---- running ----------------------------------------------------------------------------------------


def _run_study(study: Study, comm: Any, output: Path, store_path: Path, fresh: bool, quiet: bool) -> int:
    """Run one study and write what came of it; collective. Return the exit status, the same on every rank."""
    first = comm.rank == 0
    plan, records, store = _open(study, comm, store_path, fresh)
    if first and not quiet:
        _warn(study)
        _describe(plan)
    attributes = {"start": _now()}

    def keep(record: "Record") -> None:
        assert store is not None
        store.put(record)
        records[record.key] = record

    interrupted = False
    try:
        with _interruptible():
            _execute(plan, comm, keep, quiet=quiet or not first)
    except KeyboardInterrupt:
        interrupted = True
    if first:
        attributes["end"] = _now()
        _write(plan, records, attributes, output, quiet)
    if store is not None:
        store.close()
    if interrupted:
        _stop(study, plan, records, comm)
    failed = comm.bcast(sum(records[key].status == "failed" for key in plan.keys) if first else None)
    return SOME_FAILED if failed else DONE


def _open(study: Study, comm: Any, path: Path, fresh: bool) -> tuple[Plan, dict[str, "Record"], "Store | None"]:
    """Open the store on rank 0 and plan, on every rank alike, what is not on record; collective."""
    from pipeline.run.store import Store, StoreError

    store, records, message = None, {}, ""
    if comm.rank == 0:
        try:
            store = Store(path)
            if store.notice:
                _error(store.notice)
            if not (fresh or study.solve.timing):
                records = {k: r for k, r in store.get(set(make_plan(study).keys)).items() if r.status == "ok"}
        except StoreError as error:
            message = str(error)
    message, stored = comm.bcast((message, sorted(records)))
    if message:
        if comm.rank == 0:
            _error(message)
        raise typer.Exit(BAD_INPUT)
    return make_plan(study, stored), records, store


def _execute(plan: Plan, comm: Any, keep: Any, *, quiet: bool) -> None:
    if not plan.solves:
        return
    from pipeline.run.execute import execute
    from pipeline.run.progress import Silent, Terminal

    if quiet:
        execute(plan, comm, keep, Silent())
        return
    with Terminal(len(plan.solves)) as progress:
        execute(plan, comm, keep, progress)


def _write(plan: Plan, records: dict[str, "Record"], attributes: dict[str, str], output: Path, quiet: bool) -> None:
    from pipeline.report.dataset import build, write
    from pipeline.report.figures import draw

    path = output / f"{plan.study.name}.nc"
    dataset = build(plan, records, attributes)
    write(dataset, path)
    pictures = draw(dataset, path.with_suffix(""))
    for key, case in zip(plan.keys, plan.study.cases(), strict=True):
        record = records.get(key)
        if record and record.status == "failed":
            _error(f"failed: {case}: {record.message}")
    if not quiet:
        states = [records[key].status if key in records else "pending" for key in plan.keys]
        counts = ", ".join(f"{states.count(s)} {s}" for s in ("ok", "failed", "pending") if s in states)
        print(f"{plan.study.file}: {counts}; wrote {', '.join(str(p) for p in [path, *pictures])}", flush=True)


def _stop(study: Study, plan: Plan, records: dict[str, "Record"], comm: Any) -> NoReturn:
    if comm.rank == 0:
        done = sum(key in records for key in plan.keys)
        again = f"`epsmesh run {study.file}` goes on from there"
        _error(f"interrupted: {done} of {len(plan.keys)} cases are on record; {again}")
    if comm.size > 1:
        # The other ranks may wait in a call that will never be answered; the first one writes before it ends them.
        if comm.rank != 0:
            time.sleep(_GRACE)
        comm.Abort(INTERRUPTED)
    raise typer.Exit(INTERRUPTED)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Turn Ctrl-C, and the request to end that mpirun or a batch system sends, into KeyboardInterrupt."""

    def interrupt(*_: Any) -> NoReturn:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


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


def _describe(plan: Plan) -> None:
    study = plan.study
    print(f"{study.title}: {len(plan.keys)} cases{_axes(study)}")
    for struck in plan.struck:
        print(f"  {struck.count} struck out: {struck.reason}")
    if study.solve.timing:
        print(f"  timing: every case afresh and alone, median of {study.solve.repeats}; nothing is struck out")
    if plan.solves:
        print(f"  to do: {len(plan.meshes)} meshes, {len(plan.solves)} solves", flush=True)


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
    import os

    ranks = (os.environ.get(name) for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"))
    return next((rank for rank in ranks if rank is not None), "0") == "0"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
