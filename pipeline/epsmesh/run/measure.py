"""From solutions to records: the force along the probe's axis, its error bar, its costs."""

from dataclasses import replace
from math import hypot, isnan, nan, pi
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.plan.cost import features
from epsmesh.plan.recipe import (
    has_flat,
    has_sure_contact,
    has_sure_limit,
    is_ball,
    is_closed,
    is_sure_opposite,
    is_thin,
)
from epsmesh.plan.refinement import is_refined
from epsmesh.plan.steps import Solve
from epsmesh.run.record import Record
from epsmesh.run.tools import beds_on, normal_of
from epsmesh.scene.model import JAW, LOOSE
from epsmesh.shapes.body import Layered
from epsmesh.shapes.contact import first_touch
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.grasp import MIDDLE
from epsmesh.shapes.probe import Probe
from epsmesh.solve.contact_result import ContactResult, PullResult, RestResult
from epsmesh.solve.convergence import Convergence
from epsmesh.solve.estimate import is_fine, is_graded, unresolved
from epsmesh.solve.history import History
from epsmesh.solve.solution import Solution
from epsmesh.states import OK
from epsmesh.study.case import Case
from epsmesh.study.way import Constraint, Motion

_ROUNDING = 1e-9
# The mesh is graded to the axis. If first contact is farther away, in units of the half width, it is not graded to it.
_BESIDE = 0.1
_OF_FRICTION = ("slip_area", "friction_force", "torque")
# Edges of elements at a rim, in units of the size asked for, at most; the share of a circle's area beyond quadratic
# edges, for the fourth power of their angle: 1/480.
_LONGEST_EDGE, _OF_EDGE = 1.7, 1 / 480
# What loads add to a force that counts from the first touch of the surface as they leave it.
_NOT_PRESSED = {"load_force": 0.0, "load_force_error": 0.0, "load_force_vector": (0.0, 0.0, 0.0)}
TIMES = ("time_mesh", "time_assemble", "time_setup", "time_solve")


def record_of(solve: Solve, solution: Solution, mesh_seconds: float = 0.0) -> Record:
    """Return the record of a solution, which is on the modelled part of the body.

    With an accuracy, F is extrapolated with the elements of one degree more; without one, F is that of the study's
    elements. A meridian's F is already its best.
    """
    case = solve.case
    kind, planned_cells, poisson = features(solve)
    if solve.goal is not None and not solve.axisymmetric:
        solution = solution.extrapolated(convergence_of(solve))
    solution = solution.with_least_bar(least_bar(solve))
    # The solution is in the frame where the probe presses along -z; the record is in the body's coordinates.
    turn, force, bar = case.frame.turn, solution.reaction[2], solution.reaction_bars[2]
    return Record(
        key=solve.key,
        status=OK,
        origin="axisymmetric" if solve.axisymmetric else "symmetric" if solve.mirrors else "solved",
        young=case.scale.stress,
        depth=case.scale.length,
        force=force,
        force_error=bar / abs(force),
        friction_error=0.0 if solution.contact is None else solution.contact.friction_bar,
        force_vector=turned_back(turn, _known_of(case, solution.reaction)),
        force_vector_error=_vector_bars(case, solution),
        stiffness=_rows(solution.stiffness, turn) if case.way.motion is Motion.SIX else (),
        stiffness_error=_rows(solution.bars, turn, bars=True) if case.way.motion is Motion.SIX else (),
        energy=solution.energy,
        energy_release=solution.release / _front_length(case) if case.way.motion is Motion.SLIT else nan,
        energy_release_error=solution.release_bar,
        largest=solution.largest | _of_others(case, solution, bar / abs(force)),
        **_of_contact(solution.contact, has_history=solution.history is not None),
        **_of_loads(case, solution),
        balance=solution.balance,
        course=_course(case, solution.history),
        dofs=solution.dofs,
        cells=solution.cells * 2 ** len(solve.mirrors),
        iterations=solution.iterations,
        time_mesh=mesh_seconds + solution.times.mesh,
        time_assemble=solution.times.assemble,
        time_setup=solution.times.setup,
        time_solve=solution.times.solve,
        time_error=solution.times.error,
        kind=kind,
        planned_cells=planned_cells,
        poisson=poisson,
    )


