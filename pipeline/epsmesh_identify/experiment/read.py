"""Force curves from files: text in columns, in SI units, one segment of one cycle."""

import os
import re
from collections.abc import Sequence
from glob import has_magic
from pathlib import Path

import numpy as np

from epsmesh.arrays import BoolArray
from epsmesh.files import matching
from epsmesh_identify.experiment.checks import check_contact, check_count, check_size, without_saturation
from epsmesh_identify.experiment.columns import Choice, Recorded
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.order import check_order
from epsmesh_identify.experiment.reading import ExperimentError, Reading, Window
from epsmesh_identify.experiment.segments import Cycle, cycles_of
from epsmesh_identify.experiment.signs import signed
from epsmesh_identify.experiment.table import table_of
from epsmesh_identify.experiment.text import read_lines

# Files of a folder whose errors are listed; the others are counted.
_MOST_LISTED = 5
# A row at the end of a window is in it.
_ROUNDING = 1e-9


def files_of(pattern: str, folder: Path) -> tuple[Path, ...]:
    """Return the files that a ``pattern`` names, relative to a ``folder``, in the order of the numbers in their names.

    Raises:
        ExperimentError: if there is none.
    """
    path = folder / pattern
    if path.is_file() or not has_magic(pattern):
        return (path,)
    found = matching(path)
    if not found:
        raise ExperimentError(os.fspath(path), "no file has a name of this pattern")
    return tuple(sorted(found, key=_by_number))


def _by_number(path: Path) -> list[tuple[int, int | str]]:
    """Return the key by which well_9 is before well_10."""
    parts = re.split(r"(\d+)", os.fspath(path))
    return [(0, int(part)) if part.isdecimal() else (1, part) for part in parts]


def read_curves(pattern: str, reading: Reading, folder: Path = Path()) -> tuple[Curve | ExperimentError, ...]:
    """Return the curve of each file that a ``pattern`` names, or why it has none.

    Raises:
        ExperimentError: if none has a curve, with the first few reasons.
    """
    found: list[Curve | ExperimentError] = []
    for path in files_of(pattern, folder):
        try:
            found.append(read_curve(path, reading))
        except ExperimentError as error:
            found.append(error)
        except Exception as error:  # an odd file does not end a folder
            found.append(ExperimentError(str(path), f"cannot be read: {type(error).__name__}: {error}"))
    return some(found, pattern)


def some(found: Sequence[Curve | ExperimentError], pattern: str) -> tuple[Curve | ExperimentError, ...]:
    """Return what was found in the files of a ``pattern``, if there is a curve.

    Raises:
        ExperimentError: if there is none, with the first few reasons.
    """
    errors = [one for one in found if isinstance(one, ExperimentError)]
    if len(errors) < len(found):
        return tuple(found)
    if len(errors) == 1:
        raise errors[0]
    listed = [str(error) for error in errors[:_MOST_LISTED]]
    more = [f"… and {len(errors) - _MOST_LISTED} more files"] if len(errors) > _MOST_LISTED else []
    raise ExperimentError(pattern, "\n".join([f"{len(errors)} files, and none has such a curve:", *listed, *more]))


def read_curve(path: Path, reading: Reading) -> Curve:
    """Return the curve of one file.

    Raises:
        ExperimentError: if there is none, or it is not as ``reading`` says: file, line and column, and what to do.
    """
    found = whole_curve(path, reading)
    inside = _inside(found, reading.window)
    found = check_size(signed(found, reading))
    cycles = cycles_of(found.depth, found.time)
    found = _segment(found, cycles, inside, reading)
    if reading.segment.startswith("approach"):
        found = check_count(without_saturation(found), reading.segment)
        found = check_contact(found, is_rising=reading.segment == "approach", is_cut=reading.window is None)
    return Curve(path.stem, found.depth, found.force, found.time, found.notes)


def whole_curve(path: Path, reading: Reading) -> Recorded:
    """Return all rows of a file as recorded, in order."""
    found = Choice(table_of(read_lines(path), str(path)), reading).recorded()
    return check_order(check_count(found, "the file"))


def _inside(found: Recorded, window: Window | None) -> BoolArray:
    """Return which rows are in a window."""
    if window is None:
        return np.ones(len(found.depth), dtype=bool)
    if window.unit == "s" and found.time is None:
        raise ExperimentError(found.file, "window is a range of time, and no column of time is known")
    values = found.depth if found.time is None or window.unit == "m" else found.time
    rounding = _ROUNDING * (window.high - window.low)
    inside: BoolArray = (values >= window.low - rounding) & (values <= window.high + rounding)
    if not inside.any():
        factor, unit = (1e3, "mm") if window.unit == "m" else (1.0, "s")
        ends = " to ".join(f"{factor * end:g} {unit}" for end in (window.low, window.high))
        there = " to ".join(f"{factor * end:g} {unit}" for end in (values.min(), values.max()))
        raise ExperimentError(found.file, f"no row is in the window {ends}: recorded are {there}")
    return inside


def _segment(found: Recorded, cycles: tuple[Cycle, ...], inside: BoolArray, reading: Reading) -> Recorded:
    """Return the rows of a segment of a cycle that are in the window."""
    if reading.cycle > len(cycles):
        raise ExperimentError(found.file, f"cycle = {reading.cycle}: it has {len(cycles)}")
    if len(cycles) > 1:
        found = found.noting(f"{len(cycles)} cycles: number {reading.cycle} is read")
    rows = np.arange(len(found.depth))[cycles[reading.cycle - 1].rows(reading.segment)]
    if not rows.size:
        raise ExperimentError(found.file, _absent(cycles[reading.cycle - 1], reading.segment))
    what = f"the {reading.segment} of cycle {reading.cycle}" if len(cycles) > 1 else f"the {reading.segment}"
    within = rows[inside[rows]]
    return check_count(found.part(within), what if inside.all() else f"{what} in the window")


def _absent(cycle: Cycle, segment: str) -> str:
    """Say why a cycle has no such segment."""
    if segment == "approach":
        return 'has no approach: the depth only falls; it is a retract (segment = "retract"), or sign.depth is wrong'
    if segment == "hold":
        return "has no hold: the depth is nowhere constant near its largest value"
    return "has no retract: it ends at its largest depth"
