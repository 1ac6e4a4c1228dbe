"""Newton's method: one loop for prescribed displacements, for contact, and for bodies in three and in two dimensions.

A step is halved until it turns no tissue inside out, and until it reduces the energy. That is the energy of the body
less the work of the forces that hold it, those that the step predicts: it falls along Newton's step wherever the
tangent is positive definite.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from math import inf, isfinite, sqrt
from typing import Generic, Protocol, TypeVar

from epsmesh.solve import SolveError

# Tolerance on the residual, relative to the forces at prescribed dofs.
LEFT = 1e-9
# The same for load steps before the last: the work of F has fewer digits.
ON_THE_WAY = 1e-4
# At most so many Newton iterations of a load step were easy: the next one may be longer.
EASY = 4
# A residual has stalled if an iteration leaves this share of it; then rounding of gradients may be all of it.
_STALLS = 0.5
# Tolerances of linear solves: the largest, the least, that without an earlier gain, and the share of the gain needed to
# the end.
_ROUGH, FINE, _UNTRIED, _SPARE = 1e-1, 1e-4, 3e-2, 0.1
# Sufficient decrease: least gain, as a share of that predicted by the slope.
_GAIN = 1e-4
# Most halvings of a step.
HALVINGS = 12

Found = TypeVar("Found")


class LargeError(SolveError):
    """Newton's method does not converge at the prescribed displacement.

    ``reached`` are the depth (m) and the force (N) of the whole body at the end of the load path, if it has one.
    """

    def __init__(self, message: str, reached: tuple[float, float] | None = None):
        super().__init__(message)
        self.reached = reached


class Moving(Protocol):
    """A body that steps move. Methods are collective.

    ``slope`` is what the last increment promised to reduce the ``energy`` by, at the state where it was found; None
    where energies of steps are not compared: steps are exact, or, in mixed elements, the energy is stationary and not
    least at equilibrium. The energy is NaN if tissue is inside out.
    """

    @property
    def energy(self) -> float: ...  # noqa: D102
    @property
    def slope(self) -> float | None: ...  # noqa: D102
    def advance(self, fraction: float) -> bool:
        """Set the state to the last one linearised plus a ``fraction`` of its increment; return whether J > 0."""


class Held(Moving, Protocol):
    """A body with prescribed displacements that have a goal. Methods are collective.

    ``is_compared`` says that steps must reduce the energy or the residual. A factorised tangent may be indefinite:
    its steps lead to equilibria past which the energy and the residual first rise.
    """

    is_compared: bool

    @property
    def is_there(self) -> bool:
        """Whether the prescribed displacements are at their goal."""

    def residual(self) -> tuple[float, float]:
        """Return the norms of the residual and of the forces that hold the body."""

    def rounding(self) -> float:
        """Return the residual that rounding may leave."""

    def linearise(self, tolerance: float) -> None:
        """Find the increment that brings prescribed displacements to their goal, to a relative ``tolerance``.

        Raises:
            SolveError: if the linear solver fails.
        """


class Newton(ABC, Generic[Found]):
    """The loop: a state is judged, and a step taken, until a solution is found."""

    @abstractmethod
    def judge(self, iteration: int) -> Found | None:
        """Evaluate the state; return the solution if that is one; collective."""

    @abstractmethod
    def step(self, iteration: int) -> None:
        """Take a step; collective."""

    def solve(self, most: int) -> Found:
        """Return the solution after ``most`` steps at most; collective.

        Raises:
            LargeError: if there is none.
        """
        for iteration in range(most + 1):
            if (found := self.judge(iteration)) is not None:
                return found
            if iteration < most:
                self.step(iteration)
        raise LargeError(f"no equilibrium after {most} iterations")


def advance(body: Moving, halvings: int, falls: Callable[[float], bool] | None = None) -> float:
    """Take the longest step, by halves, with no tissue inside out and ``falls``; return its fraction; collective.

    Raises:
        LargeError: if there is none among so many.
    """
    for halving in range(halvings):
        fraction = 0.5**halving
        if body.advance(fraction) and (falls is None or falls(fraction)):
            return fraction
    raise LargeError("tissue is turned inside out")


def is_less(after: float, before: float, fraction: float, slope: float) -> bool:
    """Return whether a ``fraction`` of a step reduces an energy enough (L. Armijo, Pacific J. Math. 16, 1, 1966)."""
    return after <= before - _GAIN * fraction * slope


def hold(body: Held, limit: float, most: int, on_the_way: int = HALVINGS) -> int:
    """Find the equilibrium in which prescribed displacements are at their goal; return the iterations; collective.

    The residual at the end is at most ``limit``, in units of the forces that hold the body. A step that moves
    prescribed displacements is halved only where it turns tissue inside out, into ``on_the_way`` lengths at most.

    Raises:
        LargeError: if there is none after ``most`` iterations, or tissue is turned inside out.
        SolveError: if a linear solver fails.
    """
    if not isfinite(body.energy):
        raise LargeError("tissue is turned inside out")
    return _Hold(body, limit, on_the_way).solve(most)


class _Hold(Newton[int]):
    """What is bonded is contact whose components are all active, whatever the reaction."""

    def __init__(self, body: Held, limit: float, on_the_way: int):
        self._body, self._limit, self._on_the_way = body, limit, on_the_way
        self._before = inf

    def judge(self, iteration: int) -> int | None:
        """Return the number of iterations at equilibrium."""
        body, before = self._body, self._before
        self._left, scale = body.residual()
        self._is_there, self._before = body.is_there, inf
        self._tolerance = _ROUGH
        if not self._is_there:
            return None
        if self._left <= self._limit * scale:
            return iteration
        if self._left > _STALLS * before and self._left <= body.rounding():
            return iteration  # loads, or a depth, next to nothing
        needed = self._limit * scale / self._left
        self._tolerance = forcing(self._left / before if before < inf else sqrt(_UNTRIED), needed)
        self._before = self._left
        return None

    def step(self, iteration: int) -> None:
        """Take a step."""
        self._body.linearise(self._tolerance)
        if not (self._is_there and self._body.is_compared):
            advance(self._body, self._on_the_way)
        else:
            stored = self._body.energy
            advance(self._body, HALVINGS, lambda fraction: self._falls(fraction, stored))

    def _falls(self, fraction: float, stored: float) -> bool:
        """Return whether the energy falls below the ``stored`` one, or else the residual: rounding may hide it."""
        body = self._body
        if body.slope is not None and is_less(body.energy, stored, fraction, body.slope):
            return True
        return is_less(body.residual()[0], self._left, fraction, self._left)


def forcing(gained: float, needed: float = 0.0) -> float:
    """Return the tolerance of a linear solve, from the last gain of the residual and the gain ``needed`` to the end.

    The square of the last gain is what a step of Newton's method can gain (S. C. Eisenstat and H. F. Walker, SIAM J.
    Sci. Comput. 17, 16, 1996).
    """
    return min(_ROUGH, max(FINE, gained**2, _SPARE * needed))