def convergence_of(solve: Solve) -> Convergence:
    """Return what the case and the mesh of a solve say of how F converges with the degree."""
    case = solve.case
    # Refined meshes have larger elements away from the edge: F has more of the errors of other places.
    is_plain = case.is_plain and not is_refined(solve.meshed_case)
    return Convergence(
        degree=case.mesh.degree,
        element=case.way.element,
        is_graded=is_graded_to_contact(case),
        is_fine=is_plain and has_sure_limit(case) and is_fine(_rim(case), case.mesh.growth),
        has_others=not is_plain or (case.body.resting is not None and not is_sure_opposite(case)),
        is_nonlinear=case.way.is_nonlinear,
        is_ball=is_ball(case),
        is_linear=not case.way.is_large,
        is_flat=has_flat(case),
        is_closed=MIDDLE in solve.mirrors or is_closed(case),
    )


def _course(case: Case, history: History | None) -> dict[str, tuple[float, ...]]:
    """Return what a case does over time, by the names of ``COURSE``; nothing for a case without time steps."""
    if history is None:
        return {}
    vectors = [turned_back(case.frame.turn, _known_of(case, (x, y, z))) for x, y, z in history.forces.tolist()]
    found: dict[str, Any] = {
        "time": history.times,
        "force": history.forces[:, 2],
        "step_error": history.bars,
        **dict(zip("xyz", np.array(vectors).T, strict=True)),
        "dissipated": history.dissipated,
        "dissipated_error": np.abs(history.imbalance),
    }
    if case.way.is_found:
        found["area"] = history.areas
    return {name: tuple(map(float, values)) for name, values in found.items()}


def _of_contact(contact: ContactResult | None, *, has_history: bool) -> dict[str, Any]:
    """Return the fields of a record for unilateral contact, none for a prescribed footprint.

    Those of friction depend on the path, and are missing ``has_history``.
    """
    if contact is None:
        return {}
    found = {name: nan if has_history else getattr(contact, name) for name in _OF_FRICTION}
    found |= {f"{name}_error": nan if has_history else getattr(contact, f"{name}_bar") for name in _OF_FRICTION}
    found |= {"contact_area": contact.area, "contact_area_error": contact.bar}
    return found | {"contact_radius": contact.radius, "contact_radius_error": contact.bar / 2}


def _of_others(case: Case, solution: Solution, bar: float) -> dict[str, float]:
    """Return what a record has of what touches the body besides the tool; ``bar`` is the relative one on the force."""
    if (contact := solution.contact) is None:
        return {}
    found = _of_pull(contact.pull, bar)
    if case.probe.elastic:
        found |= {"tool_shortening": contact.shortening, "tool_shortening_error": contact.shortening_bar}
    for name, rest in zip(beds_on(case), contact.rests, strict=True):
        if name == JAW:
            found |= _of_jaw(case, rest)
        elif name == LOOSE:
            found |= _of_tissue(case, rest)
        else:
            found |= _of_support(rest, solution.reaction_bars)
    return found


def _of_tissue(case: Case, rest: RestResult) -> dict[str, float]:
    """Return what a record has of the tissue that loose tissue touches, by the names in the dataset."""
    found = {"interface_force": rest.pressed, "interface_force_error": rest.force_bar * abs(rest.pressed)}
    found |= {"lift_off_area": rest.lifted, "lift_off_area_error": rest.bar * rest.area}
    return found | {"interface_area": rest.area + rest.lifted} | _by_axis("interface_force_vector", case, rest.force)


def _of_jaw(case: Case, rest: RestResult) -> dict[str, float]:
    """Return what a record has of a second jaw, by the names in the dataset: forces are those of the tissue on it."""
    x, y, z = rest.force
    return {
        "jaw_force": rest.pressed,
        "jaw_force_error": rest.force_bar * abs(rest.pressed),
        "jaw_contact_area": rest.area,
        "jaw_contact_area_error": rest.bar * rest.area,
        "jaw_torque": rest.torque,
        "jaw_torque_error": rest.torque_bar,
        **_by_axis("jaw_force_vector", case, (0.0 - x, 0.0 - y, 0.0 - z)),
    }


def _by_axis(name: str, case: Case, vector: Vector) -> dict[str, float]:
    """Return a ``vector`` of the turned mesh by its components in the body's coordinates."""
    return {f"{name}_{axis}": part for axis, part in zip("xyz", turned_back(case.frame.turn, vector), strict=True)}


