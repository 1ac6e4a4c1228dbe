"""Newton's method for the equilibrium of a hyperelastic body with prescribed displacements.

PETSc's SNES with a line search. The linear systems are solved by conjugate gradients, preconditioned by the multigrid
of linear elasticity, which is set up once: at moderate strain the tangent is close to linear elasticity.
"""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.solve import SolveError
from pipeline.solve.compiled import assemble, fill, vector
from pipeline.solve.forms import HyperelasticForms
from pipeline.solve.krylov import INDEFINITE, SOLVERS, configure, explain, keep, solver_of
from pipeline.solve.linear_solver import LinearSolver
from pipeline.solve.spaces import ElasticSpace
from pipeline.stages import stage

# Tolerance on the residual, relative to the forces at prescribed dofs, and most Newton iterations.
_LEFT = 1e-9
# Most halvings of a step that turns tissue inside out.
_HALVINGS = 12
# Sufficient decrease: least gain of energy, as a share of that predicted by the slope.
_GAIN = 1e-4


class LargeError(SolveError):
    """Newton's method does not converge at the prescribed displacement.

    ``reached`` are the depth (m) and the force (N) of the whole body at the end of the load path, if it has one.
    """

    def __init__(self, message: str, reached: tuple[float, float] | None = None):
        super().__init__(message)
        self.reached = reached


class HyperelasticBody:
    """A hyperelastic body in the spaces of linear elasticity, and Newton's method for it; ``close`` frees it."""

    def __init__(self, space: ElasticSpace, forms: HyperelasticForms, solver: LinearSolver):
        """Set up; collective. ``solver`` is that of linear elasticity."""
        self._space, self._forms, self._solver = space, forms, solver
        self._held = space.prescribed_owned
        self.tangent = fem_petsc.create_matrix(forms.tangent)
        self.tangent.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self.tangent.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        start = 3 * space.space.dofmap.index_map.local_range[0]
        self._rows = (self._held + start).astype(PETSc.IntType)
        self.iterations = 0

    def close(self) -> None:
        """Free the tangent."""
        self.tangent.destroy()

    def energy(self, displacement: PETSc.Vec) -> float:
        """Return the stored energy (J) of the modelled part, NaN if tissue is inside out; collective."""
        self._space.set_displacement(displacement)
        return float(self._space.comm.allreduce(fem.assemble_scalar(self._forms.energy), op=MPI.SUM))

    def forces(self, displacement: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the nodal forces (N), prescribed dofs included, into ``result``; collective."""
        self._space.set_displacement(displacement)
        assemble(self._forms.residual, result)

    @stage("tangent solves")
    def move(self, displacement: PETSc.Vec, prescribed: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the linearised response to a small change of the ``prescribed`` dofs into ``result``; collective.

        Raises:
            LargeError: if the tangent is not positive definite: the tissue is unstable.
        """
        with ExitStack() as stack, vector(self._space.space) as load:
            self._assemble(displacement)
            self.tangent.mult(prescribed, load)
            load.scale(-1.0)
            load.array[self._held] = prescribed.array[self._held]
            self.tangent.zeroRowsColumns(self._rows, 1.0)
            # Prescribed values are in the initial guess: the preconditioner may ignore these dofs.
            result.set(0.0)
            result.array[self._held] = prescribed.array[self._held]
            ksp = solver_of("tangent", self.tangent, stack, self._solver)
            self._run(ksp, ksp, lambda: ksp.solve(load, result))

    @stage("Newton's method")
    def settle(self, displacement: PETSc.Vec, scale: float) -> int:
        """Find the equilibrium from the initial guess ``displacement``, its prescribed dofs fixed; collective.

        Return Newton's iterations. ``scale`` (N) is the size of the forces at prescribed dofs.

        Raises:
            LargeError: if Newton's method does not converge.
        """
        with ExitStack() as stack, vector(self._space.space) as residual:
            snes = keep(stack, PETSc.SNES().create(self._space.comm))
            configure(snes, SOLVERS["Newton's method"])
            snes.ksp.pc.setType("python")
            snes.ksp.pc.setPythonContext(self._solver)
            snes.setFunction(self._function, residual)
            snes.setJacobian(self._jacobian, self.tangent, self.tangent)
            snes.setLineSearchPreCheck(self._shorten)
            snes.setTolerances(atol=_LEFT * scale)
            self._run(snes, snes.ksp, lambda: snes.solve(None, displacement))
            return int(snes.getIterationNumber())

    def _function(self, _: PETSc.SNES | None, displacement: PETSc.Vec, result: PETSc.Vec) -> None:
        self._space.set_displacement(displacement)
        assemble(self._forms.residual, result)
        result.array[self._held] = 0.0

    def _jacobian(self, _: PETSc.SNES, displacement: PETSc.Vec, tangent: PETSc.Mat, __: PETSc.Mat) -> None:
        self._assemble(displacement)
        tangent.zeroRowsColumns(self._rows, 1.0)

    def _assemble(self, displacement: PETSc.Vec) -> None:
        self._space.set_displacement(displacement)
        compat.assemble_matrix(self._forms.tangent, [], 1.0, self.tangent)

    def _shorten(self, here: PETSc.Vec, step: PETSc.Vec) -> bool:
        """Halve a ``step`` (which is subtracted) until no tissue is inside out after it, and less energy is stored.

        Where rounding hides the decrease of the energy, the residual must fall.
        """
        with vector(self._space.space) as there, vector(self._space.space) as residual:
            stored = self.energy(here)
            self._function(None, here, residual)
            left, slope = residual.norm(), residual.dot(step)
            for halvings in range(_HALVINGS):
                there.array[:] = here.array - step.array
                energy, share = self.energy(there), 0.5**halvings
                if np.isfinite(energy):
                    if energy <= stored - _GAIN * share * slope:
                        return halvings > 0
                    self._function(None, there, residual)
                    if residual.norm() <= (1 - _GAIN * share) * left:
                        return halvings > 0
                step.scale(0.5)
        return True

    def _run(self, solver: Any, ksp: PETSc.KSP, solve: Callable[[], None]) -> None:
        """Run a PETSc solver, with the linear solver ``ksp``, and check that it converges; collective.

        If the preconditioner proves indefinite, it is repaired and the solver continues.

        Raises:
            LargeError: if the solver does not converge.
        """
        try:
            self._counted(solver, solve)
            if ksp.getConvergedReason() == INDEFINITE and self._solver.refine_eigenvalues():
                self._counted(solver, solve)
        except PETSc.Error as error:
            raise LargeError(explain(error)) from error
        if solver.getConvergedReason() <= 0:
            raise LargeError(f"reason {solver.getConvergedReason()}")

    def _counted(self, solver: Any, solve: Callable[[], None]) -> None:
        solve()
        self.iterations += solver.getLinearSolveIterations() if isinstance(solver, PETSc.SNES) else solver.its


def tangent_product(forms: HyperelasticForms, x: PETSc.Vec, result: PETSc.Vec) -> None:
    """Write K x, on all dofs, into ``result``, with the tangent K at the forms' displacement; collective."""
    fill(forms.direction, x)
    assemble(forms.product, result)
