"""Two jaws that are pulled once they have closed: stiffness, slip, Coulomb's limit, work, balance and symmetry."""

from dataclasses import replace
from math import isnan, pi
from typing import Any

import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.run.given_force import with_depths
from epsmesh.run.record import Record
from epsmesh.solve.contact_result import ContactResult, PullResult, Slip
from epsmesh.states import PARTIAL
from epsmesh.study.read import parse
from tests.cases import ROUGH, raw, refusal, solve
from tests.solve.test_grasp import BALL, DISC, LARGE, NEAR, closed, grasp

SIDES = {"fixed": "sides"}
DEEP = SIDES | {"size": ["40 mm", "40 mm", "60 mm"]}
MU = 0.3
SLIPS = BALL | {"friction": MU, "pull": "0.2 mm"}
STICKS = BALL | {"friction": "stick", "pull": "0.05 mm"}


def pulled(first: dict[str, Any], second: dict[str, Any] | None = None, comm: MPI.Comm = MPI.COMM_SELF, **more: Any):
    """Return the numbers of one pull."""
    found = closed(first, *([] if second is None else [second]), comm=comm, **{"body": SIDES} | more)
    assert found.status == "ok", found.message
    assert found.balance < 1e-6
    return found.largest | {"force": found.force, "area": found.contact_area, "slip_area": found.slip_area}


@pytest.fixture(scope="module")
def linear():
    return pulled(SLIPS)


@pytest.fixture(scope="module")
def stuck():
    return pulled(STICKS, mesh=ROUGH)


@pytest.mark.parametrize(
    "material", [{}, pytest.param(LARGE, marks=pytest.mark.nightly)], ids=["linear", "large displacements"]
)
def test_work_of_the_jaws_is_stored_or_heat(material, linear):
    found = pulled(SLIPS, material=material) if material else linear
    assert found["pull_work"] == pytest.approx(found["friction_work"] + found["pull_energy"], rel=1e-2)
    assert found["friction_work"] > 0.1 * found["pull_work"]
    assert found["pull_energy"] > 0


def test_after_whole_slip_the_force_is_coulombs(linear):
    """Of flat faces and a linear law, whose normals do not turn."""
    for pull, press in (("pull_force", "force"), ("jaw_pull_force", "jaw_force")):
        assert linear[pull] == pytest.approx(MU * linear[press], rel=1e-3)
    assert linear["slip_area"] == pytest.approx(linear["area"], rel=1e-12)
    total = linear["pull_force"] + linear["jaw_pull_force"]
    assert linear["slip_whole_force"] == pytest.approx(total, abs=linear["slip_whole_force_error"])
    assert 0 < linear["slip_begins"] < linear["slip_whole"] < 0.2e-3


def test_bars_of_the_pull_are_at_least_those_of_the_normal_force(linear):
    least = linear["closed_force_error"] / linear["closed_force"]  # F has the same, and its friction is all of the pull
    assert linear["pull_force_error"] >= least * linear["pull_force"] * (1 - 1e-12)
    least = linear["jaw_force_error"] / linear["jaw_force"]
    assert linear["jaw_pull_force_error"] >= least * linear["jaw_pull_force"] * (1 - 1e-12)
    assert linear["slip_begins_error"] >= linear["slip_begins"]
    assert linear["slip_begins_force_error"] >= linear["slip_begins_force"]


def test_bars_of_the_pull_cover_that_of_a_finer_mesh(linear):
    coarse = pulled(SLIPS, mesh={"rim": "1.6 mm"})
    for name in ("pull_force", "jaw_pull_force", "slip_whole", "slip_whole_force"):
        assert coarse[name] == pytest.approx(linear[name], rel=0, abs=coarse[f"{name}_error"]), name


def test_least_bars_widen_those_of_the_pull_once():
    slip = Slip(1e-3, 1e-4, 2.0, 0.1)
    pull = PullResult((1.0, 1.0), slip, None, 0.0, 0.0, 0.0, 3.0).with_bar(0.1)
    contact = ContactResult(1e-6, bar=0.1, pull=pull)
    assert contact.with_least_bar(0.05).pull == pull
    wider = contact.with_least_bar(0.3).pull
    assert wider is not None
    assert wider.begins is not None
    assert wider.bar == 0.3
    assert wider.begins.at_bar == pytest.approx(1e-4 + 0.3 * 1e-3)
    assert wider.begins.force_bar == pytest.approx(0.1 + 0.3 * 2.0)


