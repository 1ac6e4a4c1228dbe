"""The plan: every case gets its record, nothing is solved twice, timing strikes nothing."""

from pipeline.plan.plan import declare, make_plan
from tests.cases import study

SWEEP = {"material": {"poisson": [0.3, 0.4]}, "mesh": {"epsilon": ["5 mm", "full"], "outside": ["coarse", "free"]}}


def test_full_order_is_one_case_whatever_is_outside():
    plan = make_plan(study(**SWEEP))
    assert len(plan.keys) == 8
    assert len(plan.solves) == 6
    assert sorted(index for solve in plan.solves for index in solve.serves) == [
        case.index for case in plan.study.cases()
    ]
    assert {struck.name: struck.count for struck in plan.struck}["full"] == 2


def test_epsilon_past_the_body_is_full_order():
    assert len(make_plan(study(mesh={"epsilon": ["50 mm", "full"]})).solves) == 1
    assert len(make_plan(study(mesh={"epsilon": ["30 mm", "full"]})).solves) == 2


def test_cases_that_differ_in_material_share_mesh_and_operator():
    plan = make_plan(study(**SWEEP))
    assert len(plan.meshes) == 3
    assert [len(step.operators) for step in plan.meshes] == [1, 1, 1]
    assert all(len(step.solves) == 2 for step in plan.meshes)


def test_degrees_share_curved_meshes_only():
    plan = make_plan(study(mesh={"degree": [1, 2, 3]}))
    assert [len(step.operators) for step in plan.meshes] == [1, 2]


def test_stored_cases_are_not_solved():
    plan = make_plan(study(**SWEEP))
    known = {plan.solves[0].key}
    again = make_plan(study(**SWEEP), known)
    assert len(again.solves) == 5
    assert again.stored == known


def test_timing_strikes_nothing():
    timed = study(**SWEEP, solve={"timing": True})
    plan = make_plan(timed, declare(timed).keys)
    assert len(plan.solves) == 8
    assert len(plan.meshes) == 8
    assert not plan.struck
    assert not any(solve.mirrors for solve in plan.solves)
