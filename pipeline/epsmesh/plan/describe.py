"""A plan in words and numbers: work to do, work skipped and why, time and memory."""

import heapq
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from epsmesh.plan.cost import speed_up
from epsmesh.plan.estimate import on_ranks
from epsmesh.plan.plan import Plan, first_attempts, of_unit_scene
from epsmesh.plan.proportional_depths import depth_key
from epsmesh.plan.schedule import schedule
from epsmesh.plan.steps import MeshStep, Solve
from epsmesh.printable import counted
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.scanned import Scanned
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.segment import Segment
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case
from epsmesh.study.way import Steps, Way

# Depth over half width at which tissue folds at the edge of a bonded punch, so that Newton's method stops; somewhat
# less on finer meshes.
_FOLDS = 0.3
_MAY_END = (
    "A case that does not reach its depth fails, and reports the depth that it reached; smaller depths of the same "
    "sweep keep their forces."
)


def summary(plan: Plan, ranks: int = 1) -> dict[str, Any]:
    """Return the plan as plain data: ``steps`` in the order of their start, with the ranks of each."""
    phases = schedule(plan.meshes, ranks, plan.cost, apart=plan.study.solve.timing)
    steps, seconds = [], 0.0
    for phase in phases:
        found = [plan.cost.step(step) for step in phase.steps]
        costs = [step.seconds / speed_up(phase.size) for step in found]
        seconds += _makespan(costs, ranks // phase.size)
        steps += [
            vars(s)
            | {
                "seconds": cost,
                "memory": on_ranks(s.memory, phase.size),
                "ranks": phase.size,
                "exact": all(solve.is_reference for solve in step.solves),
            }
            for step, s, cost in zip(phase.steps, found, costs, strict=True)
        ]
    return {
        "study": plan.study.file,
        "warnings": list(plan.study.warnings),
        "cases": len(plan.study),
        "meshes": len(steps),
        "systems": sum(step["operators"] for step in steps),
        "solves": len(plan.solves),
        "exact": sum(solve.is_reference for solve in plan.solves),
        "exact_unasked": _unasked(plan),
        "skipped": [{"name": s.name, "count": s.count, "reason": s.reason} for s in plan.skipped],
        "notes": _notes(plan),
        "seconds": seconds,
        "memory": max((step["memory"] for step in steps), default=0.0),
        "ranks": ranks,
        "fitted_to": plan.cost.count,
        "factor": plan.cost.error_for(plan.solves),
        "machine": plan.cost.machine if plan.cost.unknown(plan.solves) else 1.0,
        "steps": steps,
    }


def _notes(plan: Plan) -> list[str]:
    """Return notes on the place of a body from a file, and on the depths that large displacements reach."""
    return [*_of_place(plan.study.case((0,) * len(plan.study.axes))), *_of_large_displacements(plan)]


def _of_place(case: Case) -> list[str]:
    """Return the extent of a body from a file, and the point and direction of contact of its first case."""
    notes = []
    if isinstance(case.body, Scanned) and not case.no_contact:
        ends = zip("xyz", *case.body.triangles.bounds, strict=True)
        extent = ", ".join(f"{name} from {in_mm(low)} to {in_mm(high)}" for name, low, high in ends)
        point, axis = np.multiply(1e3, case.frame.point).round(2), np.round(case.frame.axis, 3)
        place, way = (f"({', '.join(f'{c:g}' for c in vector)})" for vector in (point, axis))
        notes.append(f"Body: {extent}. The first case touches it at {place} mm and advances along {way}.")
    if (pieces := case.body.embedded) and (notes or case.body.region):
        volumes = [piece.surface.volume for piece in pieces]
        listed = [_of_region(piece, volume) for piece, volume in zip(pieces, volumes, strict=True)]
        notes.append(f"Regions: {', '.join(listed)}; {_in_cm3(case.body.volume - sum(volumes))} around them.")
    return notes


def _of_region(piece: Embedded, volume: float) -> str:
    """Return the volume of an embedded region and, of one from a file, its least and its median thickness."""
    found = f"{piece.name} {_in_cm3(volume)}{', hollow' if piece.is_hollow else ''}"
    if not isinstance(piece, Segment):
        return found
    _, half = piece.surface.thin
    return f"{found} (thickness from {in_mm(2 * half.min())}, median {in_mm(2 * float(np.median(half)))})"


def _in_cm3(volume: float) -> str:
    return f"{1e6 * volume:.3g} cm³"


def _of_large_displacements(plan: Plan) -> list[str]:
    """Return the largest depth to expect with large displacements, and the number of cases beyond it."""
    large = [solve.case for solve in plan.solves if solve.case.way.is_large]
    large = [case for case in large if not case.way.is_found]
    if not large:
        return []
    ends = sorted({_FOLDS * case.probe.half_width for case in large})
    deeper = sum(case.probe.depth > _FOLDS * case.probe.half_width for case in large)
    return [
        f"Large displacements: tissue folds at the edge of a bonded punch near a depth of {_FOLDS:g} of its half "
        f"width, here {' to '.join(in_mm(end) for end in dict.fromkeys((ends[0], ends[-1])))}, earlier on finer "
        f"meshes. {counted(deeper, 'case')} of {len(large)} {'is' if deeper == 1 else 'are'} deeper. {_MAY_END}"
    ]


def _unasked(plan: Plan) -> dict[str, float]:
    """Return the number of scenes without F_exact because `solve.exact` is off by default, and its time (s)."""
    steps = first_attempts(replace(plan, solves=tuple(map(of_unit_scene, plan.unasked)))).meshes
    return {"scenes": len(plan.unasked), "seconds": sum(plan.cost.step(step).seconds for step in steps)}


def _makespan(costs: Iterable[float], groups: int) -> float:
    """Return the time at which the last of ``groups`` finishes, if each free group takes the next step."""
    busy = [0.0] * groups
    for seconds in costs:
        heapq.heappush(busy, heapq.heappop(busy) + seconds)
    return max(busy)


def story(plan: Plan, index: tuple[int, ...]) -> dict[str, Any]:
    """Return one case's steps, the cases that share them, and the cost of changing each input."""
    position = next(i for i, case in enumerate(plan.study.cases()) if case.index == index)
    case, key = plan.study.case(index), plan.keys[position]
    if case.no_contact:
        return {"case": str(case), "key": key, "steps": [f"none: {case.no_contact}"]}
    solve = next((s for s in plan.solves if s.key == key), None)
    same = [c for c, k in zip(plan.study.cases(), plan.keys, strict=True) if k == key and c.index != index]
    step = next((s for s in plan.meshes if solve in s.solves), None)
    return {
        "case": str(case),
        "key": key,
        "element": f"{case.way.element}, degree {case.mesh.degree}"
        if case.mesh.accuracy is None
        else "chosen for accuracy",
        "steps": _steps(plan, solve, step) if solve else [_without_solve(plan, key)],
        "record_shared_with": [str(c) for c in same],
        "mesh_shared_with": [s.label for s in step.solves if s is not solve] if step else [],
        "reference_key": plan.reference_keys[position] if plan.reference_keys else "",
        "changes": _changes(plan, case, solve),
    }


def _changes(plan: Plan, case: Case, solve: Solve | None) -> dict[str, str]:
    """Return the cost of changing each input, with this plan's reductions."""
    all_of_it = "mesh, assembly and solve"
    shares = plan.shared and not (solve and solve.axisymmetric)
    material = "one solve, on the same mesh and assembly" if shares else all_of_it
    contact = "one assembly and one solve, on the same mesh" if shares else all_of_it
    # If the contact area is to be found, probe.contact has no alternative, and each depth has its own mesh.
    is_found = not case.probe.has_singular_edge
    deeper = {"depth": all_of_it if is_found else contact} if case.way.is_found else {}
    if depth_key(case) and "scaling" in plan.used:
        deeper = {"depth": f"nothing: F {'is proportional' if case.way.is_found else 'does not depend on it'}"}
    if obstacle("scaling", case):
        proportional = {"young, load": material, "depth": contact}
    else:
        nothing = "nothing: F is proportional" if "scaling" in plan.used else material
        proportional = {", ".join(case.proportional_to): nothing}
    return {
        **proportional,
        **deeper,
        "poisson": material,
        **({} if is_found else {"contact": contact}),
        "body, probe, epsilon, fine, coarse, rim, growth, outside": all_of_it,
    }


def _steps(plan: Plan, solve: Solve, step: MeshStep | None) -> list[str]:
    if solve.axisymmetric:
        return _on_meridian(solve.way)
    part = ("whole body", "half of the body", "quarter of the body", "eighth of the body")[len(solve.mirrors)]
    shared = f", shared by {len(step.solves)} solves" if step and len(step.solves) > 1 else ""
    return [f"mesh of the {part}{shared}", *_solving(plan, solve, step), "error bar"]


def _on_meridian(way: Way) -> list[str]:
    path = "meridian: load steps in two dimensions, on finer and finer meshes until the error bar is small"
    match way.steps:
        case Steps.TIME:
            return [path, "time steps on the last of these meshes"]
        case Steps.LOAD:
            return [path]
    if way.is_found:
        return ["meridian: a few meshes and direct solves in two dimensions, until the contact radius is found"]
    return ["meridian: mesh, assembly and direct solve in two dimensions"]


def _without_solve(plan: Plan, key: str) -> str:
    """Return why a case is not solved."""
    along = {solve.key for path in plan.place_paths for solve in path.solves}
    if key in along - plan.stored:
        return "none so far: F is interpolated along the path, if its error bar is small enough there"
    return "none: its record is stored"


def _solving(plan: Plan, solve: Solve, step: MeshStep | None) -> list[str]:
    operator = next((o for o in step.operators if solve in o.solves), None) if step else None
    plain = f"operator and solve, {solve.case.way.element} elements"
    if operator is None or not solve.case.way.is_found:
        return [plain]
    depths = max(len(sweep) for sweep in operator.sweeps if solve in sweep)
    if plan.condensed and operator.is_condensed:
        return [f"operator, condensed to the contact surface for {depths} depths if the body is small: a dense solve"]
    return [f"{plain}, with an initial guess from {depths} depths" if plan.reuse and depths > 1 else plain]
