"""Set up and solve a case on its mesh, after a check of the memory."""

from dataclasses import replace
from functools import lru_cache
from math import inf

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.mesh.of_case import meridian_of
from epsmesh.plan import estimate
from epsmesh.plan.refinement import is_matrix_free
from epsmesh.plan.symmetry import slides_across
from epsmesh.plan.thin import cause
from epsmesh.run.far_field import far_field_of, far_field_seconds
from epsmesh.run.fields import half_plane_fields, variation_of
from epsmesh.run.loads import imaged_loads_of, loads_of, terms_of
from epsmesh.run.room import MEMORY_SHARE
from epsmesh.run.tools import beds_on, pull_of, tool_of
from epsmesh.shapes.distance import Distance
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.tissue import FIBRE, Tissue
from epsmesh.solve import SolveError
from epsmesh.solve.conditions import Conditions, Front
from epsmesh.solve.contact.active_set import ContactError
from epsmesh.solve.far_field import BodyField, PointForce
from epsmesh.solve.history import Course
from epsmesh.solve.krylov import DIRECT_LIMIT, is_direct
from epsmesh.solve.meridian.contact import MeridianContact
from epsmesh.solve.meridian.large import LargeMeridian
from epsmesh.solve.meridian.large_contact import LargeMeridianContact
from epsmesh.solve.meridian.problem import MeridianProblem, how_for
from epsmesh.solve.meridian.punch import RoundTool
from epsmesh.solve.movement import FarField, Movement, Place
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.solve.plane.needle import NeedleSolver, plane_cuts
from epsmesh.solve.plane.ring import ring_cuts
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Problem, Request, Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.unloaded import show_image, unload
from epsmesh.study.case import Case
from epsmesh.study.way import Constraint, Motion
from epsmesh.units import canonical

# Largest number of unknowns for a direct solve if iterations do not converge.
_MOST_DIRECT = 100_000
_FAR_FIELDS = 1_000  # in the cache, some kilobytes each
# Radius of the virtual crack extension round a slit's front, in units of the distance to the nearest other surface.
_CLEAR = 0.7


class CaseFailure(Exception):
    """A case cannot be computed; the reason is the same on all ranks."""


def problem_of(spaces: Spaces, case: Case, *, reuse: bool = False, condense: bool = False) -> QuasiStaticProblem:
    """Return the problem on the mesh of ``case``, with its elements; collective.

    The mesh was made for ``case``, whose probe gives the tool's place. ``condense``: many depths follow. Where it shows
    the body under load, it is moved to the shape without (:func:`.unloaded.show_image` undoes it): the spaces are those
    of the problem from then on.

    Raises:
        CaseFailure: if it is a needle that cuts, which has no body: it is solved in a plane section.
        LargeError: if there is no shape without load.
    """
    if case.probe.crack:
        raise CaseFailure("a needle that is inserted is solved in a plane section, in a round scene only")
    tool = tool_of(case) if case.way.is_found else None
    degree, conditions = case.mesh.degree, conditions_of(case)
    if tool is not None and spaces.body.is_halved:  # the second jaw is the image of the tool
        tool, conditions = replace(tool, beds=()), replace(conditions, beds=())
    loads, shape = imaged_loads_of(case), None
    if loads is not None and spaces.body.imaged is None:
        shape = unload(spaces.body, degree, conditions, case.way.element, law_of(case), loads)
        spaces = Spaces(shape.body)
    try:
        return QuasiStaticProblem(
            spaces, degree, conditions, case.way.element, tool=tool, reuse=reuse, condense=condense, shape=shape
        )
    except Exception:
        if shape is not None:
            spaces.close()
            show_image(shape.body)
        raise


def memory_of(case: Case, dofs: int) -> tuple[float, float]:
    """Return the estimated bytes of a solve of ``case`` with ``dofs`` unknowns, and of its error bar."""
    degree, direct = case.mesh.degree, is_direct(case.solve.method, dofs, DIRECT_LIMIT[case.mesh.degree])
    free = is_matrix_free(case)
    solving = estimate.solving_memory(dofs, degree, case.way, direct=direct, matrix_free=free)
    return solving, estimate.error_bar_memory(dofs, degree, case.way, matrix_free=free)


def memory_of_basis(case: Case, dofs: int) -> float:
    """Return the estimated bytes of a reduced basis with one solve; error bars without memory are left out."""
    solving, _ = memory_of(case, dofs)
    return solving + estimate.basis_memory(dofs, case.mesh.degree)


