"""Depths of one tool on one mesh: initial guesses from neighbours, or a condensed surface, give the same forces."""

from contextlib import ExitStack

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.describe import story
from epsmesh.plan.key import case_key, mesh_key, normalised, reference_key
from epsmesh.plan.plan import make_plan
from epsmesh.plan.steps import FEWEST_DEPTHS
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.solve.contact.condensed import CondensedElements
from epsmesh.solve.contact.sweep import Sweep
from epsmesh.solve.far_field import PointForce
from epsmesh.solve.physics import MaterialLaw
from epsmesh.study.problems import StudyError
from tests.cases import study

SMALL = {"shape": "cylinder", "radius": "6 mm", "height": "5 mm"}
DEPTHS = [f"{depth:.4g} mm" for depth in np.linspace(0.04, 0.12, FEWEST_DEPTHS)]
MESH = {"fine": "2 mm", "coarse": "2 mm", "rim": "0.4 mm", "growth": 0.6}


def sphere(depths, *, on_one_mesh=True):
    """Return a ball off the axis of its body, so that half of the body is solved."""
    ends = {"mesh_depths": [DEPTHS[0], DEPTHS[-1]]} if on_one_mesh else {}
    return {"shape": "sphere", "radius": "6 mm", "depth": depths, "at": ["0.5 mm", "0 mm"], **ends}


def run(depths, without=(), stored=(), **changes):
    plan = make_plan(study(body=SMALL, probe=sphere(depths), mesh=MESH | changes.pop("mesh", {}), **changes),
                     without=without)  # fmt: skip
    dataset = build(plan, compute(plan, MPI.COMM_SELF))
    assert set(np.unique(dataset["status"])) == {"ok"}
    return plan, dataset


@pytest.fixture(scope="module")
def plainly():
    """Return the forces of depths solved separately."""
    return run(DEPTHS, ("condensed", "initial-guess"))[1]


@pytest.mark.parametrize("without", [(), ("condensed",)], ids=["condensed", "from neighbours"])
def test_force_is_that_of_each_depth_by_itself(plainly, without):
    plan, found = run(DEPTHS, without)
    counts = {skipped.name: skipped.count for skipped in plan.skipped}
    assert counts["initial-guess"] == len(DEPTHS) - 1
    assert counts.get("condensed", 0) == (0 if without else len(DEPTHS))
    np.testing.assert_allclose(found["force"], plainly["force"], rtol=1e-8)
    for name in ("contact_area", "energy", "max_strain"):
        np.testing.assert_allclose(found[name], plainly[name], rtol=1e-6)
    # Each depth gets the whole cost of the shared elements.
    assert (found["time_assemble"] > 0).all()
    assert (found["time_setup"] > 0).all()
    assert float(found["iterations"].mean()) < 0.75 * float(plainly["iterations"].mean())


def test_bars_on_a_condensed_surface_are_not_smaller(plainly):
    """Some depths have bars of their own, the others get theirs from these."""
    _, found = run(DEPTHS)
    ratio = (found["force_error"] / plainly["force_error"]).values
    assert ratio[[0, -1]] == pytest.approx(1.0, rel=0.05)
    assert ratio.min() > 0.95
    assert ratio.max() < 4


def test_some_of_the_depths_have_the_forces_of_all(plainly):
    """As in a run that continues an interrupted one: other neighbours, too few depths to condense."""
    some = [8, 3, 5]
    plan, found = run([DEPTHS[number] for number in some])
    assert "condensed" not in {skipped.name for skipped in plan.skipped}
    by_depth = dict(zip(found["depth"].values, found["force"].values, strict=True))
    for number in some:
        depth = float(plainly["depth"][number])
        assert by_depth[depth] == pytest.approx(float(plainly["force"][number]), rel=1e-8)


def test_mixed_elements_and_two_materials_start_from_their_own_neighbours():
    depths, changes = DEPTHS[:2], {"material": {"poisson": [0.45, 0.5]}, "mesh": {"element": "mixed", "rim": "0.6 mm"}}
    (_, found), (_, alone) = (run(depths, without, **changes) for without in ((), ("initial-guess",)))
    np.testing.assert_allclose(found["force"], alone["force"], rtol=1e-8)


