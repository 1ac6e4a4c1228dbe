"""Cycles of a curve, and approach, hold and retract of each: by the turning points of the depth, and its rate."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from epsmesh.arrays import FloatArray

# A turn of the depth by less than this share of its range is noise.
_TURN = 0.1
# A hold moves slower than this share of the approach, near the deepest place, for this many rows.
_SLOW, _NEAR, _FEWEST = 0.15, 0.85, 5
# Rows over which a rate is taken, as a share of all, and in rests of a depth that is recorded in coarse steps.
_WINDOW, _RESTS = 0.01, 3


@dataclass(frozen=True)
class Cycle:
    """Rows of one cycle: the approach ends where the hold begins, and the hold where the retract begins."""

    start: int
    hold: int
    retract: int
    end: int

    def rows(self, segment: str) -> slice:
        """Return the rows of a segment."""
        starts = {"approach": self.start, "hold": self.hold, "approach+hold": self.start, "retract": self.retract}
        ends = {"approach": self.hold, "hold": self.retract, "approach+hold": self.retract, "retract": self.end}
        return slice(starts[segment], ends[segment])


def cycles_of(depth: FloatArray, time: FloatArray | None) -> tuple[Cycle, ...]:
    """Return the cycles of a curve whose ``depth`` (n,) is positive inward; ``time`` (n,) in s, or None."""
    turns = turning_points(depth, _TURN * float(np.ptp(depth)))
    rises = [(a, b) for a, b in pairwise(turns) if depth[b] > depth[a]]
    if not rises:  # it only falls: one retract
        return (Cycle(0, 0, 0, len(depth)),)
    found = []
    for number, (low, top) in enumerate(rises):
        start = 0 if number == 0 and low < _FEWEST else low
        end = rises[number + 1][0] if number + 1 < len(rises) else len(depth)
        hold, retract = _hold(depth[start:end], None if time is None else time[start:end], top - start)
        found.append(Cycle(start, start + hold, start + retract, end))
    return tuple(found)


def turning_points(depth: FloatArray, least: float) -> list[int]:
    """Return the rows at which the depth turns by more than ``least`` (m), with the first and the last turn's ends."""
    turns, low, high, direction = [], 0, 0, 0
    for row, value in enumerate(depth.tolist()):
        if value > depth[high]:
            high = row
        if value < depth[low]:
            low = row
        if direction >= 0 and depth[high] - value > least:
            turns += [low] if direction == 0 and low < high else []
            turns.append(high)
            direction, low = -1, row
        elif direction <= 0 and value - depth[low] > least:
            turns += [high] if direction == 0 and high < low else []
            turns.append(low)
            direction, high = 1, row
    last = high if direction > 0 else low
    if direction and turns[-1] != last:
        turns.append(last)
    return turns


def _rest(depth: FloatArray) -> int:
    """Return the usual number of rows of one depth, one after the other: many if it is recorded in coarse steps."""
    changes = np.flatnonzero(np.diff(depth))
    return int(np.median(np.diff(changes))) if len(changes) > 2 else 1


def _hold(depth: FloatArray, time: FloatArray | None, top: int) -> tuple[int, int]:
    """Return where the hold begins and ends: at the deepest row if there is none."""
    clock = np.arange(len(depth), dtype=float) if time is None else time
    width = max(2, int(_WINDOW * len(depth)), _RESTS * _rest(depth[: top + 1]))
    if len(depth) < 3 * width or top < width:
        return top + 1, top + 1
    base, highest = depth[: top + 1].min(), depth[top]
    # Time from a fifth to four fifths of the way; the deepest row of a noisy hold may be anywhere in it.
    first, last = (int(np.argmax(depth >= base + share * (highest - base))) for share in (0.2, 0.8))
    usual = 0.6 * (highest - base) / max(clock[last] - clock[first], np.finfo(float).tiny)
    rate = np.zeros(len(depth))
    elapsed = np.maximum(clock[width:] - clock[:-width], np.finfo(float).tiny)
    middle = (depth[width:] - depth[:-width]) / elapsed
    rate[width // 2 : width // 2 + len(middle)] = middle
    rate[: width // 2], rate[width // 2 + len(middle) :] = middle[0], middle[-1]
    is_near = depth >= base + _NEAR * (highest - base)
    slow = np.flatnonzero(is_near & (np.abs(rate) < _SLOW * usual))
    if slow.size < max(_FEWEST, width):
        return top + 1, top + 1
    # Half the rows of a rate are those of the motion before and after.
    return max(int(slow[0]) - width // 2 + 1, 1), min(int(slow[-1]) + width // 2, len(depth))
