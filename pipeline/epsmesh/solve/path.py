"""A path of equilibria at rising amounts, in steps that are as long as the solver can take.

The amount is a depth, a share of loads, or a share of a time step. A step on which the solver fails is halved; after an
easy one, the next may be longer. The initial guess of a step continues earlier states.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf, prod
from typing import Generic, TypeVar

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.newton import LargeError

# A step that would leave less than this share of the rest goes to the end: no further step for a rounding error.
_SLIVER = 1e-6
# The shortest step, as a share of the amount at the end, and how many times longer one after an easy one may be.
SHORTEST, _LONGER = 1 / 100, 1.5
# Points that a path keeps.
_KEPT = 3


@dataclass(frozen=True, eq=False)
class PathPoint:
    """Equilibrium at an ``amount``, with its ``state``."""

    amount: float
    state: FloatArray


P = TypeVar("P", bound=PathPoint)


@dataclass(eq=False)
class Path(Generic[P]):
    """The last ``points`` of a path from a ``start``, and the longest ``step`` that the solver is expected to take."""

    start: P
    step: float = inf
    points: list[P] = field(init=False)

    def __post_init__(self) -> None:
        self.points = [self.start]

    @property
    def last(self) -> P:
        """The last point."""
        return self.points[-1]

    @property
    def reached(self) -> float:
        """The amount of the last point."""
        return self.last.amount

    def add(self, point: P) -> None:
        """Continue to a point."""
        self.points = [*self.points, point][-_KEPT:]

    def return_to(self, point: P) -> None:
        """Let the path end at a ``point``, from which no earlier one is continued."""
        self.points = [point]

    def continued(self, amount: float, count: int = _KEPT) -> FloatArray:
        """Return the polynomial through the states of the last points, ``count`` at most, at an ``amount``."""
        points = self.points[-count:]
        weights = [
            prod((amount - other.amount) / (point.amount - other.amount) for other in points if other is not point)
            for point in points
        ]
        return np.asarray(np.tensordot(weights, [point.state for point in points], axes=1))


def follow(
    path: Path[P],
    solve_at: Callable[[float], tuple[P, bool]],
    to: float,
    *,
    fewest: float = 1.0,
    shortest: float = SHORTEST,
) -> None:
    """Continue a ``path`` to an amount; collective if ``solve_at`` is.

    ``solve_at`` returns the point at an amount, and whether it was found with ease. There are at least ``fewest`` steps
    from zero on; the ``shortest`` one is a share of the amount.

    Raises:
        LargeError: that of ``solve_at``, if a step becomes too short; the path keeps the points before.
    """
    longest = path.step
    while (reached := path.reached) < to:
        left = to - reached
        step = min(longest, to / fewest, left)
        amount = to if step > (1 - _SLIVER) * left else reached + step
        try:
            point, is_easy = solve_at(amount)
        except LargeError:
            longest = (amount - reached) / 2
            if longest < shortest * to:
                raise
            continue
        path.add(point)
        path.step = longest = max(longest, (amount - reached) * (_LONGER if is_easy else 1.0))
