"""Signs of depth and force: deeper and pressed are positive."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.experiment.columns import Recorded
from epsmesh_identify.experiment.reading import Reading
from epsmesh_identify.experiment.segments import turning_points

# Shares of the depth at both ends of a curve that are compared, and by how much the contact's end must vary more, or
# have the larger force: an offset of the force makes the latter less sure.
_END, _CLEAR, _CLEAR_SIZE = 0.25, 2.0, 10.0
_STEP, _FEWEST, _BETWEEN = 0.02, 4, (0.1, 0.9)
# Strokes turn by this share of the depth's range, and go over it but for this share at each end; places on them.
_TURN, _SHORT, _PLACES = 0.1, 0.1, 80


def signs_of(found: Recorded, reading: Reading) -> tuple[int, int]:
    """Return the signs of depth and force with which both are positive where the tool presses.

    Force varies where there is contact, and not in air: this end of the depths is the deep one, and the force there
    is pressure. A curve that begins and ends at the same depth is deep where it turns. Where neither is clear, the end
    with the larger force is the deep one; where these are alike, too, the tool is taken to advance from the first row
    on.
    """
    depth = reading.depth_sign or _deep_end(found.depth, found.force) or _by_time(found.depth, found.force)
    way, force = _mean_stroke(found.depth * depth, found.force)
    return depth, reading.force_sign or _force_sign(way, force)


def signed(found: Recorded, reading: Reading) -> Recorded:
    """Return the curve with depth and force positive where the tool presses: see :func:`signs_of`."""
    depth_sign, force_sign = signs_of(found, reading)
    notes = []
    if reading.depth_sign is None and depth_sign < 0:
        notes.append(f"depth falls as the tool advances (column `{found.depth_name}`): its sign is changed")
    if reading.force_sign is None and force_sign < 0:
        notes.append(f"force is negative under pressure (column `{found.force_name}`): its sign is changed")
    own = _deep_end(found.depth, found.force)
    if own and reading.depth_sign == -own:
        notes.append(f"sign.depth = {reading.depth_sign} makes the end with constant force the deep one: is it {own}?")
    depth, force = found.depth * depth_sign, found.force * force_sign
    if found.deflection is not None:  # the depth is the piezo's way less what the spring yields
        depth = depth - found.deflection * force_sign
    return replace(found, depth=depth, force=force, deflection=None).noting(*notes)


def _deep_end(depth: FloatArray, force: FloatArray) -> int:
    """Return 1 if contact is at the largest depths, -1 if at the smallest; 0 if that is not clear."""
    rows = _moving(depth)
    depth, force = depth[rows], force[rows]
    way, mean = _mean_stroke(depth, force)
    spreads, sizes = ((measure(way, mean, -1), measure(way, mean, 1)) for measure in (_spread, _size))
    return (
        _clear_end(*spreads, _CLEAR_SIZE)
        or _turned_to(depth)
        or _clear_end(*spreads, _CLEAR)
        or _clear_end(*sizes, _CLEAR_SIZE)
    )


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


def _spread(depth: FloatArray, force: FloatArray, end: int) -> float:
    """Return by how much the force varies in the last quarter of the depths towards an ``end``: by slope or range."""
    along = end * depth
    near = along >= along.max() - _END * np.ptp(along)
    if near.sum() < _FEWEST or np.ptp(along[near]) == 0:
        return 0.0
    slope = np.polyfit(along[near] - along[near].mean(), force[near], 1)[0]
    between = np.ptp(np.quantile(force[near], _BETWEEN))
    return float(max(abs(slope) * np.ptp(along[near]), between))


def _size(depth: FloatArray, force: FloatArray, end: int) -> float:
    """Return the size of the force at the last depths towards an ``end``: without air, it is small at first touch."""
    along = end * depth
    return float(abs(np.median(force[along >= along.max() - 0.05 * np.ptp(along)])))


def _by_time(depth: FloatArray, force: FloatArray) -> int:
    """Return the sign with which the depth rises from the first row to the one of the largest change of force."""
    turn = int(np.argmax(np.abs(force - force[0])))
    return -1 if depth[turn] < depth[0] else 1


def _force_sign(depth: FloatArray, force: FloatArray) -> int:
    """Return the sign with which the force at the deep end is pressure."""
    span = np.ptp(depth)
    deep, shallow = depth >= depth.max() - 0.05 * span, depth <= depth.min() + _END * span
    return -1 if np.median(force[deep]) < np.median(force[shallow]) else 1
