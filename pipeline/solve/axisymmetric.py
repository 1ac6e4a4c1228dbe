"""Round scenes in the half plane (r, z): the same elasticity, two dimensions, and F to about 1e-7.

Lengths are in units of the footprint's radius a, stresses in units of μ and displacements in units of the depth d:
nothing depends on the unit of anything. The force is the reaction: the residual of the unmodified operator on the
probe's dofs, times 2π.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf, pi
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import FloatArray, Int32Array
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import (
    AXIS,
    Grading,
    Meridian,
    MeridianArrays,
    meridian_mesh,
    split_regions,
)
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve.conditions import Conditions
from pipeline.solve.linear import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.material import MaterialLaw
from pipeline.solve.meridian_forms import JoinedForms, MeridianForms
from pipeline.solve.reaction import reaction
from pipeline.solve.solution import BALANCE_LIMIT, Solution
from pipeline.stages import stage

DEGREE = 5
# Later than in three dimensions (Mesh.MIXED_FROM, 0.45), since elements of degree 5 lock later than those of degree 2:
# on three scenes displacement elements differ from mixed ones by 5e-9 to 1e-8 at ν = 0.45 and by 2e-8 at 0.49, take
# half the time (0.3 s, not 0.65), and have bars of 3e-6 at most, where 1e-5 is asked for.
MIXED_FROM = 0.49
# Meshes in the order in which they are tried, until the error bar is below the accuracy asked for.
_GRADINGS = (Grading(1e-6, 1.0, 4.0), Grading(1e-7, 0.7, 2.0), Grading(1e-8, 0.5, 1.0))
# An error bar above this is no answer.
_WORST_ERROR = 1e-3
# Per cent of memory beyond MUMPS's estimate, which pivoting exceeds.
_SPARE_MEMORY = 100
# Each refinement gains the digits that the factors hold; a balance below the second number has nothing to gain.
_MOST_REFINEMENTS, _BALANCED = 20, 1e-9
# Strain is not read nearer to a singular point than this (in units of a).
_STRAIN_DISTANCE = 0.1


# The half planes that are solved on.
HalfPlane = Meridian | EllipticMeridian
# Of each region of a body, by its number: its mesh and the facets of each group.
Meshes = dict[int, tuple[Any, dict[str, Int32Array]]]


class MeridianProblem:
    """The meridian of a round scene, which a probe presses along its axis; on this process alone.

    A context manager, like other problems; it holds nothing between solves, each of which makes meshes of its own.
    """

    def __init__(self, meridian: HalfPlane, conditions: Conditions, *, accuracy: float = 1e-5, degree: int = DEGREE):
        """Prepare to refine until the error bar is at most ``accuracy``; ``degree`` is 3 at least."""
        self._meridian, self._bonded = meridian, conditions.bonded
        self._accuracy, self._degree = accuracy, degree

    def __enter__(self) -> "MeridianProblem":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def dofs(self) -> int:
        """None: meshes are made, and their unknowns counted, in each solve, which is direct."""
        return 0

    @stage("axisymmetric")
    def solve(
        self, law: MaterialLaw, loads: Loads, *, method: str = "auto", tolerance: float = 0.0, estimate: bool = True
    ) -> Solution:
        """Solve for 0 <= ν <= 0.5 and a movement along the axis; directly, refined until round-off stops it.

        Takes the next mesh until the error bar is small enough, or there is no finer one; then takes the best. The
        bars are there whether ``estimate`` asks for them or not; ``max_strain`` is that of cells at least a/10 away
        from every singular point. ``dofs``, ``cells`` and ``iterations`` belong to the solve that gave F, the seconds
        are of all; an iteration beyond the first refines what a slender body loses to round-off.

        Raises:
            SolveError: if the conditions contradict each other or nothing is held, if a solve fails a check, or if the
                error bar stays above 1e-3.
        """
        if len(loads.motions) > 1 or loads.motions[0].is_rotation or any(loads.motions[0].direction[:2]):
            raise SolveError("the meridian serves movements along its axis only")
        for nu in map(_poisson, law.lame_lambda, law.lame_mu):
            if not 0 <= nu <= 0.5:
                raise SolveError(f"Poisson's ratio is {nu:g}, must be between 0 and 0.5")
        clock, best, failure = _Clock(), None, SolveError("no mesh was tried")
        for grading in _GRADINGS:
            try:
                arrays = self._meridian.mesh(grading)
                found = _solve_on(arrays, law, self._bonded, self._degree, clock)
            except _Unbalanced as error:
                # Round-off grows with refinement: a finer mesh would do no better.
                failure = error
                break
            if best is None or found.error < best.error:
                best, cells = found, len(arrays.cells)
            if best.error <= self._accuracy:
                break
        if best is None:
            raise failure
        if best.error > _WORST_ERROR:
            raise SolveError(f"the force is known to {best.error:.0e} only, allowed {_WORST_ERROR:.0e}")
        a, mu, (amount,) = self._meridian.unit, law.lame_mu[0], loads.amounts
        response = reaction(
            loads, np.array([[mu * a * best.stationary]]), np.array([[0.0, 0.0, mu * a * best.on_probe]]),
            balance=best.balance,
        )  # fmt: skip
        return Solution(
            response, abs(amount) / a * best.max_strain, best.forms.dofs, cells, best.iterations,
            bars=best.error * response.stiffness,
            time_mesh=clock.seconds["mesh"], time_assemble=clock.seconds["assemble"],
            time_setup=clock.seconds["setup"], time_solve=clock.seconds["solve"],
        )  # fmt: skip


def compile_axisymmetric(degree: int = DEGREE, *, curved: bool = False) -> None:
    """Compile every form that a :class:`MeridianProblem` needs, on this process; call it within ``compiling()``."""
    example: HalfPlane = EllipticMeridian(2.0, 2.0, 1.0, 0.0) if curved else Meridian(2.0, 1.0, 1.0)
    mesh, facets = meridian_mesh(example.mesh(Grading(1.0)))
    for mixed in (False, True):
        for p in (degree - 1, degree):
            MeridianForms(mesh, facets, p, mixed)


class _Unbalanced(SolveError):
    """Round-off has spoilt the solution."""


class _Clock:
    """Seconds spent, by kind of work."""

    def __init__(self) -> None:
        self.seconds = dict.fromkeys(("mesh", "assemble", "setup", "solve"), 0.0)

    @contextmanager
    def __call__(self, kind: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[kind] += time.perf_counter() - start


@dataclass(frozen=True)
class _Scaled:
    """A solution for a = d = 1 and μ = 1 in region 0: the residual on the probe, and twice the energy.

    ``error`` is relative.
    """

    on_probe: float
    stationary: float
    balance: float
    forms: MeridianForms | JoinedForms
    iterations: int
    error: float = inf
    max_strain: float = 0.0


def _solve_on(arrays: MeridianArrays, law: MaterialLaw, bonded: bool, degree: int, clock: _Clock) -> _Scaled:
    """Solve with degrees p - 1 and p on one mesh: the answer is that of p, its error bar comes from the difference.

    At an edge where the displacement goes like r^½, the error falls like p⁻² if nothing else is left (the mesh's
    smallest cell), faster elsewhere: what is left is at most θ = p²/(2p + 1) times the last step, p counted before
    it. The safety of 1.25 on it is measured, and so is that round-off errs by less than 3 times the balance.
    """
    clock.seconds["mesh"] += arrays.seconds
    if FIXED not in arrays.facets:
        raise SolveError("nothing that is kept of the body is held: the tissue would float")
    if len(np.intersect1d(arrays.facets[PROBE], arrays.facets[FIXED])):
        raise SolveError("the probe covers the top right to the held side: no displacement satisfies both conditions")
    with clock("mesh"):
        meshes = {region: meridian_mesh(part) for region, part in split_regions(arrays).items()}
    coarse = _solve_degree(meshes, degree - 1, law, bonded, clock)
    fine = _solve_degree(meshes, degree, law, bonded, clock)
    theta = (degree - 1) ** 2 / (2 * degree - 1)
    step = abs(coarse.on_probe / fine.on_probe - 1)
    error = 1.25 * theta * step + 3 * max(coarse.balance, fine.balance)
    with clock("solve"):
        strain, corners = fine.forms.mean_strains()
        distance = np.linalg.norm(corners[:, :, None] - arrays.singular, axis=-1).min(axis=(1, 2))
        max_strain = float(strain[distance >= _STRAIN_DISTANCE].max(initial=0.0))
    return replace(fine, error=error, max_strain=max_strain)


def _solve_degree(meshes: Meshes, degree: int, law: MaterialLaw, bonded: bool, clock: _Clock) -> _Scaled:
    """Solve with one degree; refine the solution until round-off stops it."""
    with clock("assemble"):
        forms, definite = _forms(meshes, degree, law)
        stiffness = forms.stiffness()
        probe, support = forms.locate(PROBE, 1), forms.locate(FIXED, 1)
        zero = [support, forms.locate(FIXED, 0), forms.locate(AXIS, 0)]
        if bonded:
            zero.append(forms.locate(PROBE, 0))
        free = np.setdiff1d(np.arange(forms.dofs), np.concatenate([probe, *zero]))
        solution = np.zeros(forms.dofs)
        solution[probe] = -1.0
        unknown = stiffness[free][:, free]
    with _factorised(unknown, definite=definite, clock=clock) as solve, clock("solve"):
        residual, balance = forms.residual(solution), np.inf
        for iteration in range(1, _MOST_REFINEMENTS + 1):  # noqa: B007
            solution[free] -= solve(residual[free])
            residual, before = forms.residual(solution), balance
            on_probe, on_support = (2 * pi * float(residual[dofs].sum()) for dofs in (probe, support))
            # This is 2U for the mixed form too, once its second row, p = λ div u, holds.
            twice_energy = 2 * pi * float(solution @ residual)
            if not -np.inf < on_probe < 0 < twice_energy < np.inf:
                raise SolveError(f"the solution is not a number or has no energy (2U = {twice_energy:g})")
            balance = max(abs(on_probe + on_support), abs(on_probe + twice_energy)) / -on_probe
            if balance < _BALANCED or balance > before / 2:
                break
    if balance > BALANCE_LIMIT:
        raise _Unbalanced(
            f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}; "
            "the body is so slender that its stiffness drowns in round-off"
        )
    return _Scaled(on_probe, twice_energy, balance, forms, iteration)


def _forms(meshes: Meshes, degree: int, law: MaterialLaw) -> tuple[MeridianForms | JoinedForms, bool]:
    """Return the forms of all materials, in units of the μ of region 0, and whether their operator is definite."""
    parts, weights, definite = [], [], True
    for region, (mesh, facets) in meshes.items():
        lame_lambda, lame_mu = law.lame_lambda[region], law.lame_mu[region]
        mixed = _poisson(lame_lambda, lame_mu) >= MIXED_FROM
        part = MeridianForms(mesh, facets, degree, mixed)
        part.set_ratio(lame_lambda / lame_mu)
        parts.append(part)
        weights.append(lame_mu / law.lame_mu[0])
        definite = definite and not mixed
    return parts[0] if len(parts) == 1 and weights == [1.0] else JoinedForms(parts, weights), definite


def _poisson(lame_lambda: float, lame_mu: float) -> float:
    return MaterialLaw.of(lame_lambda, lame_mu).poisson


@contextmanager
def _factorised(
    matrix: sp.csr_matrix, *, definite: bool, clock: _Clock
) -> Iterator[Callable[[FloatArray], FloatArray]]:
    """Factorise by MUMPS, Cholesky if ``definite``, else LDLᵀ with pivoting; lend the function that solves."""
    matrix.sort_indices()
    csr = matrix.indptr.astype(PETSc.IntType), matrix.indices.astype(PETSc.IntType), matrix.data
    operator = PETSc.Mat().createAIJ(matrix.shape, csr=csr, comm=MPI.COMM_SELF)
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    right, left = operator.createVecs()

    def solve(load: FloatArray) -> FloatArray:
        left.array[:] = load
        ksp.solve(left, right)
        if ksp.getConvergedReason() <= 0:
            raise SolveError("the factorisation failed (out of memory, or the operator is singular)")
        return np.array(right.array)

    try:
        with clock("setup"):
            operator.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            if definite:
                operator.setOption(PETSc.Mat.Option.SPD, True)
            ksp.setOperators(operator)
            ksp.setType("preonly")
            ksp.pc.setType("cholesky")
            ksp.pc.setFactorSolverType("mumps")
            ksp.pc.setFactorSetUpSolverType()
            ksp.pc.getFactorMatrix().setMumpsIcntl(14, _SPARE_MEMORY)
            ksp.setUp()
        yield solve
    except PETSc.Error as error:
        raise SolveError(f"the factorisation failed (PETSc error {error.ierr})") from error
    finally:
        for item in (left, right, ksp, operator):
            item.destroy()
