"""Signs of depth and force with which both are positive where the tool presses: found where all evidence agrees."""

from dataclasses import replace

import numpy as np
import pandas as pd

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh_identify.experiment.checks import check_rise
from epsmesh_identify.experiment.columns import Recorded
from epsmesh_identify.experiment.reading import ExperimentError, Reading
from epsmesh_identify.experiment.segments import turning_points

# Shares of the depth at both ends of a curve that are compared: all of contact or air there, and its last rows.
_END, _LAST = 0.25, 0.05
# How many times the force must vary more at the contact's end, or be larger: an offset makes the latter less sure.
_CLEAR, _CLEAR_SIZE = 2.0, 10.0
# Strokes turn by this share of the depth's range; a curve that returns ends within it of its first depth. Places.
_TURN, _PLACES, _BETWEEN = 0.1, 80, (0.1, 0.9)


def signs_of(found: Recorded, reading: Reading) -> tuple[int, int]:
    """Return the signs of depth and force with which both are positive where the tool presses.

    Where no end is the deep one, as of a straight line without air, the tool advances from the first row on.

    Raises:
        ExperimentError: if the study gives no sign of the depth, and a curve is deep at one end by its turn, and at the
            other by its force.
    """
    ends = {reading.depth_sign} if reading.depth_sign else _deep_ends(found.depth, found.force)
    if len(ends) > 1:
        low, high = sorted(float(np.median(found.force[_near(found.depth, end, _END)])) for end in (-1, 1))
        check_rise(found, low, high)
        why = "it is not clear at which end of the depths the tool presses: write sign = {depth = 1, force = 1} in "
        why += "[[measurement]] if both are largest there, else -1 for what is smallest"
        raise ExperimentError(found.file, why, column=found.depth_name)
    depth = next(iter(ends), 0) or _first_way(found.depth, found.force)
    way, force = _mean_stroke(found.depth * depth, found.force)
    deep, shallow = np.median(force[_near(way, 1, _LAST)]), np.median(force[_near(way, -1, _END)])
    return depth, reading.force_sign or (-1 if deep < shallow else 1)


def signed(found: Recorded, reading: Reading) -> Recorded:
    """Return the curve with depth and force positive where the tool presses: see :func:`signs_of`."""
    depth_sign, force_sign = signs_of(found, reading)
    notes = []
    if reading.depth_sign is None and depth_sign < 0:
        notes.append(f"depth falls as the tool advances (column `{found.depth_name}`): its sign is changed")
    if reading.force_sign is None and force_sign < 0:
        notes.append(f"force is negative under pressure (column `{found.force_name}`): its sign is changed")
    own = _deep_ends(found.depth, found.force)
    if reading.depth_sign and own == {-reading.depth_sign}:
        notes.append(f"sign.depth = {depth_sign} makes the end with constant force the deep one: is it {-depth_sign}?")
    if not (reading.depth_sign or own):
        notes.append("no end is clearly the deep one: the tool advances from the first row on, or give sign")
    depth, force = found.depth * depth_sign, found.force * force_sign
    if found.deflection is not None:  # the depth is the piezo's way less what the spring yields
        depth = depth - found.deflection * force_sign
    return replace(found, depth=depth, force=force, deflection=None).noting(*notes)


def _deep_ends(depth: FloatArray, force: FloatArray) -> set[int]:
    """Return the ends of the depths, 1 for the largest, at which the tool presses by all evidence; {} for none.

    A curve that begins and ends at the same depth is deep where it turns; the force varies in contact, not in air.
    Where neither says anything, as without air, the end with a much larger force is the deep one.
    """
    low, high = depth.min() + _TURN * np.ptp(depth), depth.max() - _TURN * np.ptp(depth)
    turned = int((depth[[0, -1]] < low).all()) - int((depth[[0, -1]] > high).all())
    way, mean = _mean_stroke(depth, force)
    ends = {turned, _clear_end([_spread(way, mean, end) for end in (-1, 1)], _CLEAR)} - {0}
    sizes = [float(abs(np.median(mean[_near(way, end, _LAST)]))) for end in (-1, 1)]
    return ends or {_clear_end(sizes, _CLEAR_SIZE)} - {0}


def _first_way(depth: FloatArray, force: FloatArray) -> int:
    """Return the sign with which the depth rises from the first row to the one of the largest change of force."""
    return -1 if depth[int(np.argmax(np.abs(force - force[0])))] < depth[0] else 1


def _clear_end(values: list[float], clear: float) -> int:
    """Return which of two ends has the larger value, -1 or 1; 0 if it is not so many times as large."""
    low, high = values
    return 0 if max(values) <= clear * min(values) else 1 if high > low else -1


def _mean_stroke(depth: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places along the depth, and the mean of the forces there of strokes to both directions.

    A drift of the force cancels but for a constant. Where strokes go to one direction only, their forces alone count.
    """
    turns = turning_points(depth, _TURN * float(np.ptp(depth)))
    stroke = np.searchsorted([row for row in turns if 0 < row < len(depth) - 1], np.arange(len(depth))) % 2
    place = np.minimum(_PLACES * (depth - depth.min()) / np.ptp(depth), _PLACES - 1).astype(int)
    rows = pd.DataFrame({"depth": depth, "force": force}).groupby([place, stroke]).mean().unstack()
    both = rows.dropna() if len(rows.dropna()) > _PLACES / 2 else rows
    return both["depth"].mean(axis=1).to_numpy(), both["force"].mean(axis=1).to_numpy()


def _near(depth: FloatArray, end: int, share: float) -> BoolArray:
    """Return which depths are within a ``share`` of their range of an ``end``: 1 for the largest, -1 for the least."""
    near: BoolArray = end * depth >= (end * depth).max() - share * np.ptp(depth)
    return near


def _spread(depth: FloatArray, force: FloatArray, end: int) -> float:
    """Return by how much the force varies in the last quarter of the depths towards an ``end``: by slope or range."""
    near = _near(depth, end, _END)
    if near.sum() < 3:
        return 0.0
    slope = np.polyfit(depth[near] - depth[near].mean(), force[near], 1)[0]
    return float(max(abs(slope) * np.ptp(depth[near]), np.ptp(np.quantile(force[near], _BETWEEN))))
