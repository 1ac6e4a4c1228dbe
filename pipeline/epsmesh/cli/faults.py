"""How a command fails: sentences on standard error, and with --json the same as data."""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import typer

from epsmesh.cli.console import error, is_json_wanted, print_json
from epsmesh.launcher import is_first_rank
from epsmesh.printable import printable

if TYPE_CHECKING:
    from epsmesh.report.publish import ResultsError
    from epsmesh.study.problems import StudyError

DONE, SOME_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
_PATIENCE = 5.0  # seconds


@dataclass(frozen=True)
class Fault:
    """One error: ``message`` for people; the other fields for scripts, None where they do not apply.

    ``key`` is the key of a study file or an option, ``value`` its value, ``allowed`` the allowed ones, ``howto`` the
    page of the documentation that helps.
    """

    message: str
    file: str | None = None
    key: str | None = None
    value: Any = None
    allowed: str | None = None
    howto: str | None = None


def of_option(name: str, value: Any, allowed: str, howto: str | None = None) -> Fault:
    """Return the error for the ``value`` of an option."""
    return Fault(f"{name} {value}: {allowed}", key=name, value=str(value), allowed=allowed, howto=howto)


def of_file(path: str | Path, why: str, howto: str | None = None) -> Fault:
    """Return the error for a file."""
    return Fault(f"{printable(str(path))}: {why}", file=str(path), howto=howto)


def of_unwritten(problem: OSError, path: str | Path | None = None) -> Fault:
    """Return the error for a file that cannot be written: the one that ``problem`` names, or else ``path``."""
    name = problem.filename or path
    why = f"cannot be written: {problem.strerror or problem}"
    return of_file(name, why) if name else Fault(why)


def of_study(wrong: "StudyError", hint: str = "") -> list[Fault]:
    """Return the errors of a study file, one for each problem; ``hint`` is appended to each message."""
    return [
        Fault(
            f"{printable(wrong.file)}: {one}{hint}",
            wrong.file,
            one.key or None,
            one.value,
            one.allowed,
            one.howto or None,
        )
        for one in wrong.problems
    ]


def leave_it_to_first_rank() -> None:
    """Wait, on ranks other than the first, until the first one has printed.

    One rank that exits with an error ends all. A rank that still runs after the wait found an error that the first
    rank did not find, and prints it.
    """
    if not is_first_rank():
        time.sleep(_PATIENCE)


def fail(*faults: Fault | str, status: int = BAD_INPUT, on_all_ranks: bool = False) -> NoReturn:
    """Print the errors once, whatever the number of ranks, and exit; the default status is that of wrong input.

    ``on_all_ranks``: every rank calls this with the same errors, so only the first one prints them. Once MPI has
    started, a rank cannot exit before the others. With --json standard output gets an object with status and errors.
    """
    if on_all_ranks and not is_first_rank():
        raise typer.Exit(status)
    leave_it_to_first_rank()
    found = [fault if isinstance(fault, Fault) else Fault(fault) for fault in faults]
    print_faults(found)
    if is_json_wanted():
        print_json(as_data(found, status))
    raise typer.Exit(status)


def of_results(wrong: "ResultsError", file: str) -> tuple[Fault, int]:
    """Return the error that prevents the results of a study ``file``, and its exit status."""
    return Fault(str(wrong), file=file), BAD_INPUT if wrong.is_unwritable else SOME_FAILED


@contextmanager
def refusing(
    *errors: type[Exception], file: str | Path, howto: str | None = None, on_all_ranks: bool = False
) -> Iterator[None]:
    """Exit with the status of wrong input if one of ``errors`` is raised, on all ranks or on one: see :func:`fail`.

    Its message is about ``file``.
    """
    try:
        yield
    except errors as wrong:
        fail(Fault(str(wrong), file=str(file), howto=howto), on_all_ranks=on_all_ranks)


def print_faults(faults: Iterable[Fault]) -> None:
    """Print errors to standard error, and the documentation pages that help."""
    faults = list(faults)
    for fault in faults:
        error(fault.message)
    if howto := dict.fromkeys(fault.howto for fault in faults if fault.howto):
        error(f"see {', '.join(map(str, howto))}")


def as_data(faults: Iterable[Fault], status: int) -> dict[str, Any]:
    """Return errors as data for scripts."""
    return {"status": status, "errors": [asdict(fault) for fault in faults]}
