"""Two opposite jaws: symmetry, work, balance, friction, and what they do not hold."""

from typing import Any

import pytest
from mpi4py import MPI

from epsmesh.fitted import FRICTION
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.study.read import parse
from tests.cases import raw, refusal, solve

DISC: dict[str, Any] = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "contact": "unilateral"}
BALL: dict[str, Any] = {"shape": "sphere", "radius": "5 mm", "depth": "0.3 mm", "contact": "unilateral"}
# A ball without a depth.
NEAR = {key: value for key, value in BALL.items() if key != "depth"}
BLADE: dict[str, Any] = {
    "shape": "blade", "length": "10 mm", "width": "3 mm", "depth": "0.1 mm", "contact": "unilateral",
}  # fmt: skip
LARGE = {"law": "neo-hookean", "poisson": 0.4}
FINE = {"rim": "0.3 mm", "growth": 0.5, "fine": "3 mm"}
LIGHT = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}


OVAL = {"shape": "ellipsoid", "size": None, "axes": ["20 mm"] * 3, "fixed": {"below": "-15 mm"}}
SIDE = ["20 mm", "0 mm", "-10 mm"]


def grasp(first: dict[str, Any], second: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """Return a study of two jaws; of the second one, only what differs from the first."""
    content = raw(**{"body": {"fixed": "none"}} | changes)
    content["probe"] = [first | {"together": "grasp"}, (second or {}) | {"together": "grasp"}]
    return content


def closed(*jaws: Any, comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one grasp."""
    plan = make_plan(parse(grasp(*jaws, **changes)))
    (record,) = compute(plan, comm).values()
    return record


def half_of(tool: dict[str, Any], **changes: Any) -> Any:
    """Return the record of a tool on the half of the body, on a smooth plane from which its weight keeps it."""
    content: dict[str, Any] = {"load": LIGHT, "probe": tool} | changes
    content["material"] = {"density": "1000 kg/m^3"} | changes.get("material", {})
    body = {"size": ["40 mm", "40 mm", "10 mm"], "fixed": "none", "support": {"on": "bottom", "friction": 0}}
    (record,) = solve(body=body, **content).values()
    assert record.status == "ok", record.message
    return record


@pytest.mark.parametrize(
    ("jaw", "material"),
    [
        pytest.param(DISC, {}, id="disc"),
        pytest.param(BLADE, {}, id="blade", marks=pytest.mark.nightly),
        pytest.param(BALL, {}, id="ball"),
        pytest.param(BALL | {"depth": "0.8 mm"}, LARGE, id="large", marks=pytest.mark.nightly),
    ],
)
def test_a_symmetric_grasp_is_twice_a_tool_on_half_of_the_body_on_a_smooth_plane(jaw, material):
    found, half = closed(jaw, mesh=FINE, material=material), half_of(jaw, mesh=FINE, material=material)
    # Both meshes have errors of their own, and weight compresses the half, and bends it.
    assert found.force == pytest.approx(half.force, rel=5e-3 if material else 2e-3)
    assert found.contact_area == pytest.approx(half.contact_area, rel=1e-2)
    assert found.energy == pytest.approx(2 * half.energy, rel=5e-3)
    assert found.largest["jaw_force"] == pytest.approx(found.force, rel=1e-7)
    assert found.balance < 1e-7


@pytest.mark.parametrize(
    "material", [{}, pytest.param({"poisson": 0.49}, marks=pytest.mark.nightly)], ids=["displacement", "mixed"]
)
def test_the_work_of_both_jaws_is_the_energy(material):
    """Forces of sharp jaws are proportional to their depths, and the sides carry what differs."""
    body = {"fixed": "sides", "layer": [{"name": "skin", "thickness": "4 mm", "young": "30 kPa", "poisson": 0.3}]}
    found = closed(DISC, {"depth": "0.3 mm"}, body=body, material=material)
    work = (found.force * 0.2e-3 + found.largest["jaw_force"] * 0.3e-3) / 2
    assert found.energy == pytest.approx(work, rel=1e-6)
    assert abs(found.force / found.largest["jaw_force"] - 1) > 1e-3
    assert found.balance < 1e-7


def test_it_does_not_matter_which_jaw_is_the_first():
    one, other = closed(DISC, BALL, mesh=FINE), closed(BALL, DISC, mesh=FINE)
    assert one.force == pytest.approx(other.force, rel=2e-3)
    assert one.contact_area == pytest.approx(other.largest["jaw_contact_area"], rel=2e-3)
    assert one.largest["jaw_contact_area"] == pytest.approx(other.contact_area, rel=2e-2)


def test_a_jaw_far_from_the_other_is_a_tool_alone():
    """Of a deep body with fixed sides, each jaw has the force of the tool alone, but for what the other one moves."""
    body = {"size": ["40 mm", "40 mm", "60 mm"], "fixed": "sides"}
    both, (alone,) = closed(BALL, body=body, mesh=FINE), solve(probe=BALL, body=body, mesh=FINE).values()
    assert both.force == pytest.approx(alone.force, rel=both.force_error + alone.force_error)
    assert both.force == pytest.approx(alone.force, rel=1e-2)


def test_jaws_on_the_sides_are_jaws_on_top_and_bottom_of_the_body_turned():
    size = {"size": ["20 mm", "40 mm", "40 mm"], "fixed": "bottom"}
    side = closed(BALL | {"at": ["10 mm", "0 mm", "-20 mm"]}, body=size, mesh=FINE)
    top = closed(BALL, mesh=FINE)
    assert side.force == pytest.approx(top.force, rel=3e-3)
    x, _, z = (side.largest[f"jaw_force_vector_{axis}"] for axis in "xyz")
    assert x == pytest.approx(-side.largest["jaw_force"], rel=1e-9)
    assert abs(z) < 1e-9 * abs(x)


@pytest.mark.parametrize("material", [{}, LARGE], ids=["linear", "large"])
def test_friction_is_between_none_and_sticking(material):
    smooth, rubs, sticks = (closed(BALL | {"friction": friction}, material=material) for friction in (0, 0.1, "stick"))
    assert smooth.force < rubs.force < sticks.force
    assert rubs.slip_area > 0
    assert rubs.largest["jaw_force"] == pytest.approx(rubs.force, rel=1e-7)
    assert rubs.torque == rubs.largest["jaw_torque"] == 0.0


def test_the_bar_of_a_jaw_contains_what_friction_adds_to_its_own_force():
    """Friction adds more to the force of a disc than to that of a ball: the disc's bar is wider, whichever is first."""
    second = {"shape": "disc", "radius": "3 mm"}
    rubs, smooth = (
        closed(BALL | {"friction": friction}, second, body={"fixed": "sides"}, mesh={"rim": "1 mm"})
        for friction in (0.3, 0)
    )
    added = rubs.largest["jaw_force"] / smooth.largest["jaw_force"] - 1
    assert added > 1.5 * (rubs.force / smooth.force - 1)
    bar, of_smooth = (found.largest["jaw_force_error"] / found.largest["jaw_force"] for found in (rubs, smooth))
    assert bar - of_smooth > FRICTION * added


def test_with_friction_lateral_forces_of_jaws_and_sides_balance():
    """Off the middle, tissue drags both jaws; without friction it does not."""
    found = closed(BALL | {"friction": 0.3, "at": ["6 mm", "0 mm"]}, {"depth": "0.5 mm"}, body={"fixed": "sides"})
    assert abs(found.largest["jaw_force_vector_x"]) > 1e-4 * found.force
    assert found.largest["jaw_force_vector_y"] == 0.0
    assert found.balance < 1e-7


def test_the_dataset_has_both_jaws():
    plan = make_plan(parse(grasp(BALL | {"depth": ["0.2 mm", "0.4 mm"], "friction": "stick"})))
    dataset = build(plan, compute(plan, MPI.COMM_SELF))
    assert dataset["jaw_force"].dims == ("depth",)
    assert (abs(dataset["jaw_force"] / dataset["force"] - 1) < 1e-7).all()
    assert (dataset["jaw_force_vector"].sel(component="z") < 0).all()
    for name in ("jaw_force_error", "jaw_contact_area", "jaw_contact_area_error"):
        assert (dataset[name] > 0).all()


def test_jaws_close_to_a_force():
    """The depth at the force is the one at which jaws that close by it have the force."""
    plan = make_plan(parse(grasp(NEAR | {"force": "10 mN"}, {"radius": "3 mm"})))
    found = build(plan, compute(plan, MPI.COMM_SELF))
    depth = float(found["depth"])
    again = closed(BALL | {"depth": f"{depth} m"}, {"radius": "3 mm"})
    assert float(found["jaw_force"]) == pytest.approx(10e-3, rel=1e-6)  # nothing else holds the body
    # Each depth has a mesh of its own.
    assert again.force == pytest.approx(10e-3, rel=again.force_error)
    assert 0 < float(found["depth_error"]) < 0.1 * depth


def test_a_body_that_jaws_do_not_hold_fails_and_says_along_which_axis():
    found = closed(BALL | {"at": ["3 mm", "0 mm"]})
    assert found.status == "failed"
    assert "its jaws let it move along x" in found.message


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (grasp(DISC | {"contact": "bonded"}), "contacts of both jaws are found together"),
        (grasp(BALL, DISC | {"contact": "bonded"}), 'probe[2].contact = "bonded": must be "unilateral" in a grasp'),
        (grasp(BALL, material={"density": "1000 kg/m^3"}, load=LIGHT), "before both jaws touch it"),
        (grasp(DISC | {"edge": "0.5 mm"}, {"edge": 0.0}, material=LARGE), "edge"),
        (grasp(DISC, material=LARGE), "rounded edge"),
        (grasp(BALL | {"history": {"ramp": "1 s", "hold": "1 s"}}, material=LARGE), "two jaws do not close"),
        (grasp(BALL | {"at": ["19 mm", "0 mm"]}), "inside"),
        (grasp(BALL, {"radius": "80 mm", "depth": "2 mm"}, body={"fixed": "sides"}), "second jaw"),
        (grasp(BALL, {"at": ["1 mm", "0 mm"]}), "probe[2].at"),
        (grasp(BALL, {"depth": ["0.1 mm", "0.2 mm"]}), "sweep it in the first table"),
        (grasp(BALL, {"young": "5 kPa", "poisson": 0.3}), "probe[2].young"),
        (grasp(BALL, {"shape": "hook"}), "unknown shape"),
        (grasp(BALL, {"shape": "disc"}), "radius"),
        (grasp(BALL, {"colour": "red"}), "unknown key"),
        (grasp(NEAR | {"force": "1 N"}, {"depth": "1 mm"}), "probe[2].depth"),
        (grasp(NEAR, {"depth": "1 mm", "force": "1 N"}), "probe[2].force"),
        (grasp(BALL | {"force": "1 N"}), "give one of both"),
        (grasp(BALL | {"depth": "12 mm"}), "of both jaws together"),
        (grasp(BALL | {"at": SIDE}, body={"fixed": "none", "support": {"on": "bottom"}}), "with two jaws"),
        (grasp(BALL, body={"fixed": "bottom"}), "support"),
        (grasp(BALL, body=OVAL), "plane face"),
        (raw(probe=BALL | {"together": "grasp"}), "needs a second [[probe]] table"),
    ],
)  # fmt: skip
def test_what_is_not_computed_is_refused(content, said):
    assert said in refusal(content)


