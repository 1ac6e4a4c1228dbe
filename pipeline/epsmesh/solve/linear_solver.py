"""The linear solver for elasticity: a factorisation, or conjugate gradients preconditioned by a multigrid cycle.

The cycle coarsens in degree (p, p - 1, …, 1), :mod:`epsmesh.solve.kernels.multigrid`, then to the meshes from which
that of a refined body was cut, :mod:`epsmesh.solve.coarse_levels`. Below it is hypre's BoomerAMG, or PETSc's GAMG where
PETSc has no hypre.
"""

import itertools
import operator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.solve.kernels.multigrid import Cycle, SmoothedLevel, free, interpolation
from epsmesh.solve.kernels.product import Joined, operator_of
from epsmesh.solve.krylov import INDEFINITE, algebraic, check_converged, explained, factorised, keep, solver_of
from epsmesh.stages import stage

# Recycled solutions: most of them, and most bytes of a process; and Fischer's second method, for symmetric positive
# definite operators.
_MOST_RECYCLED, _RECYCLED_BYTES = 48, 100_000_000
_IN_ENERGY = 2
_NONE = np.empty(0, dtype=np.int32)


@dataclass(frozen=True)
class Level:
    """One level of a hierarchy: its space, its operator and the local dofs (unrolled) that are prescribed.

    ``jumps`` says that the material jumps between regions. ``held`` are prescribed dofs that the operator ignores: the
    multigrid cycle accounts for them. ``children`` and ``pairs``: see :class:`.Side`.
    """

    space: Any
    matrix: PETSc.Mat
    prescribed: np.ndarray
    jumps: bool = False
    held: np.ndarray | None = None
    children: Int32Array | None = None
    pairs: Joined | None = None

    @property
    def degree(self) -> int:
        """Polynomial degree of the space."""
        return compat.degree(self.space)


