"""How a command ends that cannot go on: told to people on standard error, and to scripts as JSON where they asked."""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from pipeline.cli.console import error, is_json_wanted, print_json
from pipeline.launcher import is_first_rank
from pipeline.printable import printable

if TYPE_CHECKING:
    from pipeline.report.publish import ResultsError
    from pipeline.study.problems import StudyError

DONE, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
_PATIENCE = 5.0  # seconds


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong: ``message`` is what people read; the rest is None where it has no place.

    ``key`` is that of a study file or an option, ``value`` what was found there, ``allowed`` what is; ``howto`` names
    the page of the documentation that tells how it is done.
    """

    message: str
    file: str | None = None
    key: str | None = None
    value: Any = None
    allowed: str | None = None
    howto: str | None = None


def of_option(name: str, value: Any, allowed: str, howto: str | None = None) -> Fault:
    """Return what is wrong with the ``value`` of an option, and what is allowed."""
    return Fault(f"{name} {value}: {allowed}", key=name, value=str(value), allowed=allowed, howto=howto)


def of_file(path: str | Path, why: str, howto: str | None = None) -> Fault:
    """Return what is wrong with a file."""
    return Fault(f"{printable(str(path))}: {why}", file=str(path), howto=howto)


def of_unwritten(problem: OSError, path: str | Path | None = None) -> Fault:
    """Return what became of a file that cannot be written: that which ``problem`` names, or else ``path``."""
    name = problem.filename or path
    why = f"cannot be written: {problem.strerror or problem}"
    return of_file(name, why) if name else Fault(why)


def of_study(wrong: "StudyError", hint: str = "") -> list[Fault]:
    """Return what is wrong with a study file, each problem by itself; ``hint`` goes with what people read."""
    return [
        Fault(f"{printable(wrong.file)}: {one}{hint}", wrong.file, one.key, one.value, one.allowed, one.howto or None)
        for one in wrong.problems
    ]


def leave_it_to_first_rank() -> None:
    """Wait, on the other ranks, until the first one has spoken: all are ended as soon as one leaves with a bad status.

    Who is still here after that is alone in what it found, and is to speak.
    """
    if not is_first_rank():
        time.sleep(_PATIENCE)


def fail(*faults: Fault | str, status: int = BAD_INPUT, on_all_ranks: bool = False) -> NoReturn:
    """Exit, by default for bad input, with one voice if there are several ranks: the first one's, where it agrees.

    What is known to be said ``on_all_ranks`` the others do not say: once MPI has begun, none ends before all do.
    Where JSON was asked for, standard output gets an object with the status and the errors.
    """
    if on_all_ranks and not is_first_rank():
        raise typer.Exit(status)
    leave_it_to_first_rank()
    found = [fault if isinstance(fault, Fault) else Fault(fault) for fault in faults]
    tell(found)
    if is_json_wanted():
        print_json(as_data(found, status))
    raise typer.Exit(status)


def of_results(wrong: "ResultsError", file: str) -> tuple[Fault, int]:
    """Return what keeps the results of a study ``file`` from being made, and the exit status that it has."""
    return Fault(str(wrong), file=file), BAD_INPUT if wrong.is_unwritable else SOME_FAILED


@contextmanager
def refusing(*errors: type[Exception], file: str | Path, howto: str | None = None) -> Iterator[None]:
    """Exit for bad input where one of ``errors`` is raised: its message is what is wrong with ``file``."""
    try:
        yield
    except errors as wrong:
        fail(Fault(str(wrong), file=str(file), howto=howto))


def tell(faults: Iterable[Fault]) -> None:
    """Print faults for people, and the pages that tell how it is done."""
    faults = list(faults)
    for fault in faults:
        error(fault.message)
    if howto := dict.fromkeys(fault.howto for fault in faults if fault.howto):
        error(f"how to: {', '.join(map(str, howto))}")


def as_data(faults: Iterable[Fault], status: int) -> dict[str, Any]:
    """Return faults as scripts get them."""
    return {"status": status, "errors": [asdict(fault) for fault in faults]}
