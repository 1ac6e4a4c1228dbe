"""Where the search for contact at one depth begins if others are known: where they lead to."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.contact.sets import Found, Obstacle

# So many depths are remembered: in a sweep in order the last ones are the neighbours.
_REMEMBERED = 2
# Two depths tell of a third that is at most so many times as far from them as they are from each other.
_FARTHEST = 2.0


@dataclass(frozen=True, eq=False)
class Start:
    """What to begin with: a set (n), what the elements solve for (owned dofs), twice the energy (J) about."""

    active: BoolArray
    unknowns: tuple[FloatArray, ...]
    energy: float


@dataclass(frozen=True, eq=False)
class _Known:
    depth: float
    found: Found
    unknowns: tuple[FloatArray, ...]


class Neighbours:
    """What was found at other depths of one material on one mesh."""

    def __init__(self) -> None:
        self._known: list[_Known] = []

    def add(self, depth: float, found: Found, unknowns: tuple[FloatArray, ...]) -> None:
        """Remember what was found at a ``depth`` (m), ``unknowns`` among it: displacements (m), and pressures."""
        others = [known for known in self._known if known.depth != depth]
        self._known = [*others, _Known(depth, found, unknowns)][-_REMEMBERED:]

    def start(self, obstacle: Obstacle) -> Start | None:
        """Return what to begin with at the depth of an ``obstacle``, or None: what is nearest is scaled, or
        extrapolated where two are known.
        """
        if not self._known:
            return None
        *others, last = sorted(self._known, key=lambda known: -abs(known.depth - obstacle.depth))
        mix = [(obstacle.depth / last.depth, last)]
        if others:
            beyond = (obstacle.depth - last.depth) / (last.depth - others[0].depth)
            if abs(beyond) <= _FARTHEST:
                mix = [(1 + beyond, last), (-beyond, others[0])]
        moved, reactions = (
            np.sum([share * getattr(known.found.state, name) for share, known in mix], axis=0)
            for name in ("moved", "reactions")
        )
        active = np.where(last.found.active, reactions < 0, moved > obstacle.bounds)
        active |= obstacle.candidates.enclosed(active)
        if not active.any():
            return None
        unknowns = tuple(
            np.sum([share * known.unknowns[number] for share, known in mix], axis=0)
            for number in range(len(last.unknowns))
        )
        return Start(active, unknowns, last.found.state.energy * (obstacle.depth / last.depth) ** 2)
