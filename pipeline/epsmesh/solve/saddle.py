"""Linear solvers for the saddle point of the mixed element,

    [ K₀   Bᵀ ] [u]   [f]
    [ B  −c M ] [p] = [g],

by LDLᵀ (MUMPS), or by generalised conjugate residuals (GCR) with a block-triangular preconditioner: multigrid for K₀,
and a multiple of the mass M for the Schur complement (D. Silvester and A. Wathen, SIAM J. Numer. Anal. 31, 1352, 1994).
K₀ is far from incompressible: neither c (0 if incompressible) nor the mesh size changes the iterations much.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import isfinite

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.conjugate_residuals import conjugate_residuals
from epsmesh.solve.kernels.multigrid import Cycle
from epsmesh.solve.kernels.pressure import CellPressures, matrix_of
from epsmesh.solve.kernels.product import operator_of
from epsmesh.solve.krylov import check_converged, explained, factorised, keep, solver_of
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.stages import stage

Pair = tuple[PETSc.Vec, PETSc.Vec]
Weight = float | FloatArray

# Iterations, and those before a restart: more than a solve needs as a rule.
_MOST_ITERATIONS, _RESTART = 300, 40
# B K₀⁻¹ Bᵀ is M / (λ₀ + 2μ) inside the body, and less at prescribed displacements; measured, flat from 0.8 to 1.6.
_SCHUR = 1.2
# Chebyshev steps for M preconditioned by its diagonal, and smallest over largest eigenvalue, by the degree of the
# pressure. Degree 1: 1/5 (A. Wathen, IMA J. Numer. Anal. 7, 449, 1987); the others are tuned for few iterations.
_MASS = {1: (3, 0.2), 2: (5, 0.1), 3: (10, 0.04), 4: (14, 0.02)}


@dataclass(frozen=True)
class Saddle:
    """Blocks of the saddle point: ``levels`` end with K₀, ``coupling`` is B, with zero columns at prescribed dofs.

    All are assembled for a direct solve; otherwise they may be matrix-free (:mod:`epsmesh.solve.kernels.pressure`).

    ``stiffness`` is λ₀ + 2μ in units of the pressure, one number or one for each pressure of this rank; ``degree`` is
    that of the pressure.
    """

    levels: list[Level]
    coupling: PETSc.Mat
    mass: PETSc.Mat
    stiffness: Weight
    degree: int


class SaddleSolver:
    """Solver of a saddle point for any c; a context manager, which frees what it made.

    c is one number, or one for each pressure of this rank. All that does not depend on c is set up once.
    ``first_energies`` are the squared energy norms of an iterative solve's initial errors, one for each right-hand
    side, as measured by the preconditioner.
    """

    def __init__(self, saddle: Saddle, *, direct: bool, below: "SaddleSolver | None" = None):
        """Set up; collective. ``below`` is a solver for elements of one degree less, or None: see ``LinearSolver``."""
        self._saddle, self._direct = saddle, direct
        self.first_energies: list[float] = []
        with ExitStack() as stack, stage("set-up"):
            if not direct:
                known = None if below is None else below.multigrid
                self._multigrid = stack.enter_context(LinearSolver(saddle.levels, direct=False, below=known))
                self._mass = self._mass_solver(stack)
            self._stack = stack.pop_all()

    def __enter__(self) -> "SaddleSolver":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def solve(
        self, c: Weight, rhs: Sequence[Pair], unknowns: Sequence[Pair], tolerance: float, target: float | None = None
    ) -> int:
        """Improve each of ``unknowns``, (u, p), until the energy norm of its error has fallen by ``tolerance``.

        A ``target`` is for the norm itself. Return the iterations of all; collective. A direct solve is exact and
        ignores the initial guess.

        Raises:
            SolveError: if PETSc reports anything but convergence.
        """
        iterations, self.first_energies = 0, []
        with ExitStack() as stack, explained():
            matrix = self._matrix(c, stack)
            block = None if self._direct else self._preconditioner(c, stack)
            factors = self._factors(matrix, stack) if block is None else PETSc.KSP()
            for load, unknown in zip(rhs, unknowns, strict=True):
                if block is None:
                    iterations += _solve_directly(factors, load, unknown)
                else:
                    test, pair = _EnergyTest(block, tolerance, target), _Unknown(matrix, load, unknown)
                    iterations += conjugate_residuals(matrix, block, pair, test, _RESTART)
                self.first_energies.append(0.0 if block is None else block.first_energy)
        return iterations

    def preconditioner(self, c: Weight, stack: ExitStack) -> "_BlockTriangular | _Factors":
        """Return a preconditioner of other saddle points; the ``stack`` frees it; collective.

        Raises:
            SolveError: if the factorisation fails.
        """
        if not self._direct:
            return self._preconditioner(c, stack)
        with explained():
            return _Factors(self._factors(self._matrix(c, stack), stack))

    @property
    def multigrid(self) -> LinearSolver | None:
        """The multigrid solver for K₀; None for a factorisation."""
        return None if self._direct else self._multigrid

    def _matrix(self, c: Weight, stack: ExitStack) -> PETSc.Mat:
        saddle = self._saddle
        if not self._direct:
            return keep(stack, _Products(saddle, c).matrix())
        mass, transpose = keep(stack, _weighed(saddle.mass, -c)), PETSc.Mat()
        saddle.coupling.transpose(transpose)
        blocks = [[saddle.levels[-1].matrix, keep(stack, transpose)], [saddle.coupling, mass]]
        return keep(stack, PETSc.Mat().createNest(blocks, comm=saddle.mass.comm))

    @stage("set-up")
    def _factors(self, nest: PETSc.Mat, stack: ExitStack) -> PETSc.KSP:
        matrix = keep(stack, nest.convert("aij", PETSc.Mat()))
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return factorised(matrix, stack)

    def _preconditioner(self, c: Weight, stack: ExitStack) -> "_BlockTriangular":
        saddle = self._saddle
        assert self._multigrid.cycle is not None  # displacements have degree 2 or more
        pressures = saddle.coupling.getPythonContext().pressures
        block = _BlockTriangular(self._multigrid.cycle, pressures, self._mass, c + _SCHUR / saddle.stiffness)
        stack.callback(block.close)
        return block

    def _mass_solver(self, stack: ExitStack) -> PETSc.KSP:
        steps, ratio = _MASS[self._saddle.degree]
        esteig = f"0,{ratio},0,1.1"
        ksp = solver_of("mass", self._saddle.mass, stack, ksp_max_it=steps, ksp_chebyshev_esteig=esteig)
        ksp.setUp()
        return ksp


class _Products:
    """The operator, cell by cell: a context for PETSc."""

    def __init__(self, saddle: Saddle, c: Weight):
        self._stiffness = operator_of(saddle.levels[-1].matrix)
        self._pressures = saddle.coupling.getPythonContext().pressures
        self._mass = saddle.mass.getPythonContext().weighted(-c)

    def matrix(self) -> PETSc.Mat:
        """Return the operator as a PETSc matrix; the caller destroys it; collective."""
        size = 3 * self._stiffness.rows + self._pressures.ghosts.owned
        return matrix_of(self, size, size, self._pressures.comm)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product with ``x`` into ``y``; PETSc calls this."""
        given, result, split = x.array_r, y.array_w, 3 * self._stiffness.rows
        moved, pressed = given[:split], given[split:]
        self._stiffness.product(moved, result[:split])
        result[:split] += self._pressures.pull(pressed)
        result[split:] = self._pressures.dilation(moved) + self._mass.product(pressed)