def _of_pull(pull: PullResult | None, bar: float) -> dict[str, float]:
    """Return what a record has of jaws that are pulled, by the names in the dataset: NaN without slip.

    ``bar`` is the relative one on forces along the axis.
    """
    if pull is None:
        return {}
    first, second = pull.forces
    found = {"pull_work": pull.work, "friction_work": pull.heat, "pull_energy": pull.stored}
    found |= {"closed_force": pull.closed, "closed_force_error": bar * abs(pull.closed)}
    for name, force in (("pull_force", first), ("jaw_pull_force", second)):
        found |= {name: force, f"{name}_error": pull.bar * abs(force)}
    for name, slip in (("slip_begins", pull.begins), ("slip_whole", pull.whole)):
        parts = (nan,) * 4 if slip is None else (slip.at, slip.at_bar, slip.force, slip.force_bar)
        names = (name, f"{name}_error", f"{name}_force", f"{name}_force_error")
        found |= dict(zip(names, parts, strict=True))
    return found


def _of_support(rest: RestResult, bars: Vector) -> dict[str, float]:
    """Return what a record has of a support that lets go, by the names in the dataset.

    Its force differs from that of the tool by the weight of the body, and has the same error: ``bars`` (3), N. Across
    the axis of a tool, which is inclined to the support, a bar that is missing is that along it.
    """
    across = zip(rest.normal, rest.force, [bars[2] if isnan(bar) else bar for bar in bars], strict=True)
    parts = [(n * f, abs(n) * bar) for n, f, bar in across if abs(n) > _ROUNDING]
    return {
        "support_force": sum(force for force, _ in parts),
        "support_force_error": sum(bar for _, bar in parts),
        "lift_off_area": rest.lifted,
        "lift_off_area_error": rest.bar * rest.area,
        "support_slip": rest.slip,
        "support_slip_error": rest.slip_bar,
    }


def _of_loads(case: Case, solution: Solution) -> dict[str, Any]:
    """Return the fields of a record for loads, none without loads."""
    loaded, contact, history = solution.load_response, solution.contact, solution.history
    if history is not None:  # in tissue that has crept
        loads = {"load_energy": history.load_energy, "sag": history.sag}
        return loads if contact is None or isnan(history.sag) else {**_NOT_PRESSED, **loads}
    if contact and not isnan(contact.sag):  # loads bend the surface, and the depth counts from the first touch
        return _NOT_PRESSED | {"load_energy": contact.load_energy, "sag": contact.sag}
    if loaded is None:
        return {}
    force, axis = solution.load_force, (0.0, 0.0, -1.0)
    return {
        "load_force": force[2],
        "load_force_error": max(solution.load_force_bar, _of_edge(case) * abs(force[2])),
        "load_force_vector": turned_back(case.frame.turn, _known_of(case, force)),
        "load_energy": loaded.energy,
        # With a linear law the axial force at depth d is k d + load_force; at the sag it is zero.
        "sag": loaded.sag if loaded.sag is not None else -force[2] / loaded.stiffness_along(axis),
    }


def _of_edge(case: Case) -> float:
    """Return how much of a round footprint's area a mesh may lack, relative: what no change of degree shows.

    An incompressible body below the same pressure all around has no other error.
    """
    angle = min(_LONGEST_EDGE * case.mesh.rim_size(case.probe.half_width) / case.probe.half_width, pi / 2)
    return _OF_EDGE * angle**4 if case.probe.is_round and case.mesh.degree > 1 else 0.0


def _known_of(case: Case, force: Vector) -> Vector:
    """Return a ``force`` (N) on the probe, with NaN for components that are neither computed nor zero by symmetry.

    The far field of an axial force gives no lateral force. Along a frictionless blade in a slit, the forces on its two
    ends are not computed.
    """
    x, y, z = force
    if case.way.motion is Motion.FAR and (case.way.constraint is Constraint.BONDED or case.way.rubs):
        return x and nan, y and nan, z
    if case.way.slides_in_slit:
        along = case.frame.upright.along
        return (x and nan, y, z) if abs(along[0]) > abs(along[1]) else (x, y and nan, z)
    return x, y, z


