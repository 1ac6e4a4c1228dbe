"""From solutions to records: the force along the probe's axis, its error bar, and what it cost."""

from dataclasses import replace
from math import hypot, isnan, nan
from typing import Any

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.plan.cost import features
from pipeline.plan.recipe import half_width_of
from pipeline.plan.steps import Solve
from pipeline.run.record import Record
from pipeline.shapes.body import Layered
from pipeline.shapes.contact import first_touch
from pipeline.shapes.frame import Vector
from pipeline.shapes.indenter import Indenter
from pipeline.solve.estimate import is_graded
from pipeline.solve.response import Contact
from pipeline.solve.solution import Solution
from pipeline.study.sweep import Case

_ROUNDING = 1e-9
# Contact is no longer where the mesh is graded to if it begins farther from the axis, in units of its half width.
_BESIDE = 0.1
BARS = (
    "force_error",
    "force_vector_error",
    "stiffness_error",
    "energy_release_error",
    "load_force_error",
    "contact_area_error",
    "contact_radius_error",
)
TIMES = ("time_mesh", "time_assemble", "time_setup", "time_solve")


def record_of(solve: Solve, solution: Solution, mesh_seconds: float = 0.0) -> Record:
    """Return the record of a solution, on the part of the body that was modelled.

    Where an accuracy is asked for, F is what the elements of one degree more, and the rest of the sequence, make of
    it; otherwise it is that of the elements that the study declares. A meridian's is its best as it is.
    """
    case = solve.case
    kind, planned_cells, poisson = features(solve)
    if solve.goal is not None and not solve.axisymmetric:
        solution = solution.extrapolated(
            case.mesh.degree, case.element, graded=is_graded_to_contact(case), elsewhere=not case.is_plain
        )
    # It was solved with the probe pressing along -z; the record is in the coordinates of the body.
    turn, force, bar = case.frame.turn, solution.reaction[2], solution.reaction_bars[2]
    return Record(
        key=solve.key,
        status="ok",
        origin="axisymmetric" if solve.axisymmetric else "symmetric" if solve.mirrors else "solved",
        young=case.scale.stress,
        depth=case.scale.length,
        force=force,
        force_error=bar / abs(force),
        force_vector=turned_back(turn, _known_of(case, solution.reaction)),
        force_vector_error=_vector_bars(solution, turn),
        stiffness=_rows(solution.stiffness, turn) if case.probe.motion == "all" else (),
        stiffness_error=_rows(solution.bars, turn, bars=True) if case.probe.motion == "all" else (),
        energy=solution.energy,
        energy_release=solution.release / _front_length(case) if case.probe.slit else nan,
        energy_release_error=solution.release_bar,
        largest=solution.largest,
        **_of_contact(solution.contact),
        **_of_loads(case, solution),
        balance=solution.balance,
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


def _of_contact(contact: Contact | None) -> dict[str, Any]:
    """Return what a record holds of contact that was found, nothing where it was prescribed."""
    if contact is None:
        return {}
    bars = {"contact_area_error": contact.bar, "contact_radius_error": contact.bar / 2}
    return {"contact_area": contact.area, "contact_radius": contact.radius, **bars}


def _of_loads(case: Case, solution: Solution) -> dict[str, Any]:
    """Return what a record holds of loads, nothing where there are none."""
    loaded, contact = solution.load_response, solution.contact
    if contact and not isnan(contact.sag):  # loads bend the surface, and the depth counts from the first touch
        none = (0.0, 0.0, 0.0)
        touching = {"load_force": 0.0, "load_force_error": 0.0, "load_force_vector": none}
        return touching | {"load_energy": contact.load_energy, "sag": contact.sag}
    if loaded is None:
        return {}
    force, axis = solution.load_force, (0.0, 0.0, -1.0)
    return {
        "load_force": force[2],
        "load_force_error": solution.load_force_bar,
        "load_force_vector": turned_back(case.frame.turn, _known_of(case, force)),
        "load_energy": loaded.energy,
        # Where the probe bears no force along its axis: held at a depth d it bears k d + load_force.
        "sag": -force[2] / loaded.stiffness_along(axis),
    }


def _known_of(case: Case, force: Vector) -> Vector:
    """Return a ``force`` (N) on the probe, not a number where it is not known and no symmetry makes it nought.

    A far field of the force along the axis tells that alone. Along a blade on which tissue slides, what pushes on its
    two ends is not looked at.
    """
    x, y, z = force
    if case.is_closed and case.probe.contact == "bonded":
        return x and nan, y and nan, z
    if case.probe.slit and case.probe.contact != "bonded":
        along = case.frame.upright.along
        return (x and nan, y, z) if abs(along[0]) > abs(along[1]) else (x, y and nan, z)
    return x, y, z


def is_graded_to_contact(case: Case) -> bool:
    """Tell whether the mesh of ``case`` is graded to where contact ends, or is expected to."""
    rim = case.mesh.rim_size(case.probe.half_width) / half_width_of(case)
    # The coarsest recipe is that of the limit itself, in the same units: no rounding may put it beyond.
    rim *= 1 - _ROUNDING if isinstance(case.probe, Indenter) else 1.0
    if case.probe.is_unilateral:  # small elements are round the axis: contact is to be there
        *beside, _ = first_touch(case.body, case.probe, case.frame)
        if hypot(*beside) > _BESIDE * half_width_of(case):
            return False
    return is_graded(rim, case.mesh.growth)


def _front_length(case: Case) -> float:
    """Return the length (m) of the front of the slit that the probe stands in."""
    slit = case.probe.slit
    assert slit is not None
    if not slit.is_open:
        return 2 * slit.reach
    assert isinstance(case.body, Layered)
    (x, y, _), along = case.frame.point, case.frame.along
    return sum(min(case.column, case.body.to_side((x, y), (i * along[0], i * along[1]))) for i in (-1, 1))


def turned_back(turn: FloatArray | None, vector: Vector) -> Vector:
    """Return a vector of the turned mesh in the body's coordinates: the rows of ``turn`` are the axes it was put on."""
    if turn is None:
        return vector
    x, y, z = map(float, np.array(vector) @ turn)
    return x, y, z


def _vector_bars(solution: Solution, turn: FloatArray | None) -> Vector:
    """Return the bars (N) on the components of the force; what symmetry makes zero is known to be.

    Turned, those of a component are the sum of what all that it is made of may be off by.
    """
    x, y, z = (0.0 if f == 0 else bar for f, bar in zip(solution.reaction, solution.reaction_bars, strict=True))
    return turned_back(None if turn is None else np.abs(turn), (x, y, z))


def _rows(matrix: FloatArray | None, turn: FloatArray | None, *, bars: bool = False) -> tuple[tuple[float, ...], ...]:
    """Return a matrix (6, 6) of forces and torques for all motions, or the bars on it, in the body's coordinates."""
    if matrix is None:
        return ()
    if turn is not None:
        both = np.kron(np.eye(2), np.abs(turn) if bars else turn)
        matrix = both.T @ matrix @ both
    return tuple(tuple(map(float, row)) for row in matrix)


def add_times(record: Record, earlier: list[Record]) -> Record:
    """Return ``record`` with all the time that its goal took: error bars are part of the work, and earlier tries."""
    sums = {name: sum(getattr(r, name) for r in [*earlier, record]) for name in TIMES}
    sums["time_solve"] += sum(r.time_error for r in [*earlier, record])
    return replace(record, **sums, time_error=0.0)