def test_flat_tools_on_curved_bodies_share_their_mesh_as_it_is():
    """Their footprint is the same at every depth."""
    ball = {"shape": "ellipsoid", "axes": ["8 mm", "8 mm", "6 mm"], "fixed": {"below": "-2 mm"}}
    disc = {"shape": "disc", "radius": "1.5 mm", "contact": "unilateral", "depth": DEPTHS[:2]}
    found, alone = (
        compute(make_plan(study(body=ball, probe=disc, mesh=MESH | {"rim": "0.6 mm"}), without=without), MPI.COMM_SELF)
        for without in (("axisymmetric",), ("axisymmetric", "initial-guess"))
    )
    for key, record in found.items():
        assert record.force == pytest.approx(alone[key].force, rel=1e-8)
        assert record.iterations < alone[key].iterations or record.depth == min(r.depth for r in found.values())


def test_plan_tells_why_depths_are_solved_alone():
    plan = make_plan(study(body=SMALL, probe=sphere(DEPTHS, on_one_mesh=False), mesh=MESH))
    assert len(plan.meshes) == len(DEPTHS)
    (reason,) = (skipped.reason for skipped in plan.skipped if skipped.name == "initial-guess")
    assert "mesh_depths" in reason
    together = make_plan(study(body=SMALL, probe=sphere(DEPTHS), mesh=MESH))
    assert len(together.meshes) == 1
    assert "condensed to the contact surface for 10 depths" in " ".join(story(together, (3,))["steps"])
    timed = make_plan(study(body=SMALL, probe=sphere(DEPTHS), mesh=MESH, solve={"timing": True, "exact": False}))
    assert not timed.skipped
    assert len(timed.meshes) == len(DEPTHS)


def test_keys_of_tools_without_a_range_and_of_the_exact_force_do_not_know_of_it():
    (alone,) = study(body=SMALL, probe=sphere(DEPTHS[1], on_one_mesh=False), mesh=MESH).cases()
    one, other = study(body=SMALL, probe=sphere(DEPTHS[1:3]), mesh=MESH).cases()
    assert mesh_key(one) == mesh_key(other) != mesh_key(alone)
    assert case_key(one) != case_key(alone)
    assert reference_key(one, 1e-3) == reference_key(alone, 1e-3)
    assert normalised(one).probe == normalised(alone).probe


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"probe": sphere("0.2 mm")}, r"probe\.depth.*is outside mesh_depths, 0\.04 mm to 0\.12 mm"),
        ({"probe": sphere("0.1 mm") | {"mesh_depths": ["0.2 mm", "0.1 mm"]}}, "must begin with the smaller depth"),
        ({"mesh": {"accuracy": "1 %"} | dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))},
         "needs given element sizes"),
    ],
)  # fmt: skip
def test_depths_that_a_mesh_cannot_be_for_are_refused(changes, message):
    with pytest.raises(StudyError, match=message):
        study(**({"body": SMALL, "probe": sphere("0.1 mm"), "mesh": MESH} | changes))


@pytest.mark.mpi
def test_ranks_agree():
    plan = make_plan(study(body=SMALL, probe=sphere(DEPTHS[:3]), mesh=MESH))
    together, alone = (compute(plan, comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    for key, record in alone.items():
        assert together[key].force == pytest.approx(record.force, rel=3e-8)


def test_bars_between_two_depths_are_those_of_the_worse_one():
    sweep = Sweep(MaterialLaw.of(1.0, 1.0), "auto", object.__new__(CondensedElements), ExitStack())
    sweep.keep_bar(1e-4, 3e-3, 1e-2)
    assert sweep.bar(1.2e-4) is None  # one depth alone gives no bar for another
    sweep.keep_bar(1.5e-4, 2e-3, 2e-2)
    sweep.keep_bar(4e-4, 1e-3, 1e-2)
    assert sweep.bar(1e-4) == (3e-3, 1e-2)
    for depth in (1.05e-4, 1.45e-4):
        assert sweep.bar(depth) == pytest.approx((1.25 * 2e-3, 1.25 * 2e-2))
    assert sweep.bar(2e-4) is None  # too far from one of them
    assert sweep.bar(5e-4) is None
    assert sweep.bar(1e-4, PointForce(0.3, (0.0, 0.0, 0.0), 1e-2)) is None  # of another scene
