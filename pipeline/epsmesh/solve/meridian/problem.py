"""Axisymmetric scenes in the half plane (r, z): linear elasticity in two dimensions, and F to about 1e-7.

Lengths are in units of the footprint's radius a, stresses in units of μ, displacements in units of the depth d. The
force is the reaction, times 2π. Meshes are refined until the error bar is small enough.
"""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import product
from math import pi
from typing import Any

import numpy as np

from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.meridian import Grading, Meridian, meridian_mesh
from epsmesh.solve import SolveError
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.laws import LAWS
from epsmesh.solve.meridian.forms import MeridianForms
from epsmesh.solve.meridian.system import HalfPlane, RefinedSolution, System, Unbalanced, max_strain, meshes_of
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.solve.response import reaction
from epsmesh.solve.solution import Problem, Request, Solution
from epsmesh.solve.time_steps import Indentation, TimeSteps, follow_course
from epsmesh.stages import recorded, stage
from epsmesh.viscoelastic import Terms

DEGREE = 5
# Meshes, tried in this order until the error bar is below the required accuracy.
GRADINGS = (Grading(1e-6, 1.0, 4.0), Grading(1e-7, 0.7, 2.0), Grading(1e-8, 0.5, 1.0))
# The first mesh for an accuracy of more than _FINE, in elements of one degree less: its bar is about 1e-4.
_ROUGH, _FINE = Grading(1e-3, 1.0, 4.0), 1e-3
# Largest error bar of a result, unless less is wanted.
_WORST_ERROR = 1e-3


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Result of one mesh at a depth: F/d from the energy and from the reaction, in units of μ a, and the solution.

    ``error`` is the relative error bar of the force; unilateral contact has its own results. The strain energy, in
    units of μ a times m², is half of F d if it is not given. ``in_time`` returns the same body at rest, of a law with
    relaxation.
    """

    stiffness: float
    on_probe: float
    balance: float
    error: float
    unit: float
    max_strain: float
    dofs: int
    cells: int
    iterations: int
    contact: ContactResult | None = None
    energy: float | None = None
    in_time: Callable[[], Indentation] | None = None


class MeridianSolver(Problem):
    """A problem on this process alone; it keeps nothing between solves, and each solve makes its own meshes."""

    def __init__(
        self, meridian: HalfPlane, *, accuracy: float = 1e-5, degree: int = DEGREE, first: Grading | None = None
    ):
        """Prepare to refine until the error bar is at most ``accuracy``; ``degree`` is 3 at least.

        ``first`` is a mesh that is tried before the others: :func:`how_for`.
        """
        self._meridian, self._accuracy, self._degree, self._first = meridian, accuracy, degree, first

    def close(self) -> None:
        """Do nothing: there is nothing to free."""

    @property
    def dofs(self) -> int:
        """Zero: unknowns are counted in each solve, which is direct."""
        return 0

    @stage("axisymmetric")
    def answer(self, asked: Request) -> Solution:
        """Solve for 0 <= ν <= 0.5 and a movement along the axis, directly, with iterative refinement to round-off.

        The mesh is refined until the error bar is small enough, or no finer mesh is left; the best result counts. Error
        bars are always computed. ``max_strain`` is that of cells at least a/10 away from every singular point. ``dofs``
        and ``cells`` belong to the solve that gave F, the seconds to all solves. ``iterations`` counts the steps of
        refinement of that solve, or the linear solves of unilateral contact.

        Raises:
            SolveError: if the conditions contradict each other or nothing is fixed; if contact is not found, or reaches
                the edge of the body; if a solve fails a check, or the error bar stays above 1e-3.
        """
        law, movement = asked.law, asked.movement
        if len(movement.motions) > 1 or movement.motions[0].is_rotation or any(movement.motions[0].direction[:2]):
            raise SolveError("an axisymmetric model needs a movement along its axis")
        for tissue in law.parameters:
            if not 0 <= tissue.poisson <= 0.5:
                raise SolveError(f"Poisson's ratio is {tissue.poisson:g}, must be between 0 and 0.5")
        (depth,) = movement.amounts
        history, iterations = None, 0
        with recorded() as times, ExitStack() as stack:
            found = self._answer(law, depth)
            if asked.course is not None and (at_rest := found.in_time) is not None:
                history, iterations = follow_course(
                    lambda: TimeSteps(law, at_rest(), depth, stack, has_own_mesh=True), asked.course.left(found.error)
                )
        scale = law.lame_mu[0] * found.unit
        stiffness, on_probe = np.array([[scale * found.stiffness]]), np.array([[0.0, 0.0, scale * found.on_probe]])
        return Solution(
            response=reaction(movement, stiffness, on_probe, balance=found.balance),
            largest={"max_strain": found.max_strain},
            dofs=found.dofs,
            cells=found.cells,
            iterations=found.iterations + iterations,
            times=times,
            history=history,
            bars=found.error * stiffness,
            contact=found.contact,
            stored=None if found.energy is None else scale * found.energy,
        )

    @abstractmethod
    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        """Return the best result at a ``depth`` (m)."""

    def _best(self, solve_on: Callable[[Grading], Answer]) -> Answer:
        """Return the best result of the meshes, each tried until the error bar is small enough.

        Raises:
            SolveError: if a solve fails a check, or the error bar stays above 1e-3.
        """
        # Round-off grows with refinement: a mesh finer than an unbalanced one would be no better.
        gradings = GRADINGS if self._first is None else (self._first, *GRADINGS)
        return best_of(
            gradings, lambda grading, _: solve_on(grading), self._accuracy, _WORST_ERROR, ends_with=Unbalanced
        )


def how_for(accuracy: float | None) -> dict[str, Any]:
    """Return the keywords of a linear meridian for a relative ``accuracy`` of F; none if it is to be as good as it can.

    Meridians with load steps take the "accuracy" alone.
    """
    if accuracy is None or accuracy <= _FINE:
        return {}
    return {"accuracy": accuracy, "degree": DEGREE - 1, "first": _ROUGH}


def best_of(
    gradings: Sequence[Grading],
    solve_on: Callable[[Grading, Answer | None], Answer],
    accuracy: float,
    worst: float,
    *,
    ends_with: type[SolveError],
) -> Answer:
    """Return the best result of meshes, each tried until the error bar is at most ``accuracy``.

    ``solve_on`` returns the result on a mesh, given the best one of coarser meshes. If a finer mesh fails with
    ``ends_with``, the best result before stands.

    Raises:
        SolveError: if another solve fails, or the error bar stays above ``worst`` and the accuracy.
    """
    best: Answer | None = None
    for grading in gradings:
        try:
            found = solve_on(grading, best)
        except ends_with:
            if best is None:
                raise
            break
        if best is None or found.error < best.error:
            best = found
        if best.error <= accuracy:
            break
    assert best is not None
    if best.error > (most := max(worst, accuracy)):
        raise SolveError(f"the error bar of the force is {best.error:.0e}, allowed {most:.0e}")
    return best


def error_bar(coarse: float, fine: float, degree: int, balance: float) -> float:
    """Return the relative error bar of ``fine``, of degree p, from degree p - 1 (``coarse``) on the same mesh.

    At an edge where the displacement goes like r^½ the error falls like p⁻², once the mesh's smallest cell dominates,
    and faster elsewhere. The remaining error is at most θ = p²/(2p + 1) times the last step, with p of the step before.
    The safety factor 1.25 is measured; so is that round-off errs by less than 3 times the ``balance``.
    """
    theta = (degree - 1) ** 2 / (2 * degree - 1)
    return 1.25 * theta * abs(coarse / fine - 1) + 3 * balance


class MeridianProblem(MeridianSolver):
    """The meridian of an axisymmetric scene whose probe, with prescribed footprint, presses along its axis."""

    def __init__(self, meridian: HalfPlane, conditions: Conditions, **how: Any):
        """Prepare, as :class:`MeridianSolver`; ``how`` are its keywords."""
        super().__init__(meridian, **how)
        self._bonded = conditions.bonded

    def _answer(self, law: MaterialLaw, depth: float) -> Answer:
        return self._best(lambda grading: self._solve_on(grading, law, depth))

    def _solve_on(self, grading: Grading, law: MaterialLaw, depth: float) -> Answer:
        """Solve with degrees p - 1 and p on one mesh: the result is that of p, the error bar their difference.

        Raises:
            SolveError: if a solve fails a check.
        """
        with stage("meshing"):
            arrays = self._meridian.mesh(grading)
            meshes = meshes_of(arrays)
        found: list[tuple[System, RefinedSolution, float]] = []
        for degree in (self._degree - 1, self._degree):
            with stage("assembly"):
                system = System(meshes, degree, law, bonded=self._bonded)
            with system.factors(system.probe) as solve:
                pressed = solve(np.full(len(system.probe), -1.0))
            on_probe = 2 * pi * float(pressed.residual[system.probe].sum())
            if on_probe >= 0:
                raise SolveError("the force has the wrong sign: the tissue pulls the probe in")
            found.append((system, pressed, on_probe))
        (_, coarse, coarse_force), (system, fine, force) = found
        with stage("solve"):
            strain = max_strain(system.forms, arrays)
        return Answer(
            stiffness=fine.twice_energy,
            on_probe=force,
            balance=fine.balance,
            error=error_bar(coarse_force, force, self._degree, max(coarse.balance, fine.balance))
            + system.forms.unresolved(fine.solution),
            unit=arrays.unit,
            max_strain=abs(depth) / arrays.unit * strain,
            dofs=system.forms.dofs,
            cells=len(arrays.cells),
            iterations=fine.steps,
        )


def compile_axisymmetric(
    degree: int = DEGREE,
    *,
    curved: bool = False,
    lowest: int = 0,
    laws: Sequence[str] = ("linear",),
    relaxes: bool = False,
    varies: bool = False,
) -> None:
    """Compile every form of a meridian with these laws, on this process; call it within ``compiling()``.

    If ``lowest`` is given, degrees from there on are compiled.
    """
    terms: Terms = ((0.5, 1.0),) if relaxes else ()
    example: HalfPlane = EllipticMeridian(2.0, 2.0, 1.0, 0.0) if curved else Meridian(2.0, 1.0, 1.0)
    mesh = meridian_mesh(example.mesh(Grading(1.0)))
    meshes = [mesh, mesh._replace(field=lambda points: np.ones(len(points)))][: 1 + varies]
    for law, poisson, region in product(laws, (0.0, 0.5), meshes):
        further = dict.fromkeys(LAWS[law].parameters, 1.0)
        for p in range(lowest or degree - 1, degree + 1):
            tissue = Parameters.of_moduli(1.0, poisson, law, further)
            MeridianForms({0: region}, p, MaterialLaw((replace(tissue, relaxation=terms),)))
