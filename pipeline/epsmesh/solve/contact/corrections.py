"""What elements of one degree more add to the states of a load path: initial guesses for the next depth's error bar."""

from dataclasses import dataclass, field

import numpy as np

from epsmesh.arrays import FloatArray

# Corrections are continued linearly through so many depths, at most so many times their own distance.
_REMEMBERED, _FARTHEST = 2, 2.0


@dataclass(eq=False)
class Corrections:
    """Corrections (owned dofs of the finer elements) of the last depths (m) of a path."""

    _known: list[tuple[float, FloatArray]] = field(default_factory=list)

    def add(self, depth: float, correction: FloatArray) -> None:
        """Remember the ``correction`` at a ``depth`` (m)."""
        self._known = [*self._known, (depth, correction)][-_REMEMBERED:]

    def at(self, depth: float) -> FloatArray | None:
        """Return the correction expected at a ``depth`` (m), None without an earlier one."""
        if not self._known:
            return None
        last, correction = self._known[-1]
        if len(self._known) == _REMEMBERED:
            before, earlier = self._known[0]
            share = (depth - last) / (last - before) if last > before else np.inf
            if 0 <= share <= _FARTHEST:
                return correction + share * (correction - earlier)
        return correction * (depth / last)
