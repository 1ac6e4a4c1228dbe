"""Movement of a probe over time, and what a body answers."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Course:
    """The movement over time: ``shares`` of the whole movement at ``times`` (s), which do not decrease.

    The share is linear in between. ``breaks`` are those numbers of times at which its rate changes. The first time is
    0 s; if its share is not zero, the movement begins with a jump. ``share_at`` returns the shares at any times.

    ``accuracy`` is that of the largest force, relative to it: of the time steps and, in a request, of the mesh, too.
    """

    times: tuple[float, ...]
    shares: tuple[float, ...]
    breaks: frozenset[int] = frozenset()
    share_at: Callable[[FloatArray], FloatArray] | None = None
    accuracy: float = inf

    def left(self, error: float) -> "Course":
        """Return the course with what the relative ``error`` of a mesh leaves of the accuracy, a tenth at least."""
        return replace(self, accuracy=max(self.accuracy - error, self.accuracy / 10))

    def refined(self) -> "Course":
        """Return the course with one more time between any two."""
        return self._with_middles(np.arange(1, len(self.times)))

    def with_halves(self) -> "Course":
        """Return the course with one more time between any two breaks that follow each other.

        Steps of twice the length, which tell the error, do not go beyond a break.
        """
        return self._with_middles(np.array([n for n in sorted(self.breaks) if n - 1 in self.breaks], dtype=int))

    def _with_middles(self, numbers: IntArray) -> "Course":
        """Return the course with one more time before each of those with these ``numbers``, which rise."""
        own = np.array(self.times)
        times = np.insert(own, numbers, (own[numbers] + own[numbers - 1]) / 2)
        share_at = self.share_at or (lambda at: np.interp(at, own, self.shares))
        shares = tuple(map(float, share_at(times)))
        breaks = frozenset(n + int(np.searchsorted(numbers, n, side="right")) for n in self.breaks)
        return replace(self, times=tuple(times.tolist()), shares=shares, breaks=breaks)

    def coarse(self) -> "Course":
        """Return the course of every other time, all breaks included."""
        kept = sorted(self.halves())
        breaks = frozenset(number for number, own in enumerate(kept) if own in self.breaks)
        times, shares = (tuple(values[number] for number in kept) for values in (self.times, self.shares))
        return replace(self, times=times, shares=shares, breaks=breaks)

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

    ``forces`` (n, 3) are those of the tissue on the probe (N), with ``bars`` (n) of the time steps, and of
    the distance of nodes at the edge of contact, along the axis (N).
    ``dissipated`` (n) is the energy (J) turned into heat since the beginning, ``imbalance`` (n) the difference (J) of
    work and of what is stored and dissipated. ``areas`` (n, m²) are those of unilateral contact, NaN without.
    ``sag`` (m) is how much farther the tool moves to the first touch under loads, ``load_energy`` (J) their strain
    energy without it; both NaN without loads, and where a footprint is prescribed.
    """

    times: FloatArray
    forces: FloatArray
    bars: FloatArray
    dissipated: FloatArray
    imbalance: FloatArray
    areas: FloatArray
    sag: float = nan
    load_energy: float = nan

    def with_half_the_steps(self, coarse: "History", numbers: list[int]) -> "History":
        """Return the history with the change of the force from that of every other time, ``numbers``, in its bars.

        With friction, whose law is that of the end of a step, an error is about as large as that change.
        """
        change = fitted.STEPS_FRICTION * np.abs(self.forces[numbers, 2] - coarse.forces[:, 2])
        more = between(dict(zip(numbers, change.tolist(), strict=True)), len(self.times))
        return replace(self, bars=self.bars + more)

    @property
    def bar(self) -> float:
        """The largest bar, relative to the largest force."""
        return float(self.bars.max() / np.abs(self.forces[:, 2]).max())


def between(found: dict[int, float], count: int) -> FloatArray:
    """Return values at ``count`` points from those ``found`` at some: of the two neighbours, the larger one."""
    known = np.array(sorted(found))
    values = np.array([found[number] for number in known])
    right = np.clip(np.searchsorted(known, np.arange(count)), 0, len(known) - 1)
    left = np.where(known[right] == np.arange(count), right, np.maximum(right - 1, 0))
    return np.maximum(values[left], values[right])