class LinearSolver:
    """A KSP for one operator, with all its resources: a context manager, which frees them.

    ``levels`` are those it was made from; ``cycle`` is the multigrid cycle, None for a direct solver and for degree 1.
    """

    @stage("set-up")
    def __init__(self, levels: list[Level], *, direct: bool, below: "LinearSolver | None" = None):
        """Set up; collective. Operators above the first level are matrix-free unless the solver is ``direct``.

        ``below`` is a solver of all levels but the last, if there is one. Its set-up is shared, so it must live as
        long.

        Raises:
            SolveError: if the set-up fails.
        """
        self.levels = levels
        self.cycle: Cycle | None = None
        self._is_direct, self._looked_closer = direct, False
        with ExitStack() as stack, explained():
            self._stack = stack
            if direct:
                self.ksp = factorised(self.matrix, stack)
            else:
                self.ksp = solver_of("elasticity", self.matrix, stack, self._preconditioner(below))
                self.ksp.setUp()
            self._stack = stack.pop_all()

    def __enter__(self) -> "LinearSolver":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _preconditioner(self, below: "LinearSolver | None") -> "PETSc.PC | Cycle":
        levels = self.levels
        if len(levels) == 1:
            return algebraic(self.matrix, levels[0].space, self._stack)
        below = below if below is not None and below.supports(levels) else None
        known = 1 if below is None else len(levels) - 1
        smoothed = [SmoothedLevel(operator_of(level.matrix), jumps=level.jumps) for level in levels[known:]]
        between = list(map(interpolation, levels[known - 1 :], levels[known:]))
        if below is None:
            self.cycle = Cycle(smoothed, between, algebraic(levels[0].matrix, levels[0].space, self._stack))
        elif below.cycle is None:
            self.cycle = Cycle(smoothed, between, below.ksp.pc)
        else:
            self.cycle = below.cycle.above(smoothed, between)
        if any(level.held is not None for level in levels):
            self._hold(self.cycle.coarse)
        return self.cycle

    @stage("iterations")
    def solve(
        self, rhs: PETSc.Vec, solution: PETSc.Vec, tolerance: float | None = None, target: float | None = None
    ) -> int:
        """Improve the initial guess ``solution``, ignored by a direct solve; return the iterations; collective.

        ``tolerance`` is for the energy norm of the error relative to that of the solution, ``target`` for the norm
        itself. An iteration needs one of them.

        Raises:
            SolveError: if PETSc reports anything but convergence.
        """
        if tolerance is not None:
            self.ksp.setTolerances(rtol=tolerance, atol=0.0)
        if target is not None:
            self.ksp.setTolerances(rtol=0.0, atol=target)
        with explained():
            self.ksp.solve(rhs, solution)
            before = 0
            if self.ksp.getConvergedReason() == INDEFINITE and self.refine_eigenvalues():
                before = int(self.ksp.its)
                self.ksp.solve(rhs, solution)
        return before + check_converged(self.ksp)

    @stage("iterations")
    def solve_many(self, loads: FloatArray) -> FloatArray:
        """Return the solutions (m, n) for the columns of ``loads`` (m, n); for a direct solver on one process.

        Raises:
            SolveError: if the factorisation fails.
        """
        with ExitStack() as stack, explained():
            right = keep(stack, PETSc.Mat().createDense(loads.shape, array=loads, comm=PETSc.COMM_SELF))
            left = keep(stack, PETSc.Mat().createDense(loads.shape, comm=PETSc.COMM_SELF))
            left.setUp()
            self.ksp.pc.getFactorMatrix().matSolve(right, left)
            return np.array(left.getDenseArray())

    def recycle(self) -> None:
        """Recycle: take the initial guess from the span of earlier solutions, best in the energy norm; collective.

        PETSc stores the solutions (P. F. Fischer, Comput. Methods Appl. Mech. Eng. 163, 193, 1998), and starts again
        once the store is full. The caller's initial guess is ignored.
        """
        comm = self.matrix.comm.tompi4py()
        size = comm.allreduce(max(1, self.matrix.getLocalSize()[0]), op=MPI.MAX)
        self.ksp.setUseFischerGuess(_IN_ENERGY, max(2, min(_MOST_RECYCLED, _RECYCLED_BYTES // (8 * size))))

    def refine_eigenvalues(self) -> bool:
        """Repair an indefinite preconditioner once: return whether a better estimate of its eigenvalues was made.

        The smoothers' estimate of their largest eigenvalue was too small. Only a multigrid cycle has one.
        """
        if self.cycle is None or self._looked_closer:
            return False
        self._looked_closer = True
        self.cycle.refine_eigenvalues()
        return True

    def supports(self, levels: list[Level]) -> bool:
        """Return whether this set-up serves a cycle of ``levels``, one more than its own."""
        same = len(levels) == len(self.levels) + 1 and all(map(operator.is_, levels, self.levels))
        return same and not self._is_direct and all(level.held is None for level in levels)

    @stage("set-up")
    def hold(self, levels: list[Level]) -> None:
        """Fix other dofs from now on: those of ``levels``, with the same operators above degree 1; collective.

        Raises:
            SolveError: if PETSc fails.
        """
        self.levels = levels
        with explained():
            self._hold(algebraic(levels[0].matrix, levels[0].space, self._stack))

    def _hold(self, coarse: PETSc.PC) -> None:
        assert self.cycle is not None
        held = [_NONE if level.held is None else level.held for level in self.levels[1:]]
        masks = [(free(lower), free(upper)) for lower, upper in itertools.pairwise(self.levels)]
        self.cycle.hold(held, masks, coarse)
        if self.levels[0].pairs is not None:
            operators = [operator_of(level.matrix) for level in self.levels[1:]]
            self.cycle.join(operators, [level.pairs for level in self.levels])

    @property
    def matrix(self) -> PETSc.Mat:
        """The operator."""
        return self.levels[-1].matrix

    def precondition(self, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply the preconditioner alone; collective. ``residual`` must be zero at prescribed dofs.

        Raises:
            SolveError: if PETSc fails.
        """
        with explained():
            self.ksp.pc.apply(residual, result)

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Act as preconditioner of another operator; PETSc calls this."""
        self.precondition(residual, result)

    def close(self) -> None:
        """Free all resources."""
        self._stack.close()
