"""Data shared by the depths of one material on one mesh: elements, contacts found, and error bars."""

from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import BoolArray
from epsmesh.solve.contact.active_set import Obstacle, SettledContact, find_set
from epsmesh.solve.contact.elements import ContactElements, SurfaceState, Unknowns
from epsmesh.solve.movement import FarField
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import Times

# Error bars are shared between two depths that differ by at most this factor.
NEAR = 2.0
# Number of remembered depths: in an ordered sweep the last ones are the nearest.
_REMEMBERED = 2
# Two depths are extrapolated to a third at most this many times their own distance away.
_FARTHEST = 2.0


@dataclass(frozen=True, eq=False)
class Guess:
    """An initial guess: active set (n), state of the candidates, and unknowns of the elements (owned dofs)."""

    active: BoolArray
    state: SurfaceState
    unknowns: Unknowns


@dataclass(frozen=True, eq=False)
class _Known:
    depth: float
    found: SettledContact
    unknowns: Unknowns


@dataclass(eq=False)
class Sweep:
    """Depths of the material ``law`` with ``elements`` that live until ``close``; ``method`` is the requested solver.

    ``cost`` is that of setting up the elements.
    """

    law: MaterialLaw
    method: str
    elements: ContactElements
    stack: ExitStack
    cost: Times = field(default_factory=Times)
    _known: list[_Known] = field(default_factory=list)
    _bars: dict[FarField | None, dict[float, tuple[float, float]]] = field(default_factory=dict)

    def close(self) -> None:
        """Free the elements."""
        self.stack.close()

    def find(self, obstacle: Obstacle, tolerances: tuple[float, ...]) -> SettledContact | None:
        """Return the contact from the initial guess of earlier depths; None without one; collective.

        On a condensed surface the initial guess is every candidate that the undeformed surface would touch.

        Raises:
            SolveError: if the solver fails.
            ContactError: if the contact does not settle.
        """
        guess = self.guess(obstacle)
        if guess is not None:
            self.elements.begin(guess.state, guess.unknowns)
            return find_set(self.elements, obstacle, guess.active, tolerances, guess.state.energy)
        return find_set(self.elements, obstacle, obstacle.bounds < 0, tolerances) if self.elements.is_exact else None

    def guess(self, obstacle: Obstacle) -> Guess | None:
        """Return the initial guess for an ``obstacle``, or None.

        The nearest depth is scaled; from two depths it is extrapolated.
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
        if not active.any():
            return None
        unknowns = tuple(
            np.sum([share * known.unknowns[number] for share, known in mix], axis=0)
            for number in range(len(last.unknowns))
        )
        energy = last.found.state.energy * (obstacle.depth / last.depth) ** 2
        return Guess(active, SurfaceState(moved, reactions, energy), unknowns)

    def keep(self, depth: float, found: SettledContact, unknowns: Unknowns) -> None:
        """Remember the contact ``found`` at a ``depth`` (m), and its unknowns."""
        others = [known for known in self._known if known.depth != depth]
        self._known = [*others, _Known(depth, found, unknowns)][-_REMEMBERED:]

    def keep_bar(self, depth: float, decrement: float, share: float, far: FarField | None = None) -> None:
        """Remember two shares at a ``depth`` (m): of the energy that one degree more removes, and of the force's bar.

        ``far`` is the far field on the cut face, or None; bars are not shared between different far fields.
        """
        self._bars.setdefault(far, {})[depth] = decrement, share

    def bar(self, depth: float, far: FarField | None = None) -> tuple[float, float] | None:
        """Return both shares from two neighbouring depths with known bars; only on a condensed surface."""
        bars = self._bars.get(far, {})
        below, above = [d for d in bars if d <= depth], [d for d in bars if d >= depth]
        if not (self.elements.is_exact and below and above):
            return None
        ends = max(below), min(above)
        if ends[1] > NEAR * ends[0]:
            return None
        decrement, share = max((bars[end] for end in ends), key=lambda pair: pair[1])
        factor = fitted.BETWEEN_DEPTHS if ends[0] < ends[1] else 1.0
        return factor * decrement, factor * share
