"""Linear solvers for elasticity: Cholesky by MUMPS, and conjugate gradients with multigrid.

Multigrid goes down in degree (p, p - 1, …, 1) with Chebyshev smoothing, and from degree 1 by hypre's BoomerAMG.
Every solver has its own options prefix.
"""

import itertools
import operator
import time
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.solve.kernels.blocks import SymmetricOperator, SymmetricProduct, UpperBlocks
from pipeline.solve.kernels.interpolation import interpolation, masks
from pipeline.solve.kernels.multigrid import SingleCycle, SmoothedLevel, suits
from pipeline.solve.kernels.product import is_product
from pipeline.solve.transfer import transfer
from pipeline.stages import stage

# Dofs up to which Cholesky is faster than conjugate gradients, measured: docs/solvers.md.
DIRECT_LIMIT = {1: 5_000, 2: 1_500, 3: 1_500}
_MOST_ITERATIONS = 500

# Measured: docs/solvers.md. Five steps find the largest eigenvalue to 15 %; two steps of smoothing on its upper nine
# tenths take the fewest applications of the operator.
_SMOOTHER = {
    "ksp_type": "chebyshev", "ksp_max_it": 2, "ksp_chebyshev_esteig": "0,0.1,0,1.15", "ksp_chebyshev_esteig_steps": 5,
    "pc_type": "pbjacobi",
}  # fmt: skip
# Where the material jumps, the mode of the largest one sits in the stiffest region, of which noise has little.
_SMOOTHER_JUMPS = {"ksp_chebyshev_esteig_steps": 12}
# Symmetric: Gauss–Seidel down, backwards up. Three entries to a row of the interpolation keep the coarse levels sparse.
_BOOMERAMG = {
    "coarsen_type": "HMIS", "interp_type": "ext+i", "strong_threshold": 0.5, "P_max": 3, "no_CF": "",
    "relax_type_down": "SOR/Jacobi", "relax_type_up": "backward-SOR/Jacobi",
}  # fmt: skip
# On several ranks a sweep takes what other ranks hold as it was. Where the material jumps that amplifies, and leaves no
# definite preconditioner; with the sums of those entries' sizes on the diagonal it cannot (A. H. Baker, R. D. Falgout,
# T. V. Kolev and U. M. Yang, SIAM J. Sci. Comput. 33, 2864, 2011).
_BOOMERAMG_OF_RANKS = {"relax_type_down": "l1-Gauss-Seidel", "relax_type_up": "backward-l1-Gauss-Seidel"}

_prefixes = itertools.count()
_NONE = np.empty(0, dtype=np.int32)


class SolveError(Exception):
    """A solve that did not give a solution to rely on."""