class _BlockTriangular:
    """The preconditioner z_u = K₀⁻¹ r_u, z_p = −S⁻¹ t with t = r_p − B z_u, both inverses approximate.

    ``energy`` is |r_u·z_u| + |t·z_p| of the last residual. With exact inverses r_u·K₀⁻¹r_u − t·S⁻¹t is the error of the
    energy, and the sum of magnitudes a norm of the error that does not depend on units.
    """

    def __init__(self, cycle: Cycle, pressures: CellPressures, mass: PETSc.KSP, schur: Weight):
        self._cycle, self._pressures, self._mass, self._schur = cycle, pressures, mass, schur
        self._rest, self._found = mass.getOperators()[0].createVecs()
        self.energy = self.first_energy = 0.0

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply the preconditioner; PETSc calls this."""
        given, written, rest = residual.array_r, result.array_w, self._rest.array
        split = len(given) - len(rest)
        self._cycle.correct(given[:split], written[:split])
        rest[:] = given[split:] - self._pressures.dilation(written[:split])
        self._mass.solve(self._rest, self._found)
        written[split:] = self._found.array_r * (-1 / self._schur)
        parts = np.array([given[:split] @ written[:split], rest @ written[split:]])
        self.energy = float(np.abs(global_sum(self._pressures.comm, parts)).sum())

    def refine_eigenvalues(self) -> bool:
        """Return False: GCR needs no definite preconditioner."""
        return False

    def close(self) -> None:
        """Free the work vectors."""
        self._rest.destroy()
        self._found.destroy()


class _Factors:
    """The factors of a saddle point as preconditioner."""

    def __init__(self, ksp: PETSc.KSP):
        self._ksp = ksp

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Apply the preconditioner; PETSc calls this."""
        self._ksp.solve(residual, result)

    def refine_eigenvalues(self) -> bool:
        """Return False: factors are exact."""
        return False


