"""What solves a case on its mesh, if the memory is there for it."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.mesh.of_case import meridian_of
from pipeline.plan import estimate
from pipeline.plan.symmetry import mirror_planes, movement_planes
from pipeline.run.far_field import far_field_of, far_field_seconds
from pipeline.run.loads import loads_of
from pipeline.run.memory import FreeMemory
from pipeline.run.room import MEMORY_SHARE
from pipeline.shapes.contact import first_touch
from pipeline.shapes.probes._round import RoundIndenter
from pipeline.solve import SolveError
from pipeline.solve.conditions import Conditions, Front
from pipeline.solve.contact.active_set import ContactError
from pipeline.solve.contact.search import Tool
from pipeline.solve.far_field import BodyField, PointForce
from pipeline.solve.krylov import DIRECT_LIMIT, is_direct
from pipeline.solve.meridian.contact import MeridianContact
from pipeline.solve.meridian.problem import MeridianProblem
from pipeline.solve.meridian.punch import RoundTool
from pipeline.solve.movement import FarField, Movement, Place
from pipeline.solve.physics import MaterialLaw, Parameters
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.solution import Problem, Request, Solution
from pipeline.solve.spaces import Spaces
from pipeline.study.sweep import Case

# Unknowns up to which a direct solve is a way out where iterations do not converge.
_MOST_DIRECT = 100_000
_FAR_FIELDS = 1_000  # that are remembered, of some kilobytes each
# What is virtually moved round a slit's front is this near to it, in units of the distance to anything else.
_CLEAR = 0.7


class CaseFailure(Exception):
    """A case cannot be computed, for a reason that all ranks have agreed on."""


def problem_of(spaces: Spaces, case: Case, *, reuse: bool = False, condense: bool = False) -> QuasiStaticProblem:
    """Return what solves cases in the spaces of the mesh of ``case``, by the elements that suit it; collective.

    ``case`` is the one that the mesh was made for: the tool is there. ``condense`` says that many depths are to come.
    """
    tool = tool_of(case) if case.probe.is_unilateral else None
    degree, conditions = case.mesh.degree, conditions_of(case)
    return QuasiStaticProblem(spaces, degree, conditions, case.element, tool=tool, reuse=reuse, condense=condense)


def memory_of(case: Case, dofs: int) -> tuple[float, float]:
    """Return the bytes that a solve of ``case`` with so many ``dofs`` takes, and its error bar."""
    degree, direct = case.mesh.degree, is_direct(case.solve.method, dofs, DIRECT_LIMIT[case.mesh.degree])
    return (
        estimate.solving_memory(dofs, degree, case.formulation, direct=direct),
        estimate.enriched_memory(dofs, degree, case.formulation),
    )


def memory_of_basis(case: Case, dofs: int) -> float:
    """Return the bytes that a reduced basis takes, with a solve of it; bars that have no room are left out."""
    solving, _ = memory_of(case, dofs)
    return solving + estimate.basis_memory(dofs, case.mesh.degree)


def meridian_problem(case: Case) -> Problem:
    """Return what solves a round ``case``, which no loads act on, on its meridian."""
    if case.probe.is_unilateral:
        return MeridianContact(meridian_of(case), round_tool_of(case))
    return MeridianProblem(meridian_of(case), conditions_of(case))


def conditions_of(case: Case) -> Conditions:
    """Return what the probe of ``case`` prescribes."""
    front, tip = _fronts_of(case)
    return Conditions(bonded=case.probe.contact == "bonded", unilateral=case.probe.is_unilateral, front=front, tip=tip)


def tool_of(case: Case) -> Tool:
    """Return the surface of the probe of ``case``, on the mesh that is turned so that it presses along -z."""
    probe, frame = case.probe, case.frame.upright

    def height(points: FloatArray) -> FloatArray:
        local = frame.local(points)
        # All of a flat tool's footprint is below its face, whatever rounding has made of the nodes on the edge.
        return (0.0 if probe.has_singular_edge else probe.profile(local[:, :2])) - local[:, 2]

    *_, first = first_touch(case.body, probe, case.frame)
    return Tool(height, lambda points: probe.ends_at(frame.local(points)[:, :2]), first)


def _fronts_of(case: Case) -> tuple[Front | None, Front | None]:
    """Return the front of the slit that the probe of ``case`` stands in, and the tip of a blade that slides there."""
    slit, frame = case.probe.slit, case.frame.upright
    if slit is None:
        return None, None
    front = Front(frame.point, frame.along, slit.depth, slit.reach, _CLEAR * slit.room(case.body))
    if case.probe.contact == "bonded":
        return front, None
    return front, Front(frame.point, frame.along, slit.tip, slit.length / 2, _CLEAR * slit.room_at_tip(case.body))


def round_tool_of(case: Case) -> RoundTool:
    """Return the round tool of ``case`` above the body that it touches: where contact is unilateral on a meridian.

    Raises:
        CaseFailure: if the scene is not round.
    """
    probe, body = case.probe, case.body.half_plane()
    if body is None or not probe.is_round:
        raise CaseFailure("only round scenes have a meridian")

    def gap(radii: FloatArray) -> FloatArray:
        return np.asarray(probe.profile(np.column_stack([radii, np.zeros_like(radii)])) + body.fall(radii))

    if isinstance(probe, RoundIndenter):
        return RoundTool(gap, probe.limit, probe.kinks)
    return RoundTool(gap, probe.circumradius)


def movement_of(case: Case, meshed: Case | None = None) -> Movement:
    """Return how the probe of ``case`` moves, and what loads act, on the mesh turned so that it presses along -z.

    ``meshed`` is the case that the mesh was made for, if that is another: a half ball elsewhere on the body.
    """
    return replace(_motions_of(case, meshed or case), loads=loads_of(case))


def _motions_of(case: Case, meshed: Case) -> Movement:
    frame = case.frame.upright
    travel = case.probe.travel(frame)
    if case.probe.motion == "all":
        return Movement.all(travel, frame.point)
    if slit := case.probe.slit:
        # Along flanks that it slides on, tissue does not go with the blade.
        pressed = Movement.along(travel) if case.probe.contact == "bonded" else Movement((), ())
        return pressed.opened(case.frame.upright.across, slit.width / 2)
    if case.is_closed:
        return Movement.along(travel).with_far(_moved(far_field_of(case), meshed.frame.point))
    # Across a plane of symmetry a probe slides without force along its axis, and presses without force along itself.
    return Movement.along(travel, apart=mirror_planes(case) != movement_planes(case))


@lru_cache(_FAR_FIELDS)
def _moved(far: PointForce | BodyField, centre: Place) -> FarField:
    """Return the same for the same: what is computed for a far field is kept by it."""
    return far.moved(centre)


def law_of(case: Case) -> MaterialLaw:
    """Return what the regions of the body of ``case`` are made of."""
    parameters = tuple(Parameters.of_moduli(tissue.young, tissue.poisson) for tissue in case.tissues)
    return MaterialLaw(parameters, case.material.law)


def solve_problem(case: Case, problem: Problem, *, estimate: bool, meshed: Case | None = None) -> Solution:
    """Solve a case; where iterations do not converge and the system is small, directly. Collective.

    ``meshed`` is the case that the mesh was made for, if that is another: see ``movement_of``.

    Raises:
        SolveError: if that fails, too, or what is found cannot be.
    """
    law, movement = law_of(case), movement_of(case, meshed)
    asked = Request(law, movement, case.solve.method, case.solve.energy_tolerance, estimate)
    try:
        solution = problem.answer(asked)
    except ContactError:
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


def check_memory(free: FreeMemory, needed: float, what: str) -> None:
    """Refuse what needs more bytes of memory than there are; collective.

    Raises:
        CaseFailure: on every rank.
    """
    if message := lacks_memory(free, needed, what):
        raise CaseFailure(f"{message}: use larger elements, or a smaller epsilon")


def lacks_memory(free: FreeMemory, needed: float, what: str) -> str:
    """Return what to say if ``needed`` bytes are too much, the same on every rank; collective."""
    available = free.available()
    if needed <= MEMORY_SHARE * available:
        return ""
    there = f"{_gigabytes(available)} GB are available, of which {100 * MEMORY_SHARE:.0f} % may be taken"
    return f"{what} needs about {_gigabytes(needed)} GB of memory, {there}"


def _gigabytes(size: float) -> str:
    """Return bytes in GB, to a hundredth where they are few: what is needed and what is there may be close."""
    return f"{size / 1e9:.2f}" if size < 1e9 else f"{size / 1e9:,.1f}"
