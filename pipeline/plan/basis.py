"""Which sweeps of Poisson's ratio a reduced basis answers, and why not the others."""

from collections.abc import Callable
from dataclasses import replace

from pipeline.plan.key import digest
from pipeline.plan.steps import OperatorStep
from pipeline.plan.work import Plan, Struck, reason_of
from pipeline.study.sweep import Case

# Fewer Poisson's ratios than this are solved one by one: a basis needs about five solutions itself.
_FEWEST_RATIOS = 8
# What a basis would have to know besides Poisson's ratio: more parameters, or solutions that do not add up.
_OBSTACLES: dict[str, Callable[[Case], bool]] = {
    "a body of several materials has more parameters than one": lambda case: bool(case.body.regions),
    "the area of contact changes with Poisson's ratio": lambda case: case.probe.is_unilateral,
    "the far field changes with Poisson's ratio": lambda case: case.is_closed,
    "large displacements are not sums of others": lambda case: case.material.is_large,
}


def use_reduced_basis(plan: Plan) -> Plan:
    """Many Poisson's ratios on one operator: a few are solved, and the rest follow with a bound on the error of F."""
    if not plan.shared:
        return plan
    operators = [operator for step in plan.meshes for operator in step.operators if _sweeps_ratios(operator)]
    obstacles = [_obstacle(operator.case) for operator in operators]
    tolerance = plan.study.planning.tolerance
    many = {
        solve.key: digest(f"{solve.key} reduced {tolerance!r}")
        for operator, obstacle in zip(operators, obstacles, strict=True) if not obstacle
        for solve in operator.solves
    }  # fmt: skip
    if operators and not many:
        reason = f"No reduced basis: {obstacles[0]}, and each is solved."
        return replace(plan, struck=(*plan.struck, Struck("reduced", 0, reason)))
    solves = tuple(replace(s, key=many[s.key], reduced=True) if s.key in many else s for s in plan.solves)
    plan = replace(plan, solves=solves, keys=tuple(many.get(key, key) for key in plan.keys))
    return plan.struck_by("reduced", len(many), reason_of(use_reduced_basis))


def _obstacle(case: Case) -> str:
    """Return why no basis answers a case that is solved for many materials; nothing if one does."""
    return next((reason for reason, is_one in _OBSTACLES.items() if is_one(case)), "")


def _sweeps_ratios(operator: OperatorStep) -> bool:
    """Tell whether an operator is solved for many materials, with displacement elements, whose operator depends on one
    parameter, and for one force: the bound is on the work of one movement, not on forces that several take.

    In a slit more is asked for than the work, and loads do work of their own.
    """
    solve, case = operator.solves[0], operator.case
    ratios = {solve.key if case.body.regions else solve.case.material.poisson for solve in operator.solves}
    return (
        len(ratios) >= _FEWEST_RATIOS
        and case.element == "displacement"
        and solve.goal is None
        and not solve.axisymmetric
        and not case.load.acts
        and case.probe.slit is None
        and case.movements == 1 + case.is_closed
    )