class _Unknown:
    """A displacement and a pressure, with the right-hand side of both."""

    def __init__(self, matrix: PETSc.Mat, load: Pair, unknown: Pair):
        self._matrix, self._load, self._unknown = matrix, load, unknown

    def residual(self, result: PETSc.Vec, work: PETSc.Vec) -> None:
        """Write the residual of both equations into ``result``."""
        _join(self._unknown, work)
        self._matrix.mult(work, result)
        _join(self._load, work)
        result.aypx(-1.0, work)

    def add(self, correction: PETSc.Vec) -> None:
        """Add a correction of both."""
        u, p = self._unknown
        split = u.getLocalSize()
        u.array[:] += correction.array_r[:split]
        p.array[:] += correction.array_r[split:]


def _join(pair: Pair, whole: PETSc.Vec) -> None:
    split = pair[0].getLocalSize()
    whole.array[:split], whole.array[split:] = pair[0].array_r, pair[1].array_r


def _solve_directly(factors: PETSc.KSP, load: Pair, unknown: Pair) -> int:
    """Write the solution for a ``load`` into ``unknown``, and return 1; collective."""
    matrix, _ = factors.getOperators()
    with ExitStack() as stack:
        b, x = (keep(stack, vector) for vector in matrix.createVecs())
        _join(load, b)
        factors.solve(b, x)
        split = unknown[0].getLocalSize()
        unknown[0].array[:], unknown[1].array[:] = x.array_r[:split], x.array_r[split:]
    return check_converged(factors)


class _EnergyTest:
    """Ends GCR when the energy of the error is below tolerance² times the initial one, or below target²."""

    def __init__(self, block: _BlockTriangular, tolerance: float, target: float | None):
        self._block, self._share, self._target = block, tolerance**2, target
        self._previous = 0.0

    def __call__(self, iteration: int, norm: float) -> bool:
        """Return whether to end after an ``iteration``, with the ``norm`` of its residual.

        Raises:
            SolveError: if it is not finite, or after too many iterations.
        """
        previous, self._previous = self._previous, norm
        if not isfinite(norm):
            raise SolveError(f"the linear solver did not converge: not a number after {iteration} iterations")
        if norm == 0.0 or iteration == 0:
            return norm == 0.0
        if iteration == 1:
            self._block.first_energy = self._block.energy
        # The energy is that of the previous iteration's residual; the ratio of plain norms estimates the gain since.
        enough = self._share * self._block.first_energy if self._target is None else self._target**2
        if self._block.energy * (norm / previous) ** 2 <= enough:
            return True
        if iteration >= _MOST_ITERATIONS:
            raise SolveError(f"the linear solver did not converge in {iteration} iterations")
        return False


def _weighed(mass: PETSc.Mat, weight: Weight) -> PETSc.Mat:
    """Return a mass times a weight, which the caller destroys; pressures of different weights share no entry."""
    mass = mass.copy()
    if isinstance(weight, float):
        mass.scale(weight)
        return mass
    weights = mass.createVecLeft()
    weights.array[:] = weight
    mass.diagonalScale(weights, None)
    weights.destroy()
    return mass
