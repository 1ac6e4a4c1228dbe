"""How the commands fail: cases that they need cannot be run."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from epsmesh.cli.faults import SOME_FAILED, Fault, fail, of_study

if TYPE_CHECKING:
    from epsmesh.study.sweep import Study


@contextmanager
def refusing_cases(study: "Study", store: Path, howto: str | None = None) -> Iterator[None]:
    """Exit, on all ranks, if the cases that a command needs cannot be run, have no force, or the ``store`` is bad.

    If one rank alone meets another error, all end.
    """
    from epsmesh.run.store import StoreError
    from epsmesh.study.problems import StudyError
    from epsmesh.workflow import abort_on_exception, world
    from epsmesh_identify.surrogate.cases import SurrogateError

    try:
        with abort_on_exception(world(), StoreError, StudyError, SurrogateError, typer.Exit):
            yield
    except StudyError as wrong:
        fail(*of_study(wrong), on_all_ranks=True)
    except StoreError as wrong:
        fail(Fault(str(wrong), file=str(store)), on_all_ranks=True)
    except SurrogateError as wrong:
        fail(Fault(str(wrong), file=study.file, howto=howto), status=SOME_FAILED, on_all_ranks=True)