def test_slip_that_another_pull_does_not_reach_has_no_known_bar():
    slip = Slip(1e-3, 1e-4, 2.0, 0.1)
    assert isnan(slip.with_change(slip, None).at_bar)
    changed = slip.with_change(slip, replace(slip, at=1.2e-3, force=1.5))
    assert changed.at_bar == pytest.approx(3e-4)
    assert changed.force_bar == pytest.approx(0.6)


def test_slip_that_only_some_of_the_pulls_reach_is_told():
    slip = Slip(1e-3, 1e-4, 2.0, 0.1)
    ends = PullResult((1.0, 1.0), slip, None, 0.0, 0.0, 0.0, 3.0)
    slips = replace(ends, whole=slip)
    assert ends.with_change(ends, ends).note == ""
    for found in (ends.with_change(ends, slips), slips.with_change(ends, slips).with_change(slips, slips)):
        assert "near to slip_whole" in found.note
        assert "slip_begins" not in found.note
        assert ContactResult(1e-6, pull=found).note == found.note


def test_balls_slip_as_mindlin_computed(linear):
    """R. D. Mindlin, J. Appl. Mech. 16, 259, 1949: the pull at which the whole contact of a rigid ball slides."""
    modulus, poisson = 10e3 / 2.6, 0.3
    radius = (linear["area"] / pi) ** 0.5
    expected = 3 * (2 - poisson) * MU * linear["force"] / (16 * modulus * radius)
    # The body is no half-space.
    assert linear["slip_whole"] == pytest.approx(expected, abs=linear["slip_whole_error"] + 0.1 * expected)


@pytest.mark.nightly
def test_before_slip_jaws_have_the_stiffness_of_bonded_ones():
    """Of a deep body each jaw is alone, but for what the other one moves."""
    found = pulled(DISC | {"friction": "stick", "pull": "0.05 mm"}, body=DEEP)
    probe = {key: value for key, value in DISC.items() if key != "contact"} | {"motion": "all"}
    (bonded,) = solve(probe=probe, body=DEEP).values()
    expected, bar = 0.05e-3 * bonded.stiffness[0][0], 0.05e-3 * bonded.stiffness_error[0][0]
    assert found["pull_force"] == pytest.approx(expected, abs=bar + found["pull_force_error"])
    assert found["pull_force"] == pytest.approx(expected, rel=1e-2)
    assert found["friction_work"] == pytest.approx(0.0, abs=1e-4 * found["pull_work"])


def test_forces_are_proportional_to_the_modulus(stuck):
    other = pulled(STICKS, material={"young": "20 kPa"}, mesh=ROUGH)
    for name in ("pull_force", "jaw_pull_force", "pull_work", "pull_energy"):
        assert other[name] == pytest.approx(2 * stuck[name], rel=1e-6)


@pytest.mark.parametrize("way", [[0, 2, 0], pytest.param([1, -1, 0], marks=pytest.mark.nightly)], ids=["y", "across"])
def test_a_pull_along_any_direction_is_one_along_x(way, stuck):
    """A ball on a square box has no direction that it prefers."""
    found = pulled(STICKS | {"pull_direction": way}, mesh=ROUGH)
    # On this mesh bars are 25 %.
    assert found["pull_force"] == pytest.approx(stuck["pull_force"], rel=5e-2)
    assert found["pull_work"] == pytest.approx(stuck["pull_work"], rel=5e-2)
    assert abs(found["jaw_torque"]) < 1e-5 * found["pull_force"]  # N m: a hundredth of the contact radius


def test_a_case_without_a_pull_keeps_its_key():
    plain, pull = (make_plan(parse(grasp(BALL | keys, body=SIDES))) for keys in ({"friction": MU}, SLIPS))
    again = make_plan(parse(grasp(BALL | {"friction": MU, "pull_direction": [0, 1, 0]}, body=SIDES)))
    assert plain.keys == again.keys
    assert plain.keys != pull.keys


def test_the_dataset_has_the_force_against_the_pull():
    plan = make_plan(parse(grasp(STICKS | {"pull": ["0.02 mm", "0.04 mm"]}, body=SIDES, mesh=ROUGH)))
    found = build(plan, compute(plan, MPI.COMM_SELF))
    assert found["pull_force"].dims == ("pull",)
    small, large = found["pull_force"].values
    assert large == pytest.approx(2 * small, rel=1e-5)  # nothing slides or leaves
    assert (found["pull_force_error"] > 0).all()
    assert found["slip_whole"].isnull().all()


