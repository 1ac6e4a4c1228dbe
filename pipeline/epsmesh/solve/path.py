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
# Stages that a path keeps.
_KEPT = 3


@dataclass(frozen=True, eq=False)
class Stage:
    """Equilibrium at an ``amount``, with its ``state``."""

    amount: float
    state: FloatArray


S = TypeVar("S", bound=Stage)


@dataclass(eq=False)
class Path(Generic[S]):
    """The last ``stages`` of a path from a ``start``, and the longest ``step`` that the solver is expected to take."""

    start: S
    step: float = inf
    stages: list[S] = field(init=False)

    def __post_init__(self) -> None:
        self.stages = [self.start]

    @property
    def last(self) -> S:
        """The last stage."""
        return self.stages[-1]

    @property
    def reached(self) -> float:
        """The amount of the last stage."""
        return self.last.amount

    def add(self, stage: S) -> None:
        """Continue to a stage."""
        self.stages = [*self.stages, stage][-_KEPT:]

    def return_to(self, stage: S) -> None:
        """Let the path end at a ``stage``, from which no earlier one is continued."""
        self.stages = [stage]

    def continued(self, amount: float, count: int = _KEPT) -> FloatArray:
        """Return the polynomial through the states of the last stages, ``count`` at most, at an ``amount``."""
        stages = self.stages[-count:]
        weights = [
            prod((amount - other.amount) / (stage.amount - other.amount) for other in stages if other is not stage)
            for stage in stages
        ]
        return np.asarray(np.tensordot(weights, [stage.state for stage in stages], axes=1))


def follow(
    path: Path[S],
    solve_at: Callable[[float], tuple[S, bool]],
    to: float,
    *,
    fewest: float = 1.0,
    shortest: float = SHORTEST,
) -> None:
    """Continue a ``path`` to an amount; collective if ``solve_at`` is.

    ``solve_at`` returns the stage at an amount, and whether it was found with ease. There are at least ``fewest`` steps
    from zero on; the ``shortest`` one is a share of the amount.

    Raises:
        LargeError: that of ``solve_at``, if a step becomes too short; the path keeps the stages before.
    """
    longest = path.step
    while (reached := path.reached) < to:
        left = to - reached
        step = min(longest, to / fewest, left)
        there = to if step > (1 - _SLIVER) * left else reached + step
        try:
            stage, is_easy = solve_at(there)
        except LargeError:
            longest = (there - reached) / 2
            if longest < shortest * to:
                raise
            continue
        path.add(stage)
        path.step = longest = max(longest, (there - reached) * (_LONGER if is_easy else 1.0))
