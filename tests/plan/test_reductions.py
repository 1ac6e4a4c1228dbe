"""Reductions: none changes F, each can be left out, and each says what it did."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.describe import story, summary
from epsmesh.plan.plan import make_plan
from epsmesh.plan.reductions import REDUCTIONS
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.study.read import parse
from tests.cases import BLADE, raw, study

ROUND = {"shape": "cylinder", "radius": "20 mm", "height": "15 mm"}
# reduction -> a study on which it does something
STUDIES = {
    "full": {"mesh": {"epsilon": ["8 mm", "50 mm", "full"], "outside": ["coarse", "free"]}},
    "duplicates": {"probe": [{"name": name, **raw()["probe"]} for name in ("here", "there")]},
    "scaling": {"material": {"young": ["1 kPa", "30 MPa"]}, "probe": BLADE | {"depth": ["0.1 mm", "0.2 mm"]}},
    "symmetry": {"probe": {"at": [["0 mm", "0 mm"], ["4 mm", "0 mm"]]}},
    "shared-mesh": {"material": {"poisson": [0.2, 0.4, 0.47]}, "probe": {"contact": ["bonded", "frictionless"]}},
    "initial-guess": {"material": {"poisson": [0.2, 0.25, 0.3, 0.4]}, "solve": {"method": "iterative", "exact": False}},
}


def run(without=(), **changes):
    content = raw(**changes)
    content["plan"] = {}
    plan = make_plan(parse(content), without=without)
    return plan, build(plan, compute(plan, MPI.COMM_SELF))


def test_reduced_basis_keeps_its_tolerance():
    """F from the basis is too high, by less than its bound, which is below the tolerance."""
    ratios = [round(0.02 * i, 2) for i in range(0, 23)]
    changes = {"material": {"poisson": ratios}, "mesh": {"rim": "0.8 mm"}}
    (plan, reduced), (_, solved) = (run(("axisymmetric", *more), **changes) for more in ((), ("reduced",)))
    assert {skipped.name: skipped.count for skipped in plan.skipped}["reduced"] == len(ratios)
    counts = dict(zip(*np.unique(reduced["origin"], return_counts=True), strict=True))
    assert counts["symmetric"] <= 7
    assert counts["reduced"] == len(ratios) - counts["symmetric"]
    error = reduced["force"] / solved["force"] - 1
    assert bool((error > -1e-8).all())
    assert bool((error < 1e-6).all())
    np.testing.assert_allclose(reduced["energy"], solved["energy"], rtol=1e-6)
    np.testing.assert_allclose(reduced["max_strain"], solved["max_strain"], rtol=2e-3)
    # The bar of what is not solved is the larger of its neighbours'.
    assert bool((reduced["force_error"] >= 0.98 * solved["force_error"]).all())


def test_reduced_basis_of_tissues_with_moduli_of_their_own():
    """Bars in newtons are those of each tissue's own force, not of the neighbour's that was solved."""
    tissues = [{"name": f"t{i}", "young": f"{(1, 100)[i % 2]} kPa", "poisson": 0.036 * i} for i in range(13)]
    _, reduced = run(material=tissues, probe={"at": ["3 mm", "1 mm"]})
    assert int((reduced["origin"] == "reduced").sum()) >= 3
    np.testing.assert_allclose(reduced["force_vector_error"].sel(component="z"), reduced["force_error"], rtol=1e-9)


@pytest.mark.parametrize("name", STUDIES)
def test_force_with_and_without(name):
    more = ("axisymmetric",) if name != "axisymmetric" else ()
    reduced, whole = run(more, **STUDIES[name]), run((*more, name), **STUDIES[name])
    skipped = {s.name: s for s in reduced[0].skipped}
    assert skipped[name].count > 0
    assert skipped[name].reason.endswith(".")
    assert name not in {s.name for s in whole[0].skipped}
    for variable in ("force", "energy", "force_error"):
        tolerance = {"force": 1e-8, "energy": 1e-8, "force_error": 0.05}[variable]
        np.testing.assert_allclose(reduced[1][variable], whole[1][variable], rtol=tolerance)


@pytest.mark.parametrize("of_time", [False, True])
def test_histories_are_spoken_of_where_there_are_some(of_time):
    change = {"history": {"ramp": "1 s", "hold": "10 s"}} if of_time else {}
    probes = [probe | change for probe in STUDIES["duplicates"]["probe"]]
    (duplicates,) = make_plan(study(probe=probes)).skipped[:1]
    assert duplicates.name == "duplicates"
    assert ("Histories" in duplicates.reason) == of_time


def test_all_at_once():
    changes = STUDIES["full"] | {"material": {"young": ["1 kPa", "5 kPa"], "poisson": [0.3, 0.4]}}
    reduced, whole = run(("axisymmetric",), **changes), run(("all",), **changes)
    assert len(whole[0].solves) == len(whole[0].meshes) == whole[1]["force"].size
    assert not whole[0].skipped
    assert len(reduced[0].solves) * 3 < len(whole[0].solves)
    np.testing.assert_allclose(reduced[1]["force"], whole[1]["force"], rtol=1e-8)


def test_axisymmetric_agrees_to_the_error_bars():
    changes = {
        "body": ROUND, "material": {"poisson": [0.3, 0.45]},
        "mesh": {"epsilon": ["6 mm", "full"], "outside": ["free", "fixed"]},
    }  # fmt: skip
    flat, solid = run(**changes), run(("axisymmetric",), **changes)
    assert set(np.unique(flat[1]["origin"])) == {"axisymmetric"}
    assert set(np.unique(solid[1]["origin"])) == {"symmetric"}
    error = np.abs(flat[1]["force"] - solid[1]["force"])
    assert bool((error <= solid[1]["force_error"] + flat[1]["force_error"]).all())
    assert len(make_plan(parse(raw(**changes, plan={}))).solves) == len(flat[0].solves)


@pytest.mark.parametrize(
    "changes",
    [
        {"mesh": {"epsilon": ["6 mm", "full"]}},  # how coarse the outside may be is the question
        {"mesh": {"epsilon": "full", "rim": ["1 mm", "2 mm"]}},
        {"mesh": {"epsilon": "full", "degree": [1, 2]}},
        {"mesh": {"epsilon": "full", "model": "3d"}},
        {"mesh": {"epsilon": "full"}, "probe": {"at": ["1 mm", "0 mm"]}},
        {"mesh": {"epsilon": "full"}, "probe": BLADE},
    ],
)
def test_studies_of_the_mesh_and_scenes_that_are_not_round_stay_in_three_dimensions(changes):
    plan = make_plan(parse(raw(body=ROUND, **changes) | {"plan": {}}))
    assert not any(solve.axisymmetric for solve in plan.solves)


def test_names_are_checked():
    with pytest.raises(ValueError, match="unknown reduction symetry"):
        make_plan(study(), without=("symetry",))
    assert {"full", "scaling", "axisymmetric", "symmetry", "shared-mesh"} <= set(REDUCTIONS)


def test_study_file_leaves_reductions_out():
    plan = make_plan(parse(raw(plan={"without": ["symmetry", "axisymmetric"]})))
    assert not any(solve.mirrors for solve in plan.solves)


def test_scaled_cases_carry_the_cost_of_their_source():
    plan, dataset = run(("axisymmetric",), **STUDIES["scaling"])
    assert len(plan.solves) == 1
    assert sorted(np.unique(dataset["origin"], return_counts=True)[1]) == [1, 3]
    assert len(np.unique(dataset["time_total"])) == 1


def test_summary_and_story():
    content = raw(material={"poisson": [0.3, 0.4]}, mesh={"epsilon": ["8 mm", "full"], "outside": ["coarse", "free"]})
    made, plain = (make_plan(parse(content), without=w) for w in ((), ("all",)))
    few, many = summary(made), summary(plain)
    assert (few["cases"], few["meshes"], few["solves"]) == (8, 3, 6)
    assert (many["meshes"], many["solves"]) == (8, 8)
    assert 0 < few["seconds"] < many["seconds"]
    assert few["memory"] <= many["memory"]
    told = story(made, (0, 1, 0))
    assert told["record_shared_with"] == ["poisson = 0.3, epsilon = full, outside = free"]
    assert any("poisson = 0.4" in label for label in told["mesh_shared_with"])
    assert "proportional" in told["changes"]["young, depth"]


@pytest.mark.parametrize(
    ("without", "young", "poisson"),
    [
        ((), "nothing: F is proportional", "same mesh"),
        (("scaling",), "one solve, on the same mesh", "same mesh"),
        (("shared-mesh",), "nothing: F is proportional", "mesh, assembly and solve"),
        (("all",), "mesh, assembly and solve", "mesh, assembly and solve"),
    ],
)
def test_story_tells_what_a_change_costs_with_the_reductions_that_are_used(without, young, poisson):
    changes = {"material": {"poisson": [0.3, 0.4]}}
    told = story(make_plan(study(**changes), without=without), (0,))["changes"]
    assert young in told["young, depth"]
    assert poisson in told["poisson"]
    in_file = parse(raw(**changes, plan={"without": list(without)}))
    assert story(make_plan(in_file), (0,))["changes"] == told
    timed = story(make_plan(study(**changes, solve={"timing": True})), (0,))["changes"]
    assert timed["young, depth"] == "mesh, assembly and solve"


@pytest.mark.nightly
def test_plan_of_a_hundred_thousand_cases_is_made_of_few_steps():
    ratios = [0.2 + 0.002 * i for i in range(100)]
    radii = [f"{1 + 0.1 * i:.1f} mm" for i in range(20)]
    young = [f"{1 + i} kPa" for i in range(10)]
    content = raw(
        material={"young": young, "poisson": ratios}, probe={"radius": radii, "depth": "0.02 mm"},
        mesh={"epsilon": ["5 mm", "6 mm", "7 mm", "8 mm", "full"]},
    )  # fmt: skip
    plan = make_plan(parse(content))
    assert len(plan.keys) == 100_000
    assert len(plan.solves) == 10_000
    assert len(plan.meshes) == 100


@pytest.mark.parametrize("at", [["0 mm", "0 mm"], ["3 mm", "0 mm"], ["3 mm", "2 mm"]])
def test_exact_force_is_the_same_whatever_motions_are_asked_for(at):
    """All six leave no plane of symmetry to solve on; a slice is as much part of the force along the axis as before."""
    blade = BLADE | {"slice": "0.1 mm", "at": at}
    found = []
    for motion in ("press", "all"):
        plan = make_plan(parse(raw(probe=blade | {"motion": motion}, solve={"exact": True})))
        (exact,) = (solve for solve in plan.solves if solve.is_reference)
        found.append((exact.key, exact.case.travel, exact.mirrors))
    assert found[0] == found[1]


def test_a_study_with_outputs_has_a_solve_of_each_modulus_though_one_without_was_planned_before():
    two = {"material": {"young": ["1 kPa", "2 kPa"], "poisson": 0.3}}
    output = {"name": "u", "of": "displacement", "at": ["0 mm", "0 mm", "-5 mm"]}
    for more, count in (({}, 1), ({"output": [output]}, 2), ({}, 1)):
        assert len(make_plan(study(**two, **more)).solves) == count