def is_graded_to_contact(case: Case) -> bool:
    """Return whether the mesh of ``case`` is graded to the expected edge of contact, and that is enough."""
    if case.way.is_found and is_ball(case) and not case.way.is_nonlinear and is_thin(case):
        return False
    # What Newton's method finds with a linear law needs smaller elements than at large displacements.
    sure = (has_sure_contact(case) or case.way.is_nonlinear) and case.mesh.degree == 2
    how = {"large": case.way.is_large, "sure": sure}
    for tool, expected, size in _rims(case):
        # The coarsest recipe equals the limit of `is_graded`: rounding must not exceed it.
        rim = size / expected.edge_width * (1 - _ROUNDING if not tool.is_flat else 1.0)
        if case.way.is_found:  # small elements surround the axis, so contact must be there
            *beside, _ = first_touch(case.body, tool, tool.frame_on(case.body))
            if hypot(*beside) > _BESIDE * expected.contact_width:
                return False
        if not is_graded(rim, case.mesh.growth, found=not tool.is_flat, **how):
            return False
    return True


def least_bar(solve: Solve) -> float:
    """Return the least relative bar on F: zero, but for contact that is found with elements larger than itself."""
    is_given = not solve.case.way.is_found or solve.axisymmetric
    return 0.0 if is_given else unresolved(size_at_contact(solve.case))


def size_at_contact(case: Case) -> float:
    """Return the size of elements at the edge of contact, in units of its expected half width; of jaws, the larger."""
    return max(size / expected.contact_width for _, expected, size in _rims(case))


def _rim(case: Case) -> float:
    """Return the size of elements at the edge of contact, in units of the width that they resolve; see above."""
    return max(size / expected.edge_width for _, expected, size in _rims(case))


def _rims(case: Case) -> list[tuple[Probe, Probe, float]]:
    """Return each jaw, or the tool: as it is, as its contact is expected to end, and the size (m) of elements there."""
    found = [(case.probe, case.expected, case.mesh.rim_size(case.probe.half_width))]
    if case.jaw is not None and (expected := case.expected_jaw) is not None:
        found.append((case.jaw, expected, case.mesh.jaw_rim_size(expected.half_width)))
    return found


def _front_length(case: Case) -> float:
    """Return the length (m) of the front of the probe's slit."""
    slit = case.probe.slit
    assert slit is not None
    if not slit.is_open:
        return 2 * slit.reach
    assert isinstance(case.body, Layered)
    (x, y, _), along = case.frame.point, case.frame.along
    return sum(min(case.column, case.body.to_side((x, y), (i * along[0], i * along[1]))) for i in (-1, 1))


def turned_back(turn: FloatArray | None, vector: Vector) -> Vector:
    """Return a vector of the turned mesh in the body's coordinates; the rows of ``turn`` are the mesh's axes."""
    if turn is None:
        return vector
    x, y, z = map(float, np.array(vector) @ turn)
    return x, y, z


def _vector_bars(case: Case, solution: Solution) -> Vector:
    """Return the error bars (N) of the force's components; 0 for components that are zero by symmetry.

    In turned coordinates, the bar of a component is the sum over its contributions. With a linear law, forces of
    frictionless contact have one direction. It is the surface's normal, or the axis, which may differ a bit from that.
    """
    turn, way = case.frame.turn, case.way
    x, y, z = (0.0 if f == 0 else bar for f, bar in zip(solution.reaction, solution.reaction_bars, strict=True))
    if way.is_found and not way.is_large:
        (a, b, c), size = normal_of(case), z if way.is_inclined else abs(solution.reaction[2])
        x, y = (0.0, 0.0) if way.is_inclined and not way.rubs else (x, y)
        x, y = x + size * abs(a / c), y + size * abs(b / c)
    return turned_back(None if turn is None else np.abs(turn), (x, y, z))


def _rows(matrix: FloatArray | None, turn: FloatArray | None, *, bars: bool = False) -> tuple[tuple[float, ...], ...]:
    """Return a stiffness matrix (6, 6), or its error bars, in the body's coordinates."""
    if matrix is None:
        return ()
    if turn is not None:
        both = np.kron(np.eye(2), np.abs(turn) if bars else turn)
        matrix = both.T @ matrix @ both
    return tuple(tuple(map(float, row)) for row in matrix)


def add_times(record: Record, earlier: list[Record]) -> Record:
    """Return ``record`` with the total time for its accuracy: with error bars and earlier attempts."""
    sums = {name: sum(getattr(r, name) for r in [*earlier, record]) for name in TIMES}
    sums["time_solve"] += sum(r.time_error for r in [*earlier, record])
    return replace(record, **sums, time_error=0.0)
