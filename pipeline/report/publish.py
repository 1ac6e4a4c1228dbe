"""What a study gives its readers: the dataset, and the figure beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from pipeline.files import result_files
from pipeline.launcher import is_interrupt
from pipeline.plan.plan import Plan
from pipeline.run.record import Record


class ResultsError(Exception):
    """Dataset or figure cannot be made; what was computed is in the case store.

    ``is_unwritable`` tells that it is for want of a disk, and not because of what was computed.
    """

    def __init__(self, message: str, *, is_unwritable: bool = False):
        super().__init__(message)
        self.is_unwritable = is_unwritable


class Results(NamedTuple):
    """Files of results: those ``written``, the dataset first, and figures that had the same numbers before."""

    written: tuple[Path, ...] = ()
    unchanged: tuple[Path, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """All of them, the dataset first."""
        return (*self.written, *self.unchanged)

    def __str__(self) -> str:
        left = f"; unchanged: {', '.join(map(str, self.unchanged))}" if self.unchanged else ""
        return f"wrote {', '.join(map(str, self.written))}{left}"


def publish(plan: Plan, records: Mapping[str, Record], attributes: Mapping[str, str], output: Path) -> Results:
    """Write ``<study>.nc`` and its figure into ``output`` and return the files; ``attributes`` tell of the run.

    A figure of the same numbers stays as it is.

    Raises:
        ResultsError: whatever keeps them from being made.
    """
    from pipeline.report.dataset import build, write  # noqa: PLC0415 (xarray is slow to load, and no shard needs it)
    from pipeline.report.drawn import are_drawn, mark_of  # noqa: PLC0415

    what = f"{output}: the results of {plan.study.file} cannot be"
    path, *figures = result_files(output, plan.study.name)
    try:
        dataset = build(plan, records, attributes)
        write(dataset, path)
        if are_drawn(figures, mark_of(dataset)):
            return Results((path,), tuple(figures))
        from pipeline.report.figures import draw  # noqa: PLC0415 (matplotlib is slow to load, and wanted last)

        draw(dataset, path.with_suffix(""))
        return Results((path, *figures))
    except (OSError, RuntimeError) as error:  # of a full disk HDF5 tells the latter
        raise ResultsError(f"{what} written: {error}; all forces are on record", is_unwritable=True) from error
    except Exception as error:
        if is_interrupt(error):
            raise
        raise ResultsError(f"{what} built: {type(error).__name__}: {error}; all forces are on record") from error
