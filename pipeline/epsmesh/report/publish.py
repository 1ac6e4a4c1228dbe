"""What a study gives its readers: the dataset, and the figure beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from epsmesh.files import result_files
from epsmesh.launcher import is_interrupt
from epsmesh.plan.plan import Plan
from epsmesh.report.made import inputs_of, made_from, note_made
from epsmesh.run.given_force import with_depths
from epsmesh.run.record import Record


class ResultsError(Exception):
    """Dataset or figure cannot be made; what was computed is in the case store.

    ``is_unwritable`` tells that it is for want of a disk, and not because of what was computed.
    """

    def __init__(self, message: str, *, is_unwritable: bool = False):
        super().__init__(message)
        self.is_unwritable = is_unwritable


class Results(NamedTuple):
    """Files of results, the dataset first: those ``written``, or ``unchanged`` since the same inputs gave them."""

    written: tuple[Path, ...] = ()
    unchanged: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """All of them, the dataset first."""
        return (*self.written, *self.unchanged)

    def __str__(self) -> str:
        what = "wrote" if self.written else "unchanged:"
        return f"{what} {', '.join(map(str, self.files))}"


def publish(plan: Plan, records: Mapping[str, Record], attributes: Mapping[str, str], output: Path) -> Results:
    """Write ``<study>.nc`` and its figure, if it has one, into ``output``; return the files.

    ``attributes`` tell of the run. Files that the same inputs gave stay as they are, with the attributes of the run
    that wrote them.

    Raises:
        ResultsError: whatever keeps them from being made.
    """
    what = f"{output}: the results of {plan.study.file} cannot be"
    file = result_files(output, plan.study.name)[0]
    try:
        plan = with_depths(plan, records)
        inputs = inputs_of(plan, records)
        if files := made_from(inputs, file):
            return Results(unchanged=files)
        from epsmesh.report.dataset import build, write  # noqa: PLC0415 (xarray is slow to load, and no shard needs it)
        from epsmesh.report.read import check_kind  # noqa: PLC0415

        check_kind(file)
        dataset = build(plan, records, attributes)
        write(dataset, file)
        from epsmesh.report.figures import draw  # noqa: PLC0415 (matplotlib is slow to load, and wanted last)

        files = (file, *draw(dataset, file.with_suffix("")))
        note_made(files, inputs)
        return Results(files)
    except (OSError, RuntimeError) as error:  # of a full disk HDF5 tells the latter
        raise ResultsError(f"{what} written: {error}; all forces are on record", is_unwritable=True) from error
    except Exception as error:
        if is_interrupt(error):
            raise
        raise ResultsError(f"{what} built: {type(error).__name__}: {error}; all forces are on record") from error
