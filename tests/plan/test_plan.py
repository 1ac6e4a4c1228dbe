"""The plan: every case gets its record, nothing is solved twice, timing skips nothing."""

import pytest

from epsmesh.plan.describe import summary
from epsmesh.plan.plan import declare, make_plan
from epsmesh.study.read import parse
from tests.cases import BLADE, NO_SIZES, raw, study

ACCURATE = NO_SIZES | {"accuracy": "5 %"}
SWEEP = {"material": {"poisson": [0.3, 0.4]}, "mesh": {"epsilon": ["5 mm", "full"], "outside": ["coarse", "free"]}}


def test_full_order_is_one_case_whatever_is_outside():
    plan = make_plan(study(**SWEEP))
    assert len(plan.keys) == 8
    assert len(plan.solves) == 6
    assert sorted(index for solve in plan.solves for index in solve.serves) == [
        case.index for case in plan.study.cases()
    ]
    assert {skipped.name: skipped.count for skipped in plan.skipped}["full"] == 2


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
    assert not plan.skipped
    assert not any(solve.mirrors for solve in plan.solves)


@pytest.mark.parametrize("probe", [{}, {"slice": "0.1 mm"}, {"incision": "4 mm"}], ids=str)
def test_what_a_blade_is_said_to_do_changes_no_force(probe):
    """The action is a label: it may be left out, and no key of a case depends on it."""
    said = [{}, {"action": "pierce"}, {"action": "cut"}]
    keys = [make_plan(study(probe=BLADE | probe | action)).keys for action in said]
    assert keys[0] == keys[1] == keys[2]


def test_f_exact_beside_an_accuracy_is_computed_only_where_it_is_asked_for():
    """Its error bars tell enough; the plan says what F_exact would add."""
    left_out, asked = (raw(mesh=ACCURATE, solve=solve) for solve in ({"exact": None}, {"exact": True}))
    plan = make_plan(parse(left_out))
    assert not any(solve.is_reference for solve in plan.solves)
    unasked = summary(plan)["exact_unasked"]
    assert unasked["scenes"] == 1
    assert unasked["seconds"] > 0
    plan = make_plan(parse(asked))
    assert sum(solve.is_reference for solve in plan.solves) == 1
    assert summary(plan)["exact_unasked"]["scenes"] == 0


def test_one_mesh_for_many_depths_is_not_recommended_where_it_is_refused():
    sphere = {"shape": "sphere", "radius": "6 mm", "contact": "unilateral", "depth": ["0.2 mm", "0.3 mm"]}
    for changes, is_told in (({}, True), ({"mesh": ACCURATE}, False)):
        plan = make_plan(study(probe=sphere, **changes))
        assert any("mesh_depths" in skipped.reason for skipped in plan.skipped) == is_told


@pytest.mark.parametrize(
    "changes",
    [
        {"material": {"law": ["gent", "veronda-westmann"], "limit": 20.0, "alpha": 20.0}},
        {"material": {"law": "neo-hookean"}, "probe": {"history": {"ramp": ["1 s", "2 s"], "hold": "2 s"}}},
    ],
)
def test_a_sweep_is_of_one_law_and_one_history_in_the_order_of_its_depths(changes):
    probe = {"depth": ["0.5 mm", "1 mm"], **changes.get("probe", {})}
    relaxing = {"relaxation": [{"share": 0.3, "time": "1 s"}]} if "history" in probe else {}
    plan = make_plan(study(probe=probe, material=changes["material"] | relaxing))
    sweeps = [sweep for step in plan.meshes for operator in step.operators for sweep in operator.sweeps]
    assert len(sweeps) == 2
    for sweep in sweeps:
        assert len({(solve.case.material.law, solve.case.probe.history) for solve in sweep}) == 1
        assert [solve.case.probe.depth for solve in sweep] == [5e-4, 1e-3]


@pytest.mark.parametrize(("accuracy", "is_told"), [("2 %", False), ("0.5 %", True)])
def test_an_accuracy_of_which_friction_takes_most_is_told(accuracy, is_told):
    """In three dimensions friction has a bar that meshes keep; the ladder then begins with its cheapest mesh."""
    disc = {"contact": "unilateral", "friction": 0.3}
    plan = make_plan(study(probe=disc, mesh=NO_SIZES | {"accuracy": accuracy}, solve={"exact": False}))
    assert any("Friction has an error bar of its own" in one.reason for one in plan.skipped) == is_told
    (solve,) = plan.solves
    assert (solve.expected > solve.goal) == is_told
