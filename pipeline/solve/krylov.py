"""Linear solvers: one factory of PETSc's KSP, what its errors mean, and the solver for elasticity.

A KSP is Cholesky's or LDLᵀ factorisation by MUMPS, or an iteration. Conjugate gradients for elasticity have a multigrid
cycle that goes down in degree (p, p - 1, …, 1), :mod:`pipeline.solve.kernels.multigrid`, and from degree 1 by hypre's
BoomerAMG. Every KSP and PC has its own options prefix.
"""

import itertools
import operator
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.solve import SolveError
from pipeline.solve.kernels.multigrid import Cycle, SmoothedLevel, free, interpolation
from pipeline.solve.kernels.product import operator_of
from pipeline.stages import stage

# Dofs up to which Cholesky is faster than conjugate gradients, measured: docs/solvers.md.
DIRECT_LIMIT = {1: 5_000, 2: 1_500, 3: 1_500}
# So many earlier solutions begin the next one, and no more than fit into so many bytes of a process; and Fischer's
# second method, for operators that are symmetric and positive definite.
_MOST_RECYCLED, _RECYCLED_BYTES = 48, 100_000_000
_IN_ENERGY = 2

_CG = {"ksp_type": "cg", "ksp_atol": 0.0, "ksp_initial_guess_nonzero": True}
_FACTORS = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
_TANGENT = {"ksp_norm_type": "natural", "ksp_rtol": 1e-4, "ksp_max_it": 400}
# Options of PETSc by what is solved. Iterations improve what they are given, unless it says otherwise.
SOLVERS: dict[str, dict[str, Any]] = {
    "factors": _FACTORS,
    # MUMPS enlarges its work space by this percentage: an indefinite matrix fills in more than the analysis foresees.
    "factors, indefinite": _FACTORS | {"mat_mumps_icntl_14": 100},
    "elasticity": _CG | {"ksp_norm_type": "natural", "ksp_max_it": 500},
    # The preconditioner is not applied once more for a norm.
    "energy decrements": _CG | {"ksp_norm_type": "none", "ksp_max_it": 60},
    # Newton's method gains three digits a step, and begins each from nothing.
    "tangent": _CG | _TANGENT,
    "Newton's method": {
        **_CG,
        **_TANGENT,
        "ksp_initial_guess_nonzero": False,
        "snes_type": "newtonls",
        "snes_linesearch_type": "basic",
        "snes_rtol": 0.0,
        "snes_stol": 0.0,
        "snes_max_it": 25,
    },
    "eigenvalues": {"ksp_type": "cg", "ksp_norm_type": "natural", "ksp_rtol": 1e-12, "ksp_max_it": 30},
    "saddle point": {"ksp_type": "gcr", "ksp_max_it": 300, "ksp_initial_guess_nonzero": True},
    "mass": {
        "ksp_type": "chebyshev",
        "ksp_norm_type": "none",
        "ksp_chebyshev_esteig_steps": 10,
        "pc_type": "jacobi",
    },
    # Symmetric: Gauss–Seidel down, backwards up. Three entries to a row of the interpolation keep coarse levels sparse.
    "degree 1": {
        "pc_type": "hypre",
        "pc_hypre_type": "boomeramg",
        "pc_hypre_boomeramg_coarsen_type": "HMIS",
        "pc_hypre_boomeramg_interp_type": "ext+i",
        "pc_hypre_boomeramg_strong_threshold": 0.5,
        "pc_hypre_boomeramg_P_max": 3,
        "pc_hypre_boomeramg_no_CF": "",
        "pc_hypre_boomeramg_relax_type_down": "SOR/Jacobi",
        "pc_hypre_boomeramg_relax_type_up": "backward-SOR/Jacobi",
    },
}
# On several ranks a sweep takes what other ranks hold as it was. Where the material jumps that amplifies, and leaves no
# definite preconditioner; with the sums of those entries' sizes on the diagonal it cannot (A. H. Baker, R. D. Falgout,
# T. V. Kolev and U. M. Yang, SIAM J. Sci. Comput. 33, 2864, 2011).
_ON_RANKS = {
    "pc_hypre_boomeramg_relax_type_down": "l1-Gauss-Seidel",
    "pc_hypre_boomeramg_relax_type_up": "backward-l1-Gauss-Seidel",
}

