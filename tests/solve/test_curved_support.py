"""Bodies that rest on a ball or a cylinder, or in a hollow one: limits, equivalent scenes, balances."""

from typing import Any

import numpy as np
import pytest

from tests.cases import ROUGH, raw, refusal
from tests.solve.test_support import BALL, GRAVITY, HEAVY, LARGE, WEIGHT, on, one

MATERIALS = pytest.mark.parametrize("material", [{}, LARGE], ids=["linear", "large"])
SHAPES = [(shape, hollow) for shape in ("sphere", "cylinder") for hollow in (False, True)]
RADII = {"sphere": "150 mm", "cylinder": "100 mm"}
FINE = {"fine": "3 mm", "coarse": "3 mm", "rim": "0.6 mm", "growth": 0.6}


def on_a(shape: str, radius: str, friction: float | str = 0, **more: Any) -> dict[str, Any]:
    """Return a body that rests on a round support, or with `hollow` in it."""
    keys = {key: more.pop(key) for key in ("hollow", "direction") if key in more}
    return {
        "fixed": "none",
        "support": {"on": "bottom", "shape": shape, "radius": radius, "friction": friction, **keys},
    } | more


@MATERIALS
@pytest.mark.parametrize(("shape", "hollow"), SHAPES)
def test_a_support_of_large_radius_is_a_plane(shape, hollow, material):
    changes = {"probe": BALL, "material": material | HEAVY["material"], "load": GRAVITY, "mesh": ROUGH}
    flat, wide = (one(body=body, **changes) for body in (on(), on_a(shape, "1 km", hollow=hollow)))
    assert wide.status == "ok", wide.message
    assert wide.force == pytest.approx(flat.force, rel=1e-5)


@MATERIALS
def test_a_ball_that_is_a_support_is_one_that_is_a_jaw(material):
    """Two equal balls close by half of the depth each; a ball that stays where it is has the same force."""
    ball = {"shape": "sphere", "radius": "12 mm", "contact": "unilateral"}
    jaws = [ball | {"depth": "1 mm", "together": "grasp"}, {"together": "grasp"}]
    changes = {"material": material, "mesh": FINE}
    grasped = one(probe=jaws, body={"fixed": "none"}, **changes)
    rests = one(probe=ball | {"depth": "2 mm"}, body=on_a("sphere", "12 mm"), **changes)
    assert rests.status == "ok", rests.message
    bar = rests.force_error * rests.force + grasped.force_error * grasped.force
    assert abs(rests.force - grasped.force) < bar < 0.1 * grasped.force
    assert rests.largest["support_force"] == pytest.approx(rests.force, rel=1e-7)


@MATERIALS
@pytest.mark.parametrize(("shape", "hollow", "friction"), [(*kind, 0) for kind in SHAPES] + [("sphere", False, 0.2)])
def test_forces_of_tool_support_and_weight_balance(shape, hollow, friction, material):
    body = on_a(shape, RADII[shape], friction, hollow=hollow)
    found = one(
        probe=BALL, body=body, material=material | HEAVY["material"], load=GRAVITY, mesh=ROUGH if friction else {}
    )
    assert found.status == "ok", found.message
    assert found.balance < 1e-6
    assert found.largest["support_force"] == pytest.approx(found.force + WEIGHT, rel=1e-5)
    assert found.largest["lift_off_area"] > 0


def test_a_cylinder_along_x_is_one_along_y_of_a_body_that_is_turned():
    size, turned = ["40 mm", "30 mm", "15 mm"], ["30 mm", "40 mm", "15 mm"]
    along_x = one(probe=BALL, body=on_a("cylinder", "40 mm", size=size), mesh=FINE)
    along_y = one(probe=BALL, body=on_a("cylinder", "40 mm", size=turned, direction=[0, 2, 0]), mesh=FINE)
    assert along_y.force == pytest.approx(along_x.force, rel=5e-3)
    across = one(probe=BALL, body=on_a("cylinder", "40 mm", size=turned), mesh=FINE)
    assert across.force < 0.998 * along_x.force


def test_the_smaller_the_ball_below_the_softer_the_body():
    bodies = [on_a("sphere", radius) for radius in ("10 mm", "30 mm", "100 mm")]
    forces = [one(probe=BALL, body=body, mesh=FINE).force for body in (*bodies, on())]
    assert forces == sorted(forces)


@MATERIALS
def test_friction_of_a_round_support_is_between_none_and_sticking(material):
    changes = {"probe": BALL, "material": material | HEAVY["material"], "load": GRAVITY, "mesh": ROUGH}
    smooth, least, some, stuck = (
        one(body=on_a("sphere", "60 mm", friction), **changes) for friction in (0, 1e-3, 0.1, "stick")
    )
    assert all(found.status == "ok" for found in (smooth, least, some, stuck))
    assert least.force == pytest.approx(smooth.force, rel=3e-3)
    assert smooth.force < some.force
    assert smooth.force < stuck.force
    assert np.isnan(some.largest["support_slip"])


def test_a_finer_mesh_is_within_the_error_bars():
    changes = {"probe": BALL, "body": on_a("cylinder", "25 mm"), **HEAVY}
    coarse, fine = (one(mesh=mesh, **changes) for mesh in ({}, FINE | {"rim": "0.4 mm"}))
    assert abs(coarse.force - fine.force) < coarse.force_error * coarse.force + fine.force_error * fine.force
    bars = [found.largest["lift_off_area_error"] for found in (coarse, fine)]
    assert abs(coarse.largest["lift_off_area"] - fine.largest["lift_off_area"]) < sum(bars)


def test_a_support_that_nodes_are_too_far_apart_to_press_on_is_named():
    """Corners of elements of degree 2 press only with their neighbours, which are above a hollow ball."""
    found = one(probe=BALL, body=on_a("sphere", "90 mm", hollow=True))
    assert found.status == "failed"
    assert "next to the support that may press on it are 0.55 mm above it" in found.message
    assert "probe" not in found.message


@pytest.mark.parametrize(
    ("support", "probe", "said"),
    [
        ({"shape": "sphere"}, {}, "body.support.radius: is required for a sphere"),
        ({"radius": "30 mm"}, {}, "a plane has no radius"),
        ({"shape": "sphere", "radius": "30 mm", "direction": [0, 1, 0]}, {}, "a sphere has no direction"),
        ({"shape": "cylinder", "radius": "30 mm", "direction": [1, 1, 0]}, {}, "must be along x or y"),
        ({"shape": "sphere", "radius": "30 mm", "hollow": True}, {}, "must be at least 56.57 mm"),
        ({"shape": "cylinder", "radius": "30 mm", "hollow": True}, {}, "must be at least 40 mm"),
        ({"shape": "sphere", "radius": "90 mm", "hollow": True, "friction": 0.2}, {}, "must be 0 in a hollow support"),
        ({"shape": "sphere", "radius": "30 mm"}, {"at": ["2 mm", "0 mm"]}, "on which the body would roll"),
        ({"shape": "box", "radius": "30 mm"}, {}, "body.support.shape"),
    ],
)
def test_what_is_not_computed_is_refused(support, probe, said):
    body = {"fixed": "none", "support": {"on": "bottom", **support}}
    assert said in refusal(raw(body=body, probe=BALL | probe))
