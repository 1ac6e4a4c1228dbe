"""Checks of the order of rows: what is no curve over time is an error, gaps and jumps are noted."""

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.experiment.columns import Recorded
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.experiment.segments import turning_points

# Turns of the depth, by more than a twentieth of its range, of rows that are in no order: this share of the rows.
_JUMP, _MOST_TURNS = 0.05, 0.2
# A step this many times the usual one, and at least this share of all, is a gap.
_GAP, _SHARE = 4.0, 0.02
# A change of the depth by this share of its range from row to row is a jump.
_FALL = 0.2
# A value off both neighbours by this share of the range of most values, and so many usual steps, is none of the curve.
_SPIKE, _SPIKE_NOISE, _INNER = 0.25, 20.0, (0.02, 0.98)


# Shares of the rows in which a force goes one way, and a depth that is none does; and in which a depth may rest.
_EVEN, _UNEVEN, _STILL, _FEWEST = 0.98, 0.8, 0.1, 20
# Steps that differ by this share of them are even. Times (s) from here on are dates.
_EXACT, _DATE = 1e-3, 1e6


def check_order(found: Recorded) -> Recorded:
    """Return the curve; report rows that are in no order, and note gaps in time."""
    if np.ptp(found.depth) == 0:
        raise ExperimentError(found.file, "the depth never changes", column=found.depth_name)
    if np.ptp(found.force) == 0:
        raise ExperimentError(found.file, "the force never changes", column=found.force_name)
    if found.time is not None:
        _check_time(found, found.time)
    turns = turning_points(found.depth, _JUMP * float(np.ptp(found.depth)))
    if len(turns) > max(_MOST_TURNS * len(found.depth), 5):
        line = int(found.lines[turns[1]])
        why = "the depth jumps to and fro: rows are not in the order of time, or this column is not the depth"
        raise ExperimentError(found.file, why, column=found.depth_name, line=line)
    _check_swapped(found)
    _check_spikes(found, found.depth, found.depth_name)
    _check_spikes(found, found.force, found.force_name)
    _check_last(found)
    return found.noting(*_jumps(found), *(_of_time(found, found.time) if found.time is not None else ()))


def _check_time(found: Recorded, time: FloatArray) -> None:
    """Report times that fall."""
    steps = np.diff(time)
    if (steps < 0).any():
        row = int(np.flatnonzero(steps < 0)[0]) + 1
        falls = int((steps < 0).sum())
        why = f"time falls from {time[row - 1]:g} s to {time[row]:g} s: "
        why += "a second test begins here: write each to its own file" if falls == 1 else (
            f"it falls in {falls} rows, so these are in no order, or depth and time are swapped")  # fmt: skip
        raise ExperimentError(found.file, why, column=found.names["time"], line=int(found.lines[row]))


def _check_swapped(found: Recorded) -> None:
    """Report a force that only rises or falls beside a depth that goes to and fro: the one is the other."""
    top = int(np.argmax(np.abs(found.force - found.force[0])))
    if top < _FEWEST:
        return
    steps = [np.diff(values[: top + 1]) for values in (found.force, found.depth)]
    force, depth = (max(float((step > 0).mean()), float((step < 0).mean())) for step in steps)
    if force >= _EVEN and depth <= _UNEVEN and float((steps[1] == 0).mean()) < _STILL:
        why = "the depth goes to and fro from row to row, and the force does not: are these columns swapped?"
        raise ExperimentError(found.file, why, column=found.depth_name)


def _check_last(found: Recorded) -> None:
    """Report a force of the last row that is far off those before, while the depth goes on as before."""
    force, depth = np.abs(np.diff(found.force)), np.abs(np.diff(found.depth))
    least = max(_SPIKE * float(np.ptp(found.force[:-1])), _SPIKE_NOISE * float(np.median(force)))
    if force[-1] > least and force[-1] > _GAP * force[-4:-1].max() and depth[-1] <= _GAP * float(np.median(depth)):
        why = f"{found.force[-1]:.4g} (SI) is far off the rows before, and it is the last: remove or correct it"
        raise ExperimentError(found.file, why, column=found.force_name, line=int(found.lines[-1]))


def _of_time(found: Recorded, time: FloatArray) -> list[str]:
    """Tell gaps in time, and a depth that looks like a time while the time looks like a depth."""
    notes = gaps(found, time, "time", "s")
    steps = np.abs(np.diff(found.depth))
    is_clock = found.depth[0] == 0 and np.ptp(steps) <= _EXACT * steps.max()
    if is_clock and 0 < abs(found.began) < _DATE and np.ptp(np.diff(time)) > 10 * _EXACT * np.abs(np.diff(time)).max():
        notes.append("the depth rises in even steps from 0, and the time does not: are these columns swapped?")
    return notes


def _check_spikes(found: Recorded, values: FloatArray, name: str) -> None:
    """Report a value that is far off those before and after it: a code for a missing value, or a misplaced row."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1])  # the same value several times is one
    steps = np.diff(values[starts])
    least = _SPIKE * float(np.ptp(np.quantile(values, _INNER)))
    least = max(least, _SPIKE_NOISE * float(np.median(np.abs(steps))) if steps.size else 0.0)
    back = np.minimum(np.abs(steps[:-1]), np.abs(steps[1:]))
    spikes = np.flatnonzero((back > least) & (steps[:-1] * steps[1:] < 0)) + 1
    if spikes.size:
        row = int(starts[spikes[0]])
        why = f"{values[row]:.4g} (SI) is far off the rows before and after; so are {spikes.size - 1} more. " if (
            spikes.size > 1) else f"{values[row]:.4g} (SI) is far off the rows before and after. "  # fmt: skip
        why += "Is it a code for a missing value, or are rows in no order? Remove or correct them"
        raise ExperimentError(found.file, why, column=name, line=int(found.lines[row]))


def _jumps(found: Recorded) -> list[str]:
    """Tell times that are there twice, and a fall of the depth from one row to the next, as between blocks of rows."""
    notes = []
    if found.time is not None and (same := int((np.diff(found.time) == 0).sum())):
        notes.append(f"{same} rows have the time of the row before")
    steps = np.diff(found.depth)
    row = int(np.argmax(np.abs(steps)))
    if abs(steps[row]) > max(_FALL * float(np.ptp(found.depth)), _GAP * float(np.median(np.abs(steps)))):
        jump, line = abs(steps[row]), found.lines[row + 1]
        notes.append(f"the depth jumps by {jump:.3g} m before line {line}: is this one curve, in order?")
    return notes


def gaps(found: Recorded, values: FloatArray, what: str, unit: str) -> list[str]:
    """Say where the largest step of a column is much larger than the usual one."""
    steps = np.abs(np.diff(values))
    row, moving = int(np.argmax(steps)), steps[steps > 0]
    usual = float(np.median(moving)) if moving.size else 0.0
    if steps[row] <= max(_GAP * usual, _SHARE * float(np.ptp(values))):
        return []
    return [f"gap of {steps[row]:.3g} {unit} in {what} before line {found.lines[row + 1]}"]