@pytest.mark.parametrize(
    "material", [{}, pytest.param(LARGE, marks=pytest.mark.nightly)], ids=["linear", "large displacements"]
)
def test_a_longer_pull_goes_on_from_a_shorter_one(material):
    pulls = {"pull": ["0.1 mm", "0.2 mm"]}
    plan = make_plan(parse(grasp(SLIPS | pulls, body=SIDES, material=material, mesh=ROUGH)))
    (step,) = plan.meshes
    assert [len(operator.solves) for operator in step.operators] == [2]
    both = compute(plan, MPI.COMM_SELF)
    found, alone = both[plan.keys[1]], closed(SLIPS, body=SIDES, material=material, mesh=ROUGH)
    assert found.force == pytest.approx(alone.force, rel=1e-3)
    for name in ("pull_force", "jaw_pull_force", "friction_work", "pull_work", "slip_whole_force"):
        assert found.largest[name] == pytest.approx(alone.largest[name], rel=2e-2), name
    for name in ("pull_force", "slip_whole"):
        assert abs(found.largest[name] - alone.largest[name]) <= found.largest[f"{name}_error"]
    assert found.iterations < 0.9 * alone.iterations


@pytest.mark.nightly
def test_jaws_close_to_a_force_and_are_then_pulled(linear):
    force = linear["closed_force"]
    plan = make_plan(parse(grasp(NEAR | {"force": f"{force} N", "friction": MU, "pull": "0.2 mm"}, body=SIDES)))
    found = build(plan, compute(plan, MPI.COMM_SELF))
    assert float(found["closed_force"]) == pytest.approx(force, rel=1e-9)
    # Each depth has a mesh of its own.
    assert float(found["depth"]) == pytest.approx(0.3e-3, abs=float(found["depth_error"]))
    assert float(found["pull_force"]) == pytest.approx(linear["pull_force"], rel=2e-2)


@pytest.mark.parametrize("has_closed", [False, True], ids=["closing ended", "the pull ended"])
def test_only_jaws_that_have_closed_have_a_trial_force(has_closed):
    plan = make_plan(parse(grasp(NEAR | {"force": "6 mN", "friction": MU, "pull": "0.2 mm"}, body=SIDES)))
    plan = with_depths(plan, {})
    (key,), case = plan.keys, plan.study.case(())
    scale, depth = plan.scale_of(case), case.probe.depth
    reached = depth if has_closed else depth / 2
    ended = Record(key, PARTIAL, young=scale.stress, depth=scale.length, depth_reached=reached, force_reached=3e-3)
    after = with_depths(plan, {key: ended})
    if has_closed:
        assert after.study.case(()).probe.depth > depth
    else:
        assert "load steps end there" in after.depths_at_force[()].message
        assert after.depths_at_force[()].depth == reached


def test_a_pull_that_leaves_its_contact_is_partial():
    found = closed(BALL | {"friction": MU, "pull": "5 mm"}, body=SIDES, material=LARGE)
    assert found.status == "partial"
    assert "the pull reached" in found.message
    before = closed(BALL | {"friction": MU}, body=SIDES, material=LARGE)
    assert found.depth_reached == pytest.approx(0.3e-3)
    assert found.force_reached == pytest.approx(before.force, rel=3e-3)  # in half as many steps


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (grasp(BALL | {"pull": "1 mm"}, body=SIDES), "give friction"),
        (grasp(SLIPS), "give body.fixed"),
        (raw(probe=SLIPS), "add a second [[probe]] table"),
        (grasp(SLIPS | {"pull_direction": [0, 0, 1]}, body=SIDES), "across their axis"),
        (grasp(SLIPS | {"pull_direction": [0, 0, 0]}, body=SIDES), "probe[1].pull_direction"),
        (grasp(SLIPS | {"pull": "30 mm"}, body=SIDES), "over the edge of their faces"),
        (grasp(SLIPS | {"pull": "0 mm"}, body=SIDES), "greater than 0"),
        (grasp(BALL | {"friction": MU}, {"pull": "1 mm"}, body=SIDES), "probe[2].pull"),
    ],
)  # fmt: skip
def test_what_is_not_computed_is_refused(content, said):
    assert said in refusal(content)


@pytest.mark.mpi
def test_ranks_agree():
    alone, both = (pulled(SLIPS, comm=comm, mesh=ROUGH) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    for name in ("pull_force", "jaw_pull_force", "slip_whole", "friction_work"):
        assert both[name] == pytest.approx(alone[name], rel=1e-6)