def meridian_problem(case: Case, goal: float | None = None) -> Problem:
    """Return the problem of an axisymmetric ``case`` without loads, on its meridian.

    It is as accurate as the ``goal`` needs, a relative error of F; without one, as it can be.
    """
    if crack := case.probe.crack:
        return NeedleSolver(crack.radius, crack.toughness, ring_cuts if crack.is_ring else plane_cuts)
    half_plane = replace(meridian_of(case), fields=half_plane_fields(case))
    how = how_for(goal)
    # Half of the accuracy is left to time steps.
    of_steps = {"accuracy": how["accuracy"] / (2 if case.way.in_time else 1)} if how else {}
    match case.way.is_found, case.way.has_steps:
        case True, True:
            return LargeMeridianContact(half_plane, round_tool_of(case), **of_steps)
        case True, False:
            return MeridianContact(half_plane, round_tool_of(case), **how)
        case False, True:
            return LargeMeridian(half_plane, conditions_of(case), **of_steps)
    return MeridianProblem(half_plane, conditions_of(case), **how)


def conditions_of(case: Case) -> Conditions:
    """Return the boundary conditions by the probe of ``case``."""
    front, tip = _fronts_of(case)
    bonded, is_found = case.way.constraint is Constraint.BONDED, case.way.is_found
    return Conditions(
        bonded=bonded,
        unilateral=is_found,
        front=front,
        tip=tip,
        terms=terms_of(case),
        variation=variation_of(case),
        beds=beds_on(case),
        deforms=case.probe.elastic is not None,
    )


def _fronts_of(case: Case) -> tuple[Front | None, Front | None]:
    """Return the front of the slit of ``case``, and the tip of a frictionless blade in it."""
    slit, frame = case.probe.slit, case.frame.upright
    if slit is None:
        return None, None
    front = Front(frame.point, frame.along, slit.depth, slit.reach, _CLEAR * slit.room(case.body))
    if case.way.constraint is Constraint.BONDED:
        return front, None
    return front, Front(frame.point, frame.along, slit.tip, slit.length / 2, _CLEAR * slit.room_at_tip(case.body))


def round_tool_of(case: Case) -> RoundTool:
    """Return the tool of an axisymmetric ``case`` with unilateral contact.

    Raises:
        CaseFailure: if the scene is not axisymmetric.
    """
    probe, body = case.probe, case.body.half_plane()
    section = probe.revolved
    if body is None or section is None:
        raise CaseFailure("the scene is not axisymmetric")

    def gap(radii: FloatArray) -> FloatArray:
        return np.asarray(probe.profile(np.column_stack([radii, np.zeros_like(radii)])) + body.fall(radii))

    def distance(points: FloatArray, depth: float) -> Distance:
        assert isinstance(probe, Indenter)
        return probe.distance(points + np.array([0.0, 0.0, depth]))

    if section.is_flat:
        return RoundTool(gap, section.limit, friction=probe.friction)
    # On a curved body, contact may end below the flat face.
    flat = 0.0 if body.is_curved else section.flat
    return RoundTool(gap, section.limit, section.kinks, distance, flat, probe.friction)


def movement_of(case: Case, meshed: Case | None = None) -> Movement:
    """Return the probe's movement and the loads of ``case``, on the mesh turned so that the probe presses along -z.

    ``meshed`` is the case of the mesh, if it differs: a half ball at another place.
    """
    return replace(_motions_of(case, meshed or case), loads=loads_of(case), pull=pull_of(case))


def _motions_of(case: Case, meshed: Case) -> Movement:
    frame = case.frame.upright
    travel = case.probe.travel(frame)
    motion, slit = case.way.motion, case.probe.slit
    if motion is Motion.SIX:
        return Movement.all(travel, frame.point)
    if slit:
        # Tissue slides along frictionless flanks, so only their opening is prescribed.
        pressed = Movement.along(travel) if case.way.constraint is Constraint.BONDED else Movement((), ())
        return pressed.opened(case.frame.upright.across, slit.width / 2)
    if motion is Motion.FAR:
        return Movement.along(travel).with_far(_moved(far_field_of(case), meshed.frame.point))
    # Across a plane of symmetry, sliding gives no axial force, and pressing gives no lateral force.
    return Movement.along(travel, decoupled=slides_across(case))


@lru_cache(_FAR_FIELDS)
def _moved(far: PointForce | BodyField, centre: Place) -> FarField:
    """Return the far field at another centre; cached, because the object caches its values."""
    return far.moved(centre)


