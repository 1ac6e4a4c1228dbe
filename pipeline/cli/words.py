"""What every command says and takes: options, errors, exit statuses. Only the command line prints and exits."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from pipeline.plan.plan import Plan
from pipeline.plan.shard import Shard, parse_shard, reason_against
from pipeline.study.load import load
from pipeline.study.problems import StudyError
from pipeline.study.schema import REDUCTIONS
from pipeline.study.sweep import Study

if TYPE_CHECKING:
    from pipeline.run.record import Record

DONE, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
DEFAULT_OUTPUT = Path("results")

Files = Annotated[list[Path], typer.Argument(help="Study files (TOML).", show_default=False)]
File = Annotated[Path, typer.Argument(help="A study file (TOML).", show_default=False)]
Output = Annotated[Path, typer.Option(help="Folder of the results.")]
StoreFile = Annotated[Path | None, typer.Option("--store", help="Case store [default: OUTPUT/cases.sqlite].")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]
Without = Annotated[
    list[str] | None,
    typer.Option(help=f"A reduction not to use; may be repeated: {', '.join(REDUCTIONS)}.", show_default=False),
]


def load_all(files: list[Path]) -> list[Study]:
    """Load studies, or exit with every problem of every file; on several ranks only the first one speaks."""
    studies, messages = [], []
    for file in files:
        try:
            studies.append(load(file))
        except StudyError as problem:
            messages.append(str(problem))
    names = [study.name for study in studies]
    messages += [
        f"{s.file}: another study given is called {s.name}, too: both would write {s.name}.nc"
        for s in studies
        if names.count(s.name) > 1
    ]
    if messages:
        fail("\n".join(messages))
    return studies


def stored_records(path: Path, plan: Plan) -> dict[str, "Record"]:
    """Return the records of a plan's cases and of their F_exact that are in the store at ``path``."""
    from pipeline.run.store import Store, StoreError

    try:
        store = Store(path)
    except StoreError as problem:
        fail(str(problem))
    records = store.get({*plan.keys, *plan.reference_keys})
    store.close()
    return records


def axes_of(study: Study) -> str:
    """Return the swept inputs in brackets."""
    text = " × ".join(f"{len(axis)} {axis.name}" for axis in study.axes)
    return f" ({text})" if text else ""


def warn(study: Study) -> None:
    """Print the warnings of a study."""
    for warning in study.warnings:
        error(f"warning: {warning}")


def error(text: str) -> None:
    """Print to standard error."""
    print(text, file=sys.stderr, flush=True)


def fail(text: str) -> NoReturn:
    """Exit for bad input, with one voice if there are several ranks."""
    if is_first_rank():
        error(text)
    raise typer.Exit(BAD_INPUT)


def is_first_rank() -> bool:
    """Tell, before MPI is started, whether this is the rank that speaks."""
    ranks = (os.environ.get(name) for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"))
    return next((rank for rank in ranks if rank is not None), "0") == "0"


def check_names(without: list[str] | None) -> tuple[str, ...]:
    """Return the names of reductions, or exit if there is none of such a name."""
    unknown = [name for name in without or () if name not in REDUCTIONS]
    if unknown:
        fail(f"--without {unknown[0]}: no reduction is called so; there are {', '.join(REDUCTIONS)}")
    return tuple(without or ())


def check_shard(text: str | None, studies: list[Study]) -> Shard | None:
    """Return the shard that ``--shard`` names, or exit if it names none or a study cannot be dealt out."""
    if text is None:
        return None
    try:
        shard = parse_shard(text)
    except ValueError as problem:
        fail(f"--shard: {problem}")
    reasons = [f"{study.file}: {reason}" for study in studies if (reason := reason_against(study))]
    if reasons:
        fail("\n".join(reasons))
    return shard
