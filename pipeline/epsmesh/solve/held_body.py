"""A hyperelastic body with prescribed displacements, in Newton's loop: see :class:`.newton.Held`.

The first step may also bring prescribed dofs to their goal: it is then the response of the tangent. Linear systems are
solved by conjugate gradients, in mixed elements by generalised conjugate residuals. The tangent is matrix-free. The
preconditioner is that of linear elasticity, which is set up once: at moderate strain the tangent is close to it.
"""

from contextlib import ExitStack

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.hyperelastic import HyperelasticBody
from epsmesh.solve.krylov import is_truncated
from epsmesh.solve.newton import FINE, LEFT, LargeError, hold
from epsmesh.stages import stage

# Most Newton iterations of a load step, and lengths of a step that moves prescribed dofs.
_MOST, _ON_THE_WAY = 25, 1
# Relative rounding of gradients.
_ROUNDED = float(np.finfo(float).eps) / 2


@stage("Newton's method")
def equilibrate(body: HyperelasticBody, state: PETSc.Vec, goal: FloatArray, left: float = LEFT) -> int:
    """Find the equilibrium of a ``body`` from the initial guess ``state``; collective.

    ``goal`` (m) are the prescribed dofs there, ``left`` is the residual at the end in units of the forces at these
    dofs. Return Newton's iterations.

    Raises:
        LargeError: if Newton's method does not converge; ``state`` is then undefined.
    """
    with ExitStack() as stack:
        return hold(HeldBody(body, state, goal, stack), left, _MOST, _ON_THE_WAY)


@stage("tangent solves")
def move(body: HyperelasticBody, state: PETSc.Vec, prescribed: PETSc.Vec, result: PETSc.Vec) -> None:
    """Write the linearised response to a small change of the ``prescribed`` dofs into ``result``; collective.

    Raises:
        LargeError: if the tangent is not positive definite: the tissue is unstable.
    """
    with ExitStack() as stack:
        at_rest = stack.enter_context(body.state())
        ksp = body.solver(stack)
        ksp.setTolerances(rtol=FINE)
        body.respond(ksp, state, at_rest, body.held_of(prescribed), result)


class HeldBody:
    """A ``body`` at a ``state`` whose prescribed dofs go to a ``goal`` (m); what is made is freed with the stack.

    Energies and forces are in the unit of the law.
    """

    is_compared = True

    def __init__(self, body: HyperelasticBody, state: PETSc.Vec, goal: FloatArray, stack: ExitStack):
        """Begin at the state, which :meth:`advance` changes; collective."""
        self._body, self._state, self._goal = body, state, goal
        self._residual, self._step, self._from = (stack.enter_context(body.state()) for _ in range(3))
        self._solver = body.solver(stack)
        self._norms: tuple[float, float] | None = None
        self.energy = body.energy(state) / body.unit
        self.slope: float | None = None

    @property
    def is_there(self) -> bool:
        """Whether prescribed dofs are at their goal."""
        return not self._body.comm.allreduce(bool(self._todo.any()), op=MPI.LOR)

    @property
    def _todo(self) -> FloatArray:
        return self._goal - self._body.held_of(self._state)

    def residual(self) -> tuple[float, float]:
        """Return the norms of the residual and of the forces that hold the body."""
        if self._norms is None:
            self._body.residual(self._state, self._residual)
            on_held = self._body.norm_on_held(self._residual)
            self._residual.array[self._body.held] = 0.0
            self._norms = float(self._residual.norm()), on_held
        return self._norms

    def rounding(self) -> float:
        """Return the residual that rounding of the displacement's gradient may leave.

        Beside 1, a gradient has the error ε, which is that of nodes displaced by ε times the element size.
        """
        body = self._body
        with body.state() as noise, body.state() as forces:
            noise.array[: body.displaced] = _ROUNDED * body.mean_size * np.cos(np.arange(body.displaced))
            body.assemble(self._state)
            body.tangent.mult(noise, forces)
            forces.array[body.held] = 0.0
            return float(forces.norm())

    def linearise(self, tolerance: float) -> None:
        """Find the increment.

        Where prescribed dofs are at their goal and the tangent is indefinite, it ends at the first direction of
        negative curvature: see :func:`.krylov.is_truncated`.

        Raises:
            LargeError: if the linear solver fails.
        """
        self._solver.setTolerances(rtol=tolerance)
        is_there = self.is_there
        self._state.copy(self._from)
        try:
            self._body.respond(self._solver, self._state, self._residual, self._todo, self._step)
        except LargeError:
            if not (is_there and is_truncated(self._solver, self._step)):
                raise
        self.slope = None if self._body.is_mixed else -self._residual.dot(self._step)

    def advance(self, fraction: float) -> bool:
        """Set the state to the last one linearised plus a ``fraction`` of its increment; return whether J > 0."""
        self._state.waxpy(fraction, self._step, self._from)
        self.energy, self._norms = self._body.energy(self._state) / self._body.unit, None
        return bool(np.isfinite(self.energy))
