"""What depths of one material on one mesh have in common: elements, what was found, how far F was from the truth."""

from contextlib import ExitStack
from dataclasses import dataclass, field

from pipeline.solve.contact.condensed import CondensedElements
from pipeline.solve.contact.displacement import DisplacementElements
from pipeline.solve.contact.mixed import MixedElements
from pipeline.solve.contact.neighbours import Neighbours
from pipeline.solve.contact.sets import Found, Obstacle, find_set
from pipeline.solve.material import MaterialLaw
from pipeline.stages import Times

Kind = DisplacementElements | MixedElements | CondensedElements

# Between two depths of which the larger is at most so many times the smaller one, error bars are those of these two.
NEAR = 2.0
# And this many times the larger of both: nodes of contact are gained one by one, and bars jump with them.
_SAFE = 1.25


@dataclass(eq=False)
class Sweep:
    """Depths of the material of ``law``, by ``elements`` that live until ``close``; ``method`` was asked for.

    ``cost`` is what the elements took to make.
    """

    law: MaterialLaw
    method: str
    elements: Kind
    stack: ExitStack
    cost: Times = field(default_factory=Times)
    neighbours: Neighbours = field(default_factory=Neighbours)
    _bars: dict[float, tuple[float, float]] = field(default_factory=dict)

    def close(self) -> None:
        """Free the elements."""
        self.stack.close()

    def find(self, obstacle: Obstacle, tolerances: tuple[float, ...]) -> Found | None:
        """Return what the neighbours lead to, or, on a condensed surface, all that is in the way; None without them.

        Collective.

        Raises:
            SolveError: if the solver fails.
            ContactError: if the contact does not settle.
        """
        start = self.neighbours.start(obstacle)
        if isinstance(self.elements, CondensedElements):  # every solve is exact
            active = obstacle.bounds < 0 if start is None else start.active
            return find_set(self.elements, obstacle, active, tolerances[-1:])
        if start is None:
            return None
        self.elements.start_at(start.unknowns)
        return find_set(self.elements, obstacle, start.active, tolerances, start.energy)

    def keep(self, depth: float, found: Found) -> None:
        """Remember what was found at a ``depth`` (m)."""
        self.neighbours.add(depth, found, self.elements.unknowns())

    def keep_bar(self, depth: float, taken: float, share: float) -> None:
        """Remember the share of the energy that degree 3 takes away at a ``depth`` (m), and the force's bar."""
        self._bars[depth] = taken, share

    def bar(self, depth: float) -> tuple[float, float] | None:
        """Return both shares between two near depths for which they are known, on a condensed surface alone."""
        below, above = [d for d in self._bars if d <= depth], [d for d in self._bars if d >= depth]
        if not (isinstance(self.elements, CondensedElements) and below and above):
            return None
        ends = max(below), min(above)
        if ends[1] > NEAR * ends[0]:
            return None
        taken, share = max((self._bars[end] for end in ends), key=lambda pair: pair[1])
        factor = _SAFE if ends[0] < ends[1] else 1.0
        return factor * taken, factor * share
