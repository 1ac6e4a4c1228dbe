"""Hierarchical error estimate of displacement elements: the correction in the space of one degree more.

F_p·d - F·d is the energy of the error: F_p is an upper bound. The part of it that degree p + 1 resolves,

    s = F_p - F_{p+1},    s·d = a(u_p - u_{p+1}, u_p - u_{p+1}),

is summed by conjugate gradients with initial guess u_p: each iteration adds α (r, z). A few iterations give s to a few
per cent, from below.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from math import isfinite

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.krylov import INDEFINITE, SOLVERS, check_converged, explained, keep, solver_of
from epsmesh.solve.linear_solver import LinearSolver

# Iterations end when an increment is below this share of the sum, after a minimum: early ones may be small by chance.
_SMALL = 0.02
_FEWEST, _MOST = 3, SOLVERS["energy decrements"]["ksp_max_it"]
# A remaining increment below this share of the sum is rounding.
_ROUNDING = 1e-6
_REASONS = PETSc.KSP.ConvergedReason


def energy_decrements(solver: LinearSolver, residuals: Sequence[PETSc.Vec]) -> tuple[FloatArray, list[FloatArray], int]:
    """Return r_i·A⁻¹·r_j (J) of n ``residuals``, (n, n), each A⁻¹·r_i (owned dofs), and the iterations; collective.

    Diagonal entries are lower bounds. The error of any other entry is at most the root of the errors of its two
    diagonal entries.

    Raises:
        SolveError: if the increments do not become small.
    """
    with ExitStack() as stack, explained():
        checked = _Checked(solver)
        ksp = solver_of("energy decrements", solver.matrix, stack, checked)
        solutions = [keep(stack, residual.duplicate()) for residual in residuals]
        found = [_sum(ksp, checked, *pair) for pair in zip(residuals, solutions, strict=True)]
        iterations = sum(count for _, count in found)
        corrections = [solution.array.copy() for solution in solutions]
        if len(found) == 1:
            return np.array([[found[0][0]]]), corrections, iterations
        # x_i·r_j + x_j·r_i - x_i·A·x_j: its error is the product of both solutions' errors.
        product = keep(stack, residuals[0].duplicate())
        local = np.empty((len(found), len(found)))
        for j, (solution, residual) in enumerate(zip(solutions, residuals, strict=True)):
            solver.matrix.mult(solution, product)
            for i, x in enumerate(corrections):
                local[i, j] = x @ residual.array + corrections[j] @ residuals[i].array - x @ product.array
    total = global_sum(residuals[0].comm.tompi4py(), local)
    return (total + total.T) / 2, corrections, iterations


def _sum(ksp: PETSc.KSP, checked: "_Checked", residual: PETSc.Vec, solution: PETSc.Vec) -> tuple[float, int]:
    """Return ``residual``·A⁻¹·``residual`` and the iterations; write the solution."""
    test = _Increments(checked)
    ksp.setConvergenceTest(test)
    solution.set(0.0)
    ksp.solve(residual, solution)
    if ksp.getConvergedReason() == INDEFINITE and not checked.is_rounding(test.total):
        if not checked.solver.refine_eigenvalues():
            raise SolveError("the preconditioner of the error estimate is not positive definite")
        solution.set(0.0)
        ksp.solve(residual, solution)
    if ksp.getConvergedReason() == _REASONS.DIVERGED_MAX_IT:
        raise SolveError(f"the error estimate did not converge in {_MOST} iterations")
    if ksp.getConvergedReason() != INDEFINITE:
        check_converged(ksp)
    return test.total, int(ksp.its)


class _Checked:
    """The preconditioner P of a solver, and the ``energy`` r·P·r of the last residual, negative if P is indefinite."""

    def __init__(self, solver: LinearSolver):
        self.solver, self.energy = solver, 0.0

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply the preconditioner; PETSc calls this."""
        self.solver.precondition(residual, result)
        self.energy = float(residual.dot(result))

    def is_rounding(self, total: float) -> bool:
        """Return whether the remaining increment is only rounding."""
        return abs(self.energy) <= _ROUNDING * total


class _Increments:
    """Stops conjugate gradients, begun at zero, when x·r, the sum of increments, grows by a small share only."""

    def __init__(self, checked: _Checked):
        self._checked, self.total = checked, 0.0

    def __call__(self, ksp: PETSc.KSP, iteration: int, _: float) -> int:
        if iteration == 0:
            self.total = 0.0
            return 0
        before, self.total = self.total, float(ksp.getRhs().dot(ksp.getSolution()))
        if not isfinite(self.total):
            return int(_REASONS.DIVERGED_NANORINF)
        if self._checked.energy < 0.0:
            return int(INDEFINITE)
        enough = iteration >= _FEWEST and self.total - before <= _SMALL * self.total
        return int(_REASONS.CONVERGED_RTOL) if enough else 0