@pytest.mark.mpi
def test_ranks_agree():
    alone, both = (
        closed(BALL, {"depth": "0.5 mm"}, comm=comm, material=LARGE) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["jaw_contact_area"] == pytest.approx(alone.largest["jaw_contact_area"], rel=1e-6)


def test_the_bar_of_a_jaw_knows_its_sharp_end_as_that_of_a_tool_does():
    """Of two sharp discs that press nearly alike the bars are alike, too."""
    found = closed(DISC, {"depth": "0.201 mm"})
    bar = found.largest["jaw_force_error"] / found.largest["jaw_force"]
    assert 0.8 * found.force_error < bar < 1.5 * found.force_error


def test_a_rounded_jaw_opposite_a_sharp_one_on_a_free_body_has_its_bar():
    """The body hands on the error of the sharp one: if nothing else holds it, both forces are one."""
    found = closed(DISC, {"edge": "1 mm"}, body={"fixed": "none"})
    assert found.largest["jaw_force"] == pytest.approx(found.force, rel=1e-8)
    bar = found.largest["jaw_force_error"] / found.largest["jaw_force"]
    assert bar == pytest.approx(found.force_error, rel=0.02)
    other = closed(DISC | {"edge": "1 mm"}, {"edge": "0 mm"}, body={"fixed": "none"})
    assert other.force_error > 0.8 * found.force_error
    finer = closed(DISC, {"edge": "1 mm"}, body={"fixed": "none"}, mesh={"rim": "0.3 mm", "growth": 0.5, "degree": 3})
    assert abs(found.force / finer.force - 1) < found.force_error < 0.06
