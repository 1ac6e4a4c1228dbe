"""Movement of a probe over time, and what a body answers."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import FloatArray


@dataclass(frozen=True)
class Course:
    """The movement over time: ``shares`` of the whole movement at ``times`` (s), which do not decrease.

    The share is linear in between. ``breaks`` are those numbers of times at which its rate changes. The first time is
    0 s; if its share is not zero, the movement begins with a jump.
    """

    times: tuple[float, ...]
    shares: tuple[float, ...]
    breaks: frozenset[int] = frozenset()

    def halves(self) -> frozenset[int]:
        """Return the numbers of the times of a course of every other time, all breaks included."""
        found, last = {0, *self.breaks, len(self.times) - 1}, 0
        for number in range(1, len(self.times)):
            if number in found or number - last == 2:
                found.add(number)
                last = number
        return frozenset(found)


@dataclass(frozen=True, eq=False)
class History:
    """What a body answers at n ``times`` (s); of the whole body, global.

    ``forces`` (n, 3) are those of the tissue on the probe (N), with ``bars`` (n) of the time steps along the axis (N).
    ``dissipated`` (n) is the energy (J) turned into heat since the beginning, ``imbalance`` (n) the difference (J) of
    work and of what is stored and dissipated. ``areas`` (n, m²) are those of found contact, NaN without.
    """

    times: FloatArray
    forces: FloatArray
    bars: FloatArray
    dissipated: FloatArray
    imbalance: FloatArray
    areas: FloatArray


def between(found: dict[int, float], count: int) -> FloatArray:
    """Return values at ``count`` points from those ``found`` at some: of the two neighbours, the larger one."""
    known = np.array(sorted(found))
    values = np.array([found[number] for number in known])
    right = np.clip(np.searchsorted(known, np.arange(count)), 0, len(known) - 1)
    left = np.where(known[right] == np.arange(count), right, np.maximum(right - 1, 0))
    return np.maximum(values[left], values[right])
