"""The linear solver for elasticity: a factorisation, or conjugate gradients with a multigrid cycle.

The cycle goes down in degree (p, p - 1, …, 1), :mod:`pipeline.solve.kernels.multigrid`, and from degree 1 by hypre's
BoomerAMG.
"""

import itertools
import operator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.solve.kernels.multigrid import Cycle, SmoothedLevel, free, interpolation
from pipeline.solve.kernels.product import operator_of
from pipeline.solve.krylov import INDEFINITE, algebraic, check_converged, explained, keep, solver_of
from pipeline.stages import stage

# So many earlier solutions begin the next one, and no more than fit into so many bytes of a process; and Fischer's
# second method, for operators that are symmetric and positive definite.
_MOST_RECYCLED, _RECYCLED_BYTES = 48, 100_000_000
_IN_ENERGY = 2
_NONE = np.empty(0, dtype=np.int32)


@dataclass(frozen=True)
class Level:
    """One level of a hierarchy: its space, its operator and the local dofs (unrolled) that are prescribed.

    ``jumps`` says that the material does, from one region to the next. ``held`` are those of the prescribed dofs that
    the operator knows nothing of: the multigrid cycle takes them into account.
    """

    space: Any
    matrix: PETSc.Mat
    prescribed: np.ndarray
    jumps: bool = False
    held: np.ndarray | None = None

    @property
    def degree(self) -> int:
        """Polynomial degree of the space."""
        return compat.degree(self.space)


class LinearSolver:
    """A KSP for one operator, with everything that it needs: a context manager, which frees it.

    ``levels`` are what it was made of, ``cycle`` is the multigrid cycle, None for a direct solver and for degree 1.
    """

    @stage("set-up")
    def __init__(self, levels: list[Level], *, direct: bool, below: "LinearSolver | None" = None):
        """Set up; collective. Operators above degree 1 are products, but for that of a ``direct`` solver.

        ``below`` is a solver of all levels but the last, if there is one: what it has set up serves on where it can,
        and it must then live as long.

        Raises:
            SolveError: if that fails.
        """
        self.levels = levels
        self.cycle: Cycle | None = None
        self._is_direct, self._looked_closer = direct, False
        with ExitStack() as stack, explained():
            self._stack = stack
            kind, preconditioner = ("factors", None) if direct else ("elasticity", self._preconditioner(below))
            self.ksp = solver_of(kind, self.matrix, stack, preconditioner)
            self.ksp.setUp()
            self._stack = stack.pop_all()

    def __enter__(self) -> "LinearSolver":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _preconditioner(self, below: "LinearSolver | None") -> "PETSc.PC | Cycle":
        levels = self.levels
        if len(levels) == 1:
            return algebraic(self.matrix, self._stack)
        below = below if below is not None and below.carries(levels) else None
        known = 1 if below is None else len(levels) - 1
        smoothed = [SmoothedLevel(operator_of(level.matrix), jumps=level.jumps) for level in levels[known:]]
        between = list(map(interpolation, levels[known - 1 :], levels[known:]))
        if below is None:
            self.cycle = Cycle(smoothed, between, algebraic(levels[0].matrix, self._stack))
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
        """Improve ``solution`` and return the iterations; collective. A direct solve does not look at what it holds.

        ``tolerance`` is for the energy norm of the error relative to that of the whole solution, a ``target`` for that
        norm itself. An iteration takes one of them.

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
            if self.ksp.getConvergedReason() == INDEFINITE and self.look_closer():
                before = int(self.ksp.its)
                self.ksp.solve(rhs, solution)
        return before + check_converged(self.ksp)

    @stage("iterations")
    def solve_many(self, loads: FloatArray) -> FloatArray:
        """Return the solutions (m, n) for the columns of ``loads`` (m, n), of a direct solver on one process.

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
        """Begin each solve from the best sum of earlier solutions, in the energy norm; collective.

        PETSc keeps them (P. F. Fischer, Comput. Methods Appl. Mech. Eng. 163, 193, 1998), and begins anew once there
        are as many as fit. What a solve is given to begin with has no part in it.
        """
        comm = self.matrix.comm.tompi4py()
        size = comm.allreduce(max(1, self.matrix.getLocalSize()[0]), op=MPI.MAX)
        self.ksp.setUseFischerGuess(_IN_ENERGY, max(2, min(_MOST_RECYCLED, _RECYCLED_BYTES // (8 * size))))

    def look_closer(self) -> bool:
        """Make an indefinite preconditioner definite, if that was not tried: what smoothers took for their largest
        eigenvalue was too small. Only a cycle can.
        """
        if self.cycle is None or self._looked_closer:
            return False
        self._looked_closer = True
        self.cycle.look_closer()
        return True

    def carries(self, levels: list[Level]) -> bool:
        """Tell whether what is set up serves a cycle of ``levels``, one more than its own."""
        same = len(levels) == len(self.levels) + 1 and all(map(operator.is_, levels, self.levels))
        return same and not self._is_direct and all(level.held is None for level in levels)

    @stage("set-up")
    def hold(self, levels: list[Level]) -> None:
        """Hold other dofs from now on: those of ``levels``, whose operators are the same but for degree 1; collective.

        Raises:
            SolveError: if PETSc fails.
        """
        self.levels = levels
        with explained():
            self._hold(algebraic(levels[0].matrix, self._stack))

    def _hold(self, coarse: PETSc.PC) -> None:
        assert self.cycle is not None
        held = [_NONE if level.held is None else level.held for level in self.levels[1:]]
        masks = [(free(lower), free(upper)) for lower, upper in itertools.pairwise(self.levels)]
        self.cycle.hold(held, masks, coarse)

    @property
    def matrix(self) -> PETSc.Mat:
        """The operator."""
        return self.levels[-1].matrix

    def precondition(self, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply the preconditioner alone; collective. ``residual`` must be nought where dofs are prescribed.

        Raises:
            SolveError: if PETSc fails.
        """
        with explained():
            self.ksp.pc.apply(residual, result)

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Be the preconditioner of another operator; PETSc calls this."""
        self.precondition(residual, result)

    def close(self) -> None:
        """Free everything that was made."""
        self._stack.close()