@dataclass(frozen=True)
class Level:
    """One level of a hierarchy: its space, its operator and the local dofs (unrolled) that are prescribed.

    ``jumps`` says that the material does, from one region to the next. ``held`` are those of the prescribed dofs that
    the operator knows nothing of: cycles in single precision alone can take them into account.
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


def is_direct(method: str, dofs: int, degree: int) -> bool:
    """Decide between Cholesky and conjugate gradients for a system of ``dofs`` unknowns."""
    return method == "direct" or (method == "auto" and dofs <= DIRECT_LIMIT[degree])


class LinearSolver:
    """A KSP for one operator, with everything that it needs; ``close`` frees it."""

    @stage("set-up")
    def __init__(
        self, levels: list[Level], *, direct: bool, tolerance: float, linear: bool = False,
        below: "LinearSolver | None" = None,
    ):  # fmt: skip
        """Set up; collective. ``linear``: the preconditioner is a linear map to the last digit, in double throughout.

        ``below`` is a solver of all levels but the last, if there is one: what it has set up serves on where it can,
        and it must then live as long.

        Raises:
            SolveError: if that fails.
        """
        self._levels, self._is_direct = levels, direct
        self._below = below if below is not None and below.carries(levels) else None
        self._is_single = not direct and not linear and suits(self._matrices)
        self._looked_closer = False
        self._owned: list[Any] = []
        start = time.perf_counter()
        self._prefix = f"epsmesh{next(_prefixes)}_"
        self._options: set[str] = set()
        with ExitStack() as undo:
            undo.callback(self.close)
            try:
                self._set_up(tolerance)
            except PETSc.Error as error:
                raise SolveError(explain(error)) from error
            except ArithmeticError as error:
                raise SolveError(str(error)) from error
            finally:
                self._clear_options()
            undo.pop_all()
        self.setup_seconds = time.perf_counter() - start

    def _set_up(self, tolerance: float) -> None:
        matrix = self.matrix
        self.ksp = self._own(PETSc.KSP().create(matrix.comm))
        self.ksp.setOptionsPrefix(self._prefix)
        self._operator = self._symmetric_product(matrix) if self._is_single and not is_product(matrix) else matrix
        self.ksp.setOperators(self._operator, matrix)
        if self._is_direct:
            self.ksp.setType("preonly")
            self.ksp.pc.setType("cholesky")
            self.ksp.pc.setFactorSolverType("mumps")
        else:
            self.ksp.setType("cg")
            self.ksp.setNormType(PETSc.KSP.NormType.NATURAL)
            self.ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=_MOST_ITERATIONS)
            self._multigrid(self.ksp.pc)
        self.ksp.setFromOptions()
        self.ksp.setUp()

    @stage("iterations")
    def solve(
        self, rhs: PETSc.Vec, solution: PETSc.Vec, tolerance: float | None = None, target: float | None = None
    ) -> int:
        """Improve ``solution`` and return the iterations; collective. A direct solve does not look at what it holds.

        ``tolerance`` is another one than the solver was made with; a ``target`` is for the energy norm of the error
        itself, not relative to anything.

        Raises:
            SolveError: if PETSc reports anything but convergence.
        """
        if tolerance is not None:
            self.ksp.setTolerances(rtol=tolerance, atol=0.0)
        if target is not None:
            self.ksp.setTolerances(rtol=0.0, atol=target)
        its = self._iterate(rhs, solution)
        reason = self.ksp.getConvergedReason()
        if reason == PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC and self.look_closer():
            its += self._iterate(rhs, solution)
            reason = self.ksp.getConvergedReason()
        if reason <= 0:
            raise SolveError(f"the linear solver did not converge: {reason_name(reason)} after {its} iterations")
        return its

    @stage("iterations")
    def solve_many(self, loads: FloatArray) -> FloatArray:
        """Return the solutions (m, n) for the columns of ``loads`` (m, n), of a direct solver on one process.

        Raises:
            SolveError: if the factorisation fails.
        """
        right = PETSc.Mat().createDense(loads.shape, array=loads, comm=PETSc.COMM_SELF)
        left = PETSc.Mat().createDense(loads.shape, comm=PETSc.COMM_SELF)
        left.setUp()
        try:
            self.ksp.pc.getFactorMatrix().matSolve(right, left)
            return np.array(left.getDenseArray())
        except PETSc.Error as error:
            raise SolveError(f"the factorisation failed (PETSc error {error.ierr})") from error
        finally:
            right.destroy()
            left.destroy()

    def _iterate(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> int:
        try:
            self.ksp.setInitialGuessNonzero(self.ksp.getType() != "preonly")
            self.ksp.solve(rhs, solution)
        except PETSc.Error as error:
            raise SolveError(explain(error)) from error
        return int(self.ksp.its)

    def look_closer(self) -> bool:
        """Make an indefinite preconditioner definite, if that was not tried: what smoothers took for their largest
        eigenvalue was too small. Cycles in single precision alone can.
        """
        if not self._is_single or self._looked_closer:
            return False
        self._looked_closer = True
        self._cycle.look_closer()
        return True

    @property
    def is_single(self) -> bool:
        """Whether it cycles in single precision: it may then serve on with other dofs held."""
        return self._is_single

    @property
    def cycle(self) -> SingleCycle:
        """The cycle in single precision."""
        return self._cycle

    def carries(self, levels: list[Level]) -> bool:
        """Tell whether what is set up serves a cycle in single precision of ``levels``, one more than its own."""
        same = len(levels) == len(self._levels) + 1 and all(map(operator.is_, levels, self._levels))
        serves = self._is_single or (len(self._levels) == 1 and not self._is_direct)
        return same and serves and all(level.held is None for level in levels)

    @stage("set-up")
    def hold(self, levels: list[Level]) -> None:
        """Hold other dofs from now on: those of ``levels``, whose operators are the same but for degree 1; collective.

        Raises:
            SolveError: if PETSc fails.
        """
        start = time.perf_counter()
        self._levels = levels
        try:
            self._hold(self._coarse())
        except PETSc.Error as error:
            raise SolveError(explain(error)) from error
        finally:
            self._clear_options()
        self.setup_seconds += time.perf_counter() - start

    @property
    def levels(self) -> list[Level]:
        """The levels that it was made of."""
        return self._levels

    @property
    def matrix(self) -> PETSc.Mat:
        """The operator, as a matrix with entries."""
        return self._levels[-1].matrix

    @property
    def _matrices(self) -> list[PETSc.Mat]:
        return [level.matrix for level in self._levels]

    def multiply(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the operator's product with ``x`` into ``y``; collective."""
        self._operator.mult(x, y)

    def precondition(self, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply the preconditioner alone; collective. ``residual`` must be nought where dofs are prescribed.

        Raises:
            SolveError: if PETSc fails.
        """
        try:
            self.ksp.pc.apply(residual, result)
        except PETSc.Error as error:
            raise SolveError(explain(error)) from error

    def close(self) -> None:
        """Free everything that was made."""
        while self._owned:
            self._owned.pop().destroy()

    def _own(self, item: Any) -> Any:
        self._owned.append(item)
        return item

    def _option(self, prefix: str, **values: Any) -> None:
        options = PETSc.Options()
        for name, value in values.items():
            options[prefix + name] = value
            self._options.add(prefix + name)

    def _clear_options(self) -> None:
        options = PETSc.Options()
        for name in self._options:
            options.delValue(name)
        self._options.clear()

    def _multigrid(self, pc: PETSc.PC) -> None:
        levels = self._levels
        if len(levels) == 1:
            self._algebraic(pc, self._prefix)
        elif self._is_single:
            self._single_precision(pc)
        else:
            self._double_precision(pc)

    def _symmetric_product(self, matrix: PETSc.Mat) -> PETSc.Mat:
        product = PETSc.Mat().createPython(matrix.getSizes(), SymmetricProduct(matrix), comm=matrix.comm)
        product.setUp()
        return self._own(product)

    def _single_precision(self, pc: PETSc.PC) -> None:
        levels = self._levels
        known = 1 if self._below is None else len(levels) - 1
        smoothed = [SmoothedLevel(_in_single(level.matrix), jumps=level.jumps) for level in levels[known:]]
        between = list(map(interpolation, levels[known - 1 :], levels[known:]))
        if self._below is None:
            self._cycle = SingleCycle(smoothed, between, self._coarse())
        elif self._below.is_single:
            self._cycle = self._below.cycle.above(smoothed, between)
        else:
            self._cycle = SingleCycle(smoothed, between, self._below.ksp.pc)
        if any(level.held is not None for level in levels):
            self._hold(self._coarse())
        pc.setType("python")
        pc.setPythonContext(self._cycle)

    def _coarse(self) -> PETSc.PC:
        """Return the solver of degree 1."""
        prefix = self._prefix + "mg_coarse_"
        coarse = self._own(PETSc.PC().create(self.ksp.comm))
        coarse.setOptionsPrefix(prefix)
        coarse.setOperators(self._levels[0].matrix)
        self._algebraic(coarse, prefix)
        coarse.setFromOptions()
        coarse.setUp()
        return coarse

    def _hold(self, coarse: PETSc.PC) -> None:
        held = [_NONE if level.held is None else level.held for level in self._levels[1:]]
        self._cycle.hold(held, list(map(masks, self._levels, self._levels[1:])), coarse)

    def _double_precision(self, pc: PETSc.PC) -> None:
        levels = self._levels
        pc.setType("mg")
        pc.setMGLevels(len(levels))
        pc.setMGType(PETSc.PC.MGType.MULTIPLICATIVE)
        for number, (coarse, fine) in enumerate(itertools.pairwise(levels), start=1):
            pc.setMGInterpolation(number, self._own(transfer(coarse, fine)))
            pc.getMGSmoother(number).setOperators(fine.matrix)
            smoother = _SMOOTHER | _SMOOTHER_JUMPS if fine.jumps else _SMOOTHER
            self._option(f"{self._prefix}mg_levels_{number}_", **smoother)
        bottom = pc.getMGCoarseSolve()
        bottom.setOperators(levels[0].matrix)
        bottom.setType("preonly")
        bottom.setOptionsPrefix(self._prefix + "mg_coarse_")
        self._algebraic(bottom.pc, self._prefix + "mg_coarse_")

    def _algebraic(self, pc: PETSc.PC, prefix: str) -> None:
        pc.setType("hypre")
        pc.setHYPREType("boomeramg")
        chosen = _BOOMERAMG | (_BOOMERAMG_OF_RANKS if pc.comm.size > 1 else {})
        self._option(prefix, **{f"pc_hypre_boomeramg_{name}": value for name, value in chosen.items()})


def _in_single(matrix: PETSc.Mat) -> SymmetricOperator:
    operator: SymmetricOperator = matrix.getPythonContext() if is_product(matrix) else UpperBlocks(matrix)
    return operator


def reason_name(reason: int) -> str:
    """Return PETSc's name for a reason of convergence or divergence."""
    names = {v: k for k, v in vars(PETSc.KSP.ConvergedReason).items() if isinstance(v, int)}
    return names.get(reason, str(reason)).lower()


def explain(error: PETSc.Error) -> str:
    """Return what an error of PETSc means, for the reader of a record."""
    return {
        55: "out of memory",
        76: "the factorisation failed (out of memory, or the operator is singular)",
    }.get(error.ierr, f"PETSc error {error.ierr}")