_prefixes = itertools.count()
_NONE = np.empty(0, dtype=np.int32)
INDEFINITE = PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC


@contextmanager
def explained() -> Iterator[None]:
    """Raise what PETSc and the multigrid cycle raise as errors for the reader of a record.

    Raises:
        SolveError: in their place.
    """
    try:
        yield
    except PETSc.Error as error:
        raise SolveError(explain(error)) from error
    except ArithmeticError as error:
        raise SolveError(str(error)) from error


def explain(error: PETSc.Error) -> str:
    """Return what an error of PETSc means, for the reader of a record."""
    return {
        55: "out of memory",
        76: "the factorisation failed (out of memory, or the operator is singular)",
    }.get(error.ierr, f"PETSc error {error.ierr}")


def check_converged(ksp: PETSc.KSP) -> int:
    """Return the iterations of the last solve.

    Raises:
        SolveError: if it did not converge.
    """
    reason = ksp.getConvergedReason()
    if reason <= 0:
        names = {v: k for k, v in vars(PETSc.KSP.ConvergedReason).items() if isinstance(v, int)}
        name = names.get(reason, str(reason)).lower()
        raise SolveError(f"the linear solver did not converge: {name} after {ksp.its} iterations")
    return int(ksp.its)


def configure(solver: PETSc.KSP | PETSc.PC | PETSc.SNES, options: Mapping[str, Any]) -> None:
    """Give a solver ``options`` of PETSc, which have an own prefix and are removed again; collective."""
    held, prefix = PETSc.Options(), f"epsmesh{next(_prefixes)}_"
    try:
        solver.setOptionsPrefix(prefix)
        for name, value in options.items():
            held[prefix + name] = value
        solver.setFromOptions()
    finally:
        for name in options:
            held.delValue(prefix + name)


def solver_of(kind: str, matrix: PETSc.Mat, stack: ExitStack, preconditioner: Any = None, **options: Any) -> PETSc.KSP:
    """Return a KSP of a ``kind`` of ``SOLVERS``, not set up, freed with the ``stack``; collective.

    The ``preconditioner`` is a PC, or a context in Python; without one, the options name it. More ``options`` of PETSc
    are added to those of the kind.
    """
    ksp = keep(stack, PETSc.KSP().create(matrix.comm))
    ksp.setOperators(matrix)
    configure(ksp, SOLVERS[kind] | options)
    if isinstance(preconditioner, PETSc.PC):
        ksp.setPC(preconditioner)
    elif preconditioner is not None:
        ksp.pc.setType("python")
        ksp.pc.setPythonContext(preconditioner)
    return ksp


def algebraic(matrix: PETSc.Mat, stack: ExitStack) -> PETSc.PC:
    """Return hypre's multigrid for a ``matrix`` of degree 1, freed with the ``stack``; collective."""
    pc = keep(stack, PETSc.PC().create(matrix.comm))
    pc.setOperators(matrix)
    configure(pc, SOLVERS["degree 1"] | (_ON_RANKS if matrix.comm.size > 1 else {}))
    pc.setUp()
    return pc


def keep(stack: ExitStack, item: Any) -> Any:
    """Let ``stack`` destroy an ``item`` of PETSc, and return it."""
    stack.callback(item.destroy)
    return item


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


def is_direct(method: str, dofs: int, limit: int) -> bool:
    """Decide between a factorisation, faster up to a ``limit`` of unknowns, and iterations."""
    return method == "direct" or (method == "auto" and dofs <= limit)


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
