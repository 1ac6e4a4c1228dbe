"""Round scenes in the half plane (r, z): the same elasticity, two dimensions, and F to about 1e-7.

Lengths are in units of the footprint's radius a, stresses in units of μ and displacements in units of the depth d:
nothing depends on the unit of anything. The force is the reaction: the residual of the unmodified operator on the
probe's dofs, times 2π.
"""

from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np

from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.meridian import (
    AXIS,
    Grading,
    Meridian,
    MeridianArrays,
    meridian_mesh,
)
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve.krylov import SolveError
from pipeline.solve.meridian.forms import JoinedForms, MeridianForms
from pipeline.solve.meridian.refine import DirectProblem, best_answer, error_bar, meshes_of, only_along_axis, refined
from pipeline.solve.meridian.system import (
    HalfPlane,
    Meshes,
    factorised,
    forms_of,
    max_strain,
)
from pipeline.solve.movement import Movement
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.response import reaction
from pipeline.solve.solution import Solution
from pipeline.solve.spaces import Conditions
from pipeline.stages import recorded, stage

DEGREE = 5


class MeridianProblem(DirectProblem):
    """The meridian of a round scene, which a probe presses along its axis."""

    def __init__(self, meridian: HalfPlane, conditions: Conditions, *, accuracy: float = 1e-5, degree: int = DEGREE):
        """Prepare to refine until the error bar is at most ``accuracy``; ``degree`` is 3 at least."""
        self._meridian, self._bonded = meridian, conditions.bonded
        self._accuracy, self._degree = accuracy, degree

    @stage("axisymmetric")
    def solve(
        self,
        law: MaterialLaw,
        movement: Movement,
        *,
        method: str = "auto",
        tolerance: float = 0.0,
        estimate: bool = True,
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
        only_along_axis(movement)
        for tissue in law.parameters:
            if not 0 <= tissue.poisson <= 0.5:
                raise SolveError(f"Poisson's ratio is {tissue.poisson:g}, must be between 0 and 0.5")

        def solve_on(grading: Grading) -> _Scaled:
            with stage("meshing"):
                arrays = self._meridian.mesh(grading)
            return _solve_on(arrays, law, self._bonded, self._degree)

        with recorded() as times:
            best = best_answer(solve_on, self._accuracy)
        a, mu, (amount,) = self._meridian.unit, law.lame_mu[0], movement.amounts
        response = reaction(
            movement,
            np.array([[mu * a * best.stationary]]),
            np.array([[0.0, 0.0, mu * a * best.on_probe]]),
            balance=best.balance,
        )
        return Solution(
            response=response,
            largest={"max_strain": abs(amount) / a * best.max_strain},
            dofs=best.forms.dofs,
            cells=best.cells,
            iterations=best.iterations,
            times=times,
            bars=best.error * response.stiffness,
        )


def compile_axisymmetric(degree: int = DEGREE, *, curved: bool = False, lowest: int = 0) -> None:
    """Compile every form that a :class:`MeridianProblem` needs, on this process; call it within ``compiling()``.

    Those from the degree ``lowest`` on, if it is given.
    """
    example: HalfPlane = EllipticMeridian(2.0, 2.0, 1.0, 0.0) if curved else Meridian(2.0, 1.0, 1.0)
    mesh, facets = meridian_mesh(example.mesh(Grading(1.0)))
    for mixed in (False, True):
        for p in range(lowest or degree - 1, degree + 1):
            MeridianForms(mesh, facets, p, mixed)


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
    cells: int = 0


def _solve_on(arrays: MeridianArrays, law: MaterialLaw, bonded: bool, degree: int) -> _Scaled:
    """Solve with degrees p - 1 and p on one mesh: the answer is that of p, its error bar comes from the difference."""
    with stage("meshing"):
        meshes = meshes_of(arrays)
    coarse = _solve_degree(meshes, degree - 1, law, bonded)
    fine = _solve_degree(meshes, degree, law, bonded)
    error = error_bar(coarse.on_probe, fine.on_probe, degree, max(coarse.balance, fine.balance))
    with stage("solve"):
        return replace(fine, error=error, max_strain=max_strain(fine.forms, arrays), cells=len(arrays.cells))


def _solve_degree(meshes: Meshes, degree: int, law: MaterialLaw, bonded: bool) -> _Scaled:
    """Solve with one degree; refine the solution until round-off stops it."""
    with stage("assembly"):
        forms, definite = forms_of(meshes, degree, law)
        stiffness = forms.stiffness()
        probe, support = forms.locate(PROBE, 1), forms.locate(FIXED, 1)
        zero = [support, forms.locate(FIXED, 0), forms.locate(AXIS, 0)]
        if bonded:
            zero.append(forms.locate(PROBE, 0))
        free = np.setdiff1d(np.arange(forms.dofs), np.concatenate([probe, *zero]))
        unknown = stiffness[free][:, free]
    with factorised(unknown, definite=definite) as solve, stage("solve"):
        solution, residual, balance, steps = refined(forms, solve, free, probe, support, np.full(len(probe), -1.0))
    on_probe, twice_energy = (2 * pi * float(work) for work in (residual[probe].sum(), solution @ residual))
    if on_probe >= 0:
        raise SolveError("the tissue pulls at the probe that presses it")
    return _Scaled(on_probe, twice_energy, balance, forms, steps)
