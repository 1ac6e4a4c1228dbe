"""Signs of depth and force with which both are positive where the tool presses: found where all evidence agrees."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh_identify.experiment.checks import check_rise
from epsmesh_identify.experiment.columns import Recorded
from epsmesh_identify.experiment.reading import ExperimentError, Reading
from epsmesh_identify.experiment.segments import turning_points

# Shares of the depth at both ends of a curve that are compared, and by how much the contact's end must vary more, or
# have the larger force: an offset of the force makes the latter less sure.
_END, _CLEAR, _CLEAR_SIZE = 0.25, 2.0, 10.0
_STEP, _FEWEST, _BETWEEN = 0.02, 4, (0.1, 0.9)
# Strokes turn by this share of the depth's range, and go over it but for this share at each end; places on them.
_TURN, _SHORT, _PLACES = 0.1, 0.1, 80


def signs_of(found: Recorded, reading: Reading) -> tuple[int, int]:
    """Return the signs of depth and force with which both are positive where the tool presses.

    Where no end is the deep one, as of a straight line without air, the tool advances from the first row on.

    Raises:
        ExperimentError: if the study gives no sign of the depth, and a curve is deep at one end by its turn, and at the
            other by its force.
    """
    ends = {reading.depth_sign} if reading.depth_sign else _deep_ends(found.depth, found.force)
    if len(ends) > 1:
        low, high = sorted(float(np.median(found.force[_last(found.depth, end)])) for end in (-1, 1))
        check_rise(found, low, high)
        why = "it is not clear at which end of the depths the tool presses: write sign = {depth = 1, force = 1} in "
        why += "[[measurement]] if both are largest there, else -1 for what is smallest"
        raise ExperimentError(found.file, why, column=found.depth_name)
    depth = next(iter(ends), 0) or _by_time(found.depth, found.force)
    way, force = _mean_stroke(found.depth * depth, found.force)
    deep, shallow = (np.median(force[end]) for end in (way >= way.max() - 0.05 * np.ptp(way), _last(way, -1)))
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
    rows = _moving(depth)
    depth, force = depth[rows], force[rows]
    way, mean = _mean_stroke(depth, force)
    varies = _clear_end(_spread(way, mean, -1), _spread(way, mean, 1), _CLEAR)
    is_large = _clear_end(_size(way, mean, -1), _size(way, mean, 1), _CLEAR_SIZE)
    return {_turned_to(depth), varies} - {0} or {is_large} - {0}


def _by_time(depth: FloatArray, force: FloatArray) -> int:
    """Return the sign with which the depth rises from the first row to the one of the largest change of force."""
    return -1 if depth[int(np.argmax(np.abs(force - force[0])))] < depth[0] else 1


def _clear_end(low: float, high: float, clear: float) -> int:
    """Return which of two ends has the larger value, -1 or 1; 0 if it is not so many times as large."""
    return 0 if max(low, high) <= clear * min(low, high) else 1 if high > low else -1


def _turned_to(depth: FloatArray) -> int:
    """Return the end, -1 or 1, at which a curve turns that begins and ends at the other one; 0 if it does not."""
    low, range_ = float(depth.min()), float(np.ptp(depth))
    ends = (depth[[0, -1]] - low) / range_
    return 1 if (ends < _SHORT).all() else -1 if (ends > 1 - _SHORT).all() else 0


def _mean_stroke(depth: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return depths, and the mean of the forces of strokes to both directions: a drift cancels but for a constant.

    A curve of one stroke is as it was. Strokes that do not go over the whole depth are left out.
    """
    turns = [row for row in turning_points(depth, _TURN * float(np.ptp(depth))) if 0 < row < len(depth) - 1]
    strokes = [slice(a, b + 1) for a, b in pairwise([0, *turns, len(depth) - 1])]
    whole = [rows for rows in strokes if np.ptp(depth[rows]) >= (1 - 2 * _SHORT) * np.ptp(depth)]
    if len(strokes) == 1 or not whole:
        return depth, force
    low, high = (side(end(depth[rows]) for rows in whole) for side, end in ((max, np.min), (min, np.max)))
    way = np.linspace(low, high, _PLACES)
    means = []
    for sign in (-1, 1):
        along = [rows for rows in whole if sign * (depth[rows][-1] - depth[rows][0]) > 0]
        orders = [np.argsort(depth[rows], kind="stable") for rows in along]
        each = [
            np.interp(way, depth[rows][order], force[rows][order]) for rows, order in zip(along, orders, strict=True)
        ]
        means += [np.mean(each, axis=0)] if each else []
    return way, np.asarray(np.mean(means, axis=0))


def _moving(depth: FloatArray) -> list[int]:
    """Return rows between which the depth changes by a small share of its range: a hold has one row only."""
    least, last, rows = _STEP * float(np.ptp(depth)), depth[0], [0]
    for row, value in enumerate(depth.tolist()):
        if abs(value - last) > least:
            last = value
            rows.append(row)
    return rows


def _last(along: FloatArray, end: int) -> BoolArray:
    """Return which depths are in the last quarter towards an ``end``."""
    return end * along >= (end * along).max() - _END * np.ptp(along)


def _spread(depth: FloatArray, force: FloatArray, end: int) -> float:
    """Return by how much the force varies in the last quarter of the depths towards an ``end``: by slope or range."""
    near = _last(depth, end)
    if near.sum() < _FEWEST or np.ptp(depth[near]) == 0:
        return 0.0
    slope = np.polyfit(depth[near] - depth[near].mean(), force[near], 1)[0]
    between = np.ptp(np.quantile(force[near], _BETWEEN))
    return float(max(abs(slope) * np.ptp(depth[near]), between))


def _size(depth: FloatArray, force: FloatArray, end: int) -> float:
    """Return the size of the force at the last depths towards an ``end``: without air, it is small at first touch."""
    along = end * depth
    return float(abs(np.median(force[along >= along.max() - 0.05 * np.ptp(along)])))
