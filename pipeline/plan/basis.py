"""Which sweeps of Poisson's ratio a reduced basis answers, and why not the others."""

from dataclasses import replace

from pipeline.plan.key import digest
from pipeline.plan.steps import OperatorStep
from pipeline.plan.work import Plan, Struck, reason_of
from pipeline.study.capabilities import obstacle

# Fewer Poisson's ratios than this are solved one by one: a basis needs about five solutions itself.
_FEWEST_RATIOS = 8


def use_reduced_basis(plan: Plan) -> Plan:
    """Many Poisson's ratios on one operator: a few are solved, and the rest follow with a bound on the error of F."""
    if not plan.shared:
        return plan
    operators = [operator for step in plan.meshes for operator in step.operators if _sweeps_ratios(operator)]
    obstacles = [obstacle("reduced basis", operator.case) for operator in operators]
    tolerance = plan.study.planning.tolerance
    many = {
        solve.key
        for operator, obstacle in zip(operators, obstacles, strict=True)
        if not obstacle
        for solve in operator.solves
    }
    if operators and not many:
        reason = f"No reduced basis: {obstacles[0]}, and each is solved."
        return replace(plan, struck=(*plan.struck, Struck("reduced", 0, reason)))
    plan = plan.with_solves(
        [
            replace(s, key=digest(f"{s.key} reduced {tolerance!r}"), reduced=True) if s.key in many else s
            for s in plan.solves
        ]
    )
    return plan.struck_by("reduced", len(many), reason_of(use_reduced_basis))


def _sweeps_ratios(operator: OperatorStep) -> bool:
    """Tell whether an operator is solved for many materials, with displacement elements, whose operator depends on one
    parameter, and for one force: the bound is on the work of one movement, not on forces that several take.
    """
    solve, case = operator.solves[0], operator.case
    ratios = {solve.key if case.body.regions else solve.case.material.poisson for solve in operator.solves}
    return (
        len(ratios) >= _FEWEST_RATIOS
        and case.element == "displacement"
        and solve.goal is None
        and not solve.axisymmetric
        and case.movements == 1 + case.is_closed
    )
