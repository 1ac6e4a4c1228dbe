"""A plan in words and numbers: what is to be done, what is not and why, and what it will take."""

from dataclasses import dataclass
from typing import Any

from pipeline.plan import estimate
from pipeline.plan.plan import Plan
from pipeline.plan.steps import MeshStep, Solve


@dataclass(frozen=True)
class StepEstimate:
    """What a mesh step will take: seconds, bytes, elements; rough, see :mod:`pipeline.plan.estimate`."""

    kind: str  # mesh | meridian
    solves: int
    operators: int
    cells: float
    seconds: float
    memory: float
    case: str


def summary(plan: Plan, ranks: int = 1) -> dict[str, Any]:
    """Return the plan as plain data."""
    steps = [estimate_step(step) for step in plan.meshes]
    return {
        "study": plan.study.file,
        "cases": len(plan.keys),
        "meshes": sum(1 if step.kind == "mesh" else step.solves for step in steps),
        "operators": sum(step.operators for step in steps),
        "solves": len(plan.solves),
        "exact": sum(solve.is_reference for solve in plan.solves),
        "struck": [{"name": s.name, "count": s.count, "reason": s.reason} for s in plan.struck],
        "seconds": sum(step.seconds for step in steps) / ranks**0.8,
        "memory": max((step.memory for step in steps), default=0.0),
        "ranks": ranks,
        "steps": [vars(step) for step in steps],
    }


def estimate_step(step: MeshStep) -> StepEstimate:
    """Estimate one mesh step: its mesh, its assemblies, its solves with their error bars."""
    if step.axisymmetric:
        count = len(step.solves)
        return StepEstimate("meridian", count, count, 1e3, count * estimate.MERIDIAN_SECONDS, 3e8, _title(step))
    share = 0.5 ** len(step.mirrors)
    cells = share * estimate.cells(step.case)
    seconds = estimate.meshing_seconds(cells)
    for operator in step.operators:
        seconds += sum(estimate.solving_seconds(solve.case, cells) for solve in operator.solves)
    memory = estimate.case_memory(step.case, share)
    return StepEstimate("mesh", len(step.solves), len(step.operators), cells, seconds, memory, _title(step))


def _title(step: MeshStep) -> str:
    first = step.solves[0].label
    return first if len(step.solves) == 1 else f"{first} and {len(step.solves) - 1} more"


def story(plan: Plan, declared: Plan, index: tuple[int, ...]) -> dict[str, Any]:
    """Return what is to be known of one case: its steps, with whom it shares them, and what a change would cost."""
    position = next(i for i, case in enumerate(plan.study.cases()) if case.index == index)
    case, key = plan.study.case(index), plan.keys[position]
    solve = next((s for s in plan.solves if s.key == key), None)
    same = [c for c, k in zip(plan.study.cases(), plan.keys, strict=True) if k == key and c.index != index]
    step = next((s for s in plan.meshes if solve in s.solves), None)
    return {
        "case": str(case),
        "key": key,
        "element": f"{case.element}, degree {case.mesh.degree}"
        if case.mesh.accuracy is None
        else "chosen for accuracy",
        "steps": _steps(solve, step) if solve else ["none: its record is stored"],
        "record_shared_with": [str(c) for c in same],
        "mesh_shared_with": [s.label for s in step.solves if s is not solve] if step else [],
        "reference_key": plan.reference_keys[position] if plan.reference_keys else "",
        "changes": {
            "young, depth": "nothing: F is proportional to both" if _has(plan, "scaling") else "one solve",
            "poisson": "one solve, on the same mesh and assembly",
            "contact": "one assembly and one solve, on the same mesh",
            "body, probe, epsilon, fine, coarse, rim, growth, outside": "mesh, assembly and solve",
        },
    }


def _has(plan: Plan, name: str) -> bool:
    return name not in plan.study.planning.without and not plan.study.solve.timing


def _steps(solve: Solve, step: MeshStep | None) -> list[str]:
    if solve.axisymmetric:
        return ["meridian: mesh, assembly and direct solve in two dimensions"]
    part = {0: "whole body", 1: "half of the body", 2: "quarter of the body"}[len(solve.mirrors)]
    shared = f", shared by {len(step.solves)} solves" if step and len(step.solves) > 1 else ""
    return [f"mesh of the {part}{shared}", f"operator and solve, {solve.case.element} elements", "error bar"]
