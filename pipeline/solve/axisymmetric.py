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
    split_regions,
)
from pipeline.scene.model import FIXED, PROBE
from pipeline.solve.conditions import Conditions
from pipeline.solve.linear import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.material import MaterialLaw
from pipeline.solve.meridian_forms import JoinedForms, MeridianForms
from pipeline.solve.meridian_system import (
    Clock,
    HalfPlane,
    Meshes,
    Unbalanced,
    factorised,
    forms_of,
    max_strain,
    poisson_of,
)
from pipeline.solve.reaction import reaction
from pipeline.solve.solution import BALANCE_LIMIT, Solution
from pipeline.stages import stage

DEGREE = 5
# Meshes in the order in which they are tried, until the error bar is below the accuracy asked for.
_GRADINGS = (Grading(1e-6, 1.0, 4.0), Grading(1e-7, 0.7, 2.0), Grading(1e-8, 0.5, 1.0))
# An error bar above this is no answer.
_WORST_ERROR = 1e-3
# Each refinement gains the digits that the factors hold; a balance below the second number has nothing to gain.
_MOST_REFINEMENTS, _BALANCED = 20, 1e-9


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
        for nu in map(poisson_of, law.lame_lambda, law.lame_mu):
            if not 0 <= nu <= 0.5:
                raise SolveError(f"Poisson's ratio is {nu:g}, must be between 0 and 0.5")
        clock, best, failure = Clock(), None, SolveError("no mesh was tried")
        for grading in _GRADINGS:
            try:
                arrays = self._meridian.mesh(grading)
                found = _solve_on(arrays, law, self._bonded, self._degree, clock)
            except Unbalanced as error:
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


def _solve_on(arrays: MeridianArrays, law: MaterialLaw, bonded: bool, degree: int, clock: Clock) -> _Scaled:
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
        return replace(fine, error=error, max_strain=max_strain(fine.forms, arrays))


def _solve_degree(meshes: Meshes, degree: int, law: MaterialLaw, bonded: bool, clock: Clock) -> _Scaled:
    """Solve with one degree; refine the solution until round-off stops it."""
    with clock("assemble"):
        forms, definite = forms_of(meshes, degree, law)
        stiffness = forms.stiffness()
        probe, support = forms.locate(PROBE, 1), forms.locate(FIXED, 1)
        zero = [support, forms.locate(FIXED, 0), forms.locate(AXIS, 0)]
        if bonded:
            zero.append(forms.locate(PROBE, 0))
        free = np.setdiff1d(np.arange(forms.dofs), np.concatenate([probe, *zero]))
        solution = np.zeros(forms.dofs)
        solution[probe] = -1.0
        unknown = stiffness[free][:, free]
    with factorised(unknown, definite=definite, clock=clock) as solve, clock("solve"):
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
        raise Unbalanced(
            f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}; "
            "the body is so slender that its stiffness drowns in round-off"
        )
    return _Scaled(on_probe, twice_energy, balance, forms, iteration)