def law_of(case: Case, *, in_body: bool = False) -> MaterialLaw:
    """Return laws and parameters of the body's regions; with their relaxation where time steps need it.

    Directions are those on the mesh, which is turned so that the probe presses along -z, or ``in_body`` coordinates.
    """
    within = [_parameters(tissue, None if in_body else case.frame.turn) for tissue in case.tissues]
    beyond = [Parameters.of_moduli(each.young, each.poisson) for each in case.tissues if case.is_linear_beyond]
    found = (*within, *beyond)
    if case.way.in_time:
        terms = case.relaxations * (2 if beyond else 1)
        found = tuple(replace(each, relaxation=own) for each, own in zip(found, terms, strict=True))
    return MaterialLaw(found)


def course_of(case: Case, goal: float | None = None) -> Course | None:
    """Return the movement of ``case`` over time, as shares of that to its depth; None if it needs no time steps.

    With a ``goal``, the largest force is wanted to this accuracy.
    """
    history = case.probe.history
    if history is None or not case.way.in_time:
        return None
    motion, times, depth = history.motion(case.probe.depth), history.times(), case.probe.depth
    breaks = np.flatnonzero(np.isin(times, [canonical(time) for time in motion.times]))
    return Course(
        tuple(times.tolist()),
        tuple((motion.at(times) / depth).tolist()),
        frozenset(breaks.tolist()),
        share_at=lambda times: motion.at(times) / depth,
        accuracy=inf if goal is None else goal,
    )


def _parameters(tissue: Tissue, turn: FloatArray | None) -> Parameters:
    """Return the parameters of a tissue; the direction of fibres is that on the mesh, which ``turn`` rotates."""
    further = tissue.further
    if turn is not None and FIBRE[0] in further:
        direction = turn @ np.array([further[name] for name in FIBRE])
        further |= dict(zip(FIBRE, map(float, direction), strict=True))
    return Parameters.of_moduli(tissue.young, tissue.poisson, tissue.law or "linear", further)


def solve_problem(
    case: Case,
    problem: Problem,
    *,
    estimate: bool,
    meshed: Case | None = None,
    keep: bool = False,
    goal: float | None = None,
    influence: bool = False,
) -> Solution:
    """Solve a case; a small system is solved directly if iterations do not converge. Collective.

    ``meshed`` is the case of the mesh, if it differs: see ``movement_of``. ``keep`` and ``influence``, which the
    case may ask for, too: see :class:`Request`. ``goal`` is the accuracy for which time steps are chosen.

    Raises:
        SolveError: if this fails, too, or if the solution is impossible.
    """
    law, movement = law_of(case), movement_of(case, meshed)
    asked = Request(law, movement, case.solve.method, case.solve.energy_tolerance, estimate, course_of(case, goal))
    influence = influence or case.solve.influence
    asked = replace(asked, keep=keep or influence or bool(case.outputs), influence=influence)
    try:
        solution = problem.answer(asked)
    except (ContactError, LargeError):
        raise
    except SolveError:
        if asked.method != "auto" or not law.is_linear or not 0 < problem.dofs <= _MOST_DIRECT:
            raise
        solution = problem.answer(replace(asked, method="direct"))
    if movement.far is not None:
        solution.times.setup += far_field_seconds(case)
    if solution.is_shut:
        cause = "the blade's travel presses" if movement.loads is None else "the blade's travel and the loads press"
        raise SolveError(f"{cause} the slit shut at its front, where its faces would pass each other")
    return solution


def check_memory(available: float, needed: float, what: str, case: Case | None = None) -> None:
    """Fail the case if it needs more memory than what is ``available`` (bytes).

    Raises:
        CaseFailure: if so, with the layer or region that makes most of the mesh of ``case``.
    """
    if message := lacks_memory(available, needed, what):
        thin = f". {found}" if case is not None and (found := cause(case)) else ""
        raise CaseFailure(f"{message}: use larger elements, or a smaller epsilon{thin}")


def lacks_memory(available: float, needed: float, what: str) -> str:
    """Return a message if ``needed`` bytes are too much of those ``available``, else ""."""
    if needed <= MEMORY_SHARE * available:
        return ""
    there = f"{_gigabytes(available)} GB are available, and a case may use {100 * MEMORY_SHARE:.0f} % of them"
    return f"{what} needs about {_gigabytes(needed)} GB of memory; {there}"


def _gigabytes(size: float) -> str:
    """Return bytes in GB, to two digits if few, because needed and available memory may be close."""
    return f"{size / 1e9:.2f}" if size < 1e9 else f"{size / 1e9:,.1f}"
