"""Shards: everything is dealt out once, alike for all, evenly, and what depends on each other stays together."""

import pytest

from epsmesh.plan.cost import CostModel
from epsmesh.plan.plan import make_plan
from epsmesh.plan.shard import Shard, deal, parse_shard, reason_against, shard_of, stores_of, take
from epsmesh.plan.steps import mesh_steps
from tests.cases import study

SWEEP = {
    "material": {"young": ["5 kPa", "10 kPa"], "poisson": [0.3, 0.4]},
    "mesh": {"epsilon": ["5 mm", "7 mm", "10 mm", "full"], "outside": ["coarse", "free"]},
    "solve": {"exact": True},
}
ROUND = {"body": {"shape": "cylinder", "radius": "30 mm", "height": "20 mm", "fixed": "bottom"}}
STOP = {"plan": {"without": ["axisymmetric"], "stop_near_exact": "1 %"}}


@pytest.mark.parametrize("count", [1, 2, 3, 50])
@pytest.mark.parametrize("changes", [{}, {"plan": {"without": ["shared-mesh"]}}, {"plan": {"without": ["all"]}}, STOP])
def test_every_solve_is_dealt_once_and_meshes_stay_whole(count, changes):
    plan = make_plan(study(**SWEEP | changes))
    parts = deal(plan, count)
    keys = [solve.key for solve in plan.solves]
    assert sorted(key for part in parts for key in part) == sorted(set(keys))
    assert len(parts) == count
    for step in plan.meshes:
        assert len({number for number, part in enumerate(parts) for solve in step.solves if solve.key in part}) == 1
    shards = [take(plan, Shard(number, count)) for number in range(1, count + 1)]
    assert sorted(solve.key for shard in shards for solve in shard.solves) == sorted(keys)


def test_shards_are_even():
    radii = {"shape": "disc", "radius": [f"{r} mm" for r in (1, 2, 3, 4, 5)], "depth": "0.2 mm"}
    plan = make_plan(study(**SWEEP | {"probe": radii}))
    costs = {step.solves[0].key: CostModel().step(step).seconds for step in plan.meshes}
    loads = [sum(cost for key, cost in costs.items() if key in part) for part in deal(plan, 4)]
    # Whoever has least to do gets the next one: nobody ends up further above the mean than by the largest step.
    assert max(loads) <= 1.01 * (sum(loads) / 4 + (1 - 1 / 4) * max(costs.values()))
    # And with the largest first, nobody has twice as much as another, where steps are many.
    assert max(loads) < 2 * min(loads)


def test_the_deal_does_not_depend_on_what_is_stored():
    whole = make_plan(study(**SWEEP))
    shard = Shard(1, 3)
    fresh = make_plan(study(**SWEEP), shard=shard)
    stored = {fresh.solves[0].key, *(solve.key for solve in whole.solves if solve.key not in fresh.part)}
    again = make_plan(study(**SWEEP), stored, shard=shard)
    assert again.part == fresh.part
    assert [solve.key for solve in again.solves] == [solve.key for solve in fresh.solves[1:]]


def test_cases_of_an_early_stop_wait_in_one_shard():
    """Cases of two probes have nothing in common; those of one probe wait for its F_exact and for smaller ε."""
    probe = {"shape": "disc", "radius": ["2 mm", "3 mm"], "depth": "0.2 mm"}
    plan = make_plan(study(**SWEEP | STOP | {"probe": probe}))
    parts = [part for part in deal(plan, 8) if part]
    assert len(parts) == 2
    radius = {solve.key: solve.case.probe.radius for solve in plan.solves}
    assert sorted({radius[key] for key in part} for part in parts) in ([{2e-3}, {3e-3}], [{3e-3}, {2e-3}])


def test_meridians_are_dealt_singly():
    """Each has a mesh of its own."""
    poisson = [0.1, 0.2, 0.3, 0.4]
    plan = make_plan(study(**ROUND, material={"poisson": poisson}, plan={"without": []}))
    assert all(solve.axisymmetric for solve in plan.solves)
    assert len(mesh_steps(plan.solves)) == 4
    assert [len(part) for part in deal(plan, 4)] == [1, 1, 1, 1]


def test_names(tmp_path):
    made = study()
    path = Shard(3, 8).store(tmp_path, made)
    assert shard_of(path) == Shard(3, 8) == parse_shard("3/8")
    path.parent.mkdir()
    for name in (path.name, f"other-{path.name}", f"{path.name}-journal", f"{made.name}.sqlite"):
        (path.parent / name).touch()
    assert stores_of(tmp_path, made) == [path]
    assert stores_of(tmp_path / "nowhere", made) == []


@pytest.mark.parametrize("text", ["0/4", "5/4", "1/0", "-1/4", "1", "1/4/2", "a/b", "", "1.5/4", "¹/4"])
def test_what_is_no_shard_is_refused(text):
    with pytest.raises(ValueError, match="give i/n"):
        parse_shard(text)


def test_times_are_not_dealt_out():
    assert "one machine" in reason_against(study(solve={"timing": True}))
    assert not reason_against(study())
