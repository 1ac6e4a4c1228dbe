"""A support that lets go: closed forms, limits, balances, and bodies that float."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.solve.contact.turned_tangent import tolerance_on_bed
from tests import organs
from tests.cases import ROUGH, raw, refusal, solve
from tests.verification import known

BALL: dict[str, Any] = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}
LARGE = {"law": "neo-hookean", "poisson": 0.4}
GRAVITY = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
DENSITY = 1060.0
WEIGHT = DENSITY * 9.81 * 40e-3 * 40e-3 * 20e-3
HEAVY = {"material": {"density": f"{DENSITY} kg/m^3"}, "load": GRAVITY}


CYST_OF_TISSUE = {"name": "cyst", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "3 mm", "young": "20 kPa", "poisson": 0.4}
TAUT = {"young": "0.2 MPa", "thickness": "0.1 mm", "poisson": 0.4, "tension": "1 N/m"}
CYST = {"name": "cyst", "file": "ball.stl", "unit": "mm", "hollow": True, "pressure": "0.5 kPa"}


def on(friction: float | str = 0, **more: Any) -> dict[str, Any]:
    """Return a body that rests on its bottom."""
    return {"fixed": "none", "support": {"on": "bottom", "friction": friction}, **more}


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one case."""
    (record,) = solve(comm, **changes).values()
    return record


@pytest.mark.parametrize("rubs", [False, True])
def test_a_linear_solve_is_done_though_less_is_left_than_needed(rubs):
    """PETSc refuses a tolerance of 1 and more."""
    rough = tolerance_on_bed(1.0, rubs=rubs, is_tried=True)
    assert rough <= 1e-3
    for enough in (0.5, 5.0, 1e9):
        assert tolerance_on_bed(enough, rubs=rubs, is_tried=False) == rough
    assert tolerance_on_bed(1e-12, rubs=rubs, is_tried=False) == (1e-6 if rubs else 1e-8)


def test_a_layer_that_is_pressed_at_a_point_lifts_off_at_the_radius_of_theory_at_any_load():
    thick, radius = 10e-3, 40e-3
    body = on(shape="cylinder", radius="40 mm", height="10 mm", size=None)
    mesh = {"rim": "0.1 mm", "growth": 0.3, "fine": "3 mm"}
    touching = []
    for depth in ("0.05 mm", "0.1 mm"):
        found = one(body=body, probe=BALL | {"radius": "2 mm", "depth": depth}, mesh=mesh)
        touching.append(np.pi * radius**2 - found.largest["lift_off_area"])
        assert found.balance < 1e-8
        assert found.largest["support_force"] == pytest.approx(found.force, rel=1e-8)
    measured, theory = np.sqrt(touching[1] / np.pi) / thick, known.receding_radius()
    assert theory == pytest.approx(1.0935, rel=2e-3)
    assert measured == pytest.approx(theory, rel=0.015)
    assert found.largest["lift_off_area_error"] > abs(touching[1] - np.pi * (theory * thick) ** 2)
    assert touching[0] == pytest.approx(touching[1], rel=5e-3)


@pytest.mark.parametrize("material", [{}, LARGE, LARGE | {"poisson": 0.49}], ids=["linear", "large", "mixed"])
@pytest.mark.parametrize("load", [{}, HEAVY], ids=["light", "heavy"])
def test_a_body_that_sticks_and_lifts_nowhere_is_one_that_is_fixed(load, material):
    changes = {key: dict(value) for key, value in load.items()}
    changes["material"] = material | changes.get("material", {})
    fixed, rests = (one(probe=BALL, body=body, **changes) for body in ({}, on("stick")))
    assert rests.force == pytest.approx(fixed.force, rel=1e-7)
    assert rests.contact_area == pytest.approx(fixed.contact_area, rel=1e-7)
    assert rests.largest["lift_off_area"] < 1e-9 * 40e-3**2
    assert rests.largest["support_force"] == pytest.approx(rests.force + bool(load) * WEIGHT, rel=1e-8)


@pytest.mark.parametrize("tension_only", [False, True])
def test_a_capsule_within_the_body_holds_it_no_more_than_the_support_does(tension_only):
    """It resists no motion of the whole body; off the centre, no plane of symmetry does either."""
    capsule = {"young": "0.2 MPa", "thickness": "0.1 mm", "poisson": 0.4, "tension_only": tension_only}
    cyst = {"name": "cyst", "at": ["6 mm", "3 mm", "-8 mm"], "radius": "3 mm", "young": "20 kPa"}
    cyst |= {"poisson": 0.4, "capsule": capsule}
    fixed, rests = (one(probe=BALL, body=body | {"inclusion": [cyst]}, mesh=ROUGH) for body in ({}, on("stick")))
    assert rests.force == pytest.approx(fixed.force, rel=1e-6)
    assert "floats" in one(probe=BALL, body=on() | {"inclusion": [cyst]}, mesh=ROUGH).message


@pytest.mark.parametrize("material", [{}, LARGE], ids=["linear", "large"])
def test_friction_of_the_support_is_between_none_and_sticking(material):
    smooth, least, some, more, most, stuck = (
        one(probe=BALL, body=on(friction), material=material, mesh=ROUGH | {"fine": "7 mm", "coarse": "7 mm"})
        for friction in (0, 1e-3, 0.1, 0.3, 2.0, "stick")
    )
    assert smooth.force < least.force < some.force < more.force < most.force
    assert least.force == pytest.approx(smooth.force, rel=1e-4)
    assert most.force == pytest.approx(stuck.force, rel=1e-7)
    assert more.balance < 1e-8
    lifted = [each.largest["lift_off_area"] for each in (smooth, least, some, more)]
    assert lifted == sorted(lifted, reverse=True)


@pytest.mark.parametrize("material", [{}, LARGE], ids=["linear", "large"])
def test_a_heavy_body_settles_with_friction_before_the_tool_comes(material):
    material = material | {"density": f"{DENSITY} kg/m^3"}
    smooth, least, some, most, stuck = (
        one(probe=BALL, body=on(friction), material=material, load=GRAVITY, mesh=ROUGH)
        for friction in (0, 1e-3, 0.05, 2.0, "stick")
    )
    assert smooth.force < some.force < stuck.force
    assert least.force == pytest.approx(smooth.force, rel=1e-3)
    assert most.force == pytest.approx(stuck.force, rel=1e-4)
    for found in (least, some, most):
        assert found.balance < 1e-7
        assert found.largest["support_force"] == pytest.approx(found.force + WEIGHT, rel=1e-6)
    slips = [found.largest["support_slip"] for found in (stuck, some, least, smooth)]
    assert slips == sorted(slips)
    assert slips[0] == 0.0
    assert some.load_energy < smooth.load_energy  # friction spares the tissue a part of the work of its weight


@pytest.mark.parametrize(("friction", "holds"), [(0.3, True), pytest.param(0.1, False, marks=pytest.mark.nightly)])
def test_a_body_slides_down_a_table_that_is_steeper_than_friction(friction, holds):
    """Coulomb's: it slides where the tangent of the slope, here 0.123, is larger than the coefficient."""
    slope = np.radians(7)
    gravity = [f"{9.81 * np.sin(slope):.9g} m/s^2", "0 m/s^2", f"{-9.81 * np.cos(slope):.9g} m/s^2"]
    found = one(probe=BALL, body=on(friction), material=HEAVY["material"], load={"gravity": gravity}, mesh=ROUGH)
    assert (found.status == "ok") == holds, found.message
    if holds:
        assert found.largest["support_force"] == pytest.approx(found.force + WEIGHT * np.cos(slope), rel=1e-6)
    else:
        assert "does not settle on its support" in found.message


def test_friction_holds_a_heavy_body_that_is_pressed_beside_its_middle():
    probe = BALL | {"at": ["6 mm", "0 mm"]}
    some, stuck = (one(probe=probe, body=on(friction), mesh=ROUGH, **HEAVY) for friction in (0.3, "stick"))
    assert some.status == "ok", some.message
    assert 0.9 * stuck.force < some.force <= (1 + 1e-6) * stuck.force
    assert some.largest["support_slip"] > stuck.largest["support_slip"] == 0.0
    assert np.isnan(some.largest["support_slip_error"])
    assert some.balance < 1e-7


def test_tissue_that_is_pressed_from_above_slides_by_poissons_ratio():
    """A uniform pressure on the top squeezes the body sideways by ν q / E, without friction and homogeneously."""
    pressed = {"traction": [{"on": "top", "pressure": "0.2 kPa"}]}
    found = one(probe=BALL | {"depth": "0.1 mm"}, body=on(), load=pressed)
    assert found.largest["support_slip"] == pytest.approx(0.3 * 200 / 10e3 * np.hypot(20e-3, 20e-3), rel=3e-3)


@pytest.mark.nightly
def test_steps_of_the_loads_are_in_the_error_bars():
    """The path is followed in steps: with half of them, force and slip change by less than the bars."""
    changes = {"probe": BALL, "body": on(0.05), **HEAVY}
    found = one(**changes)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("epsmesh.solve.contact.large.LargeContact.STEPS", 32)
        finer = one(**changes)
    assert abs(finer.force - found.force) < found.force_error * found.force
    for name in ("support_slip", "lift_off_area"):
        assert abs(finer.largest[name] - found.largest[name]) <= found.largest[f"{name}_error"]


@pytest.mark.parametrize("material", [{}, LARGE], ids=["linear", "large"])
def test_friction_of_the_tool_is_that_on_a_fixed_body(material):
    fixed, rests = (one(probe=BALL | {"friction": 0.3}, body=body, material=material) for body in ({}, on("stick")))
    # Both searches end where Coulomb's law holds within a tolerance, which is 1e-4 of F on some meshes.
    assert rests.force == pytest.approx(fixed.force, rel=3e-4)
    assert rests.friction_force == pytest.approx(fixed.friction_force, rel=1e-3)


def test_a_smooth_support_is_softer_and_weight_presses_a_body_on():
    stuck, smooth, heavy = (
        one(probe=BALL, body=on("stick")),
        one(probe=BALL, body=on()),
        one(probe=BALL, body=on(), **HEAVY),
    )
    assert smooth.force < stuck.force
    assert smooth.largest["lift_off_area"] > smooth.largest["lift_off_area_error"]
    assert heavy.largest["lift_off_area"] == pytest.approx(0, abs=1e-12)
    assert heavy.largest["support_force"] == pytest.approx(heavy.force + WEIGHT, rel=1e-8)


def test_an_end_that_is_pressed_lifts_the_other_and_forces_turn_no_body():
    """A slice pressed near one end lifts off at the other: all forces are below the tool."""
    slice_ = on("stick", size=["40 mm", "16 mm", "8 mm"])
    found = one(probe=BALL | {"radius": "3 mm", "at": ["12 mm", "0 mm"]}, body=slice_, mesh={"fine": "3 mm"})
    assert found.largest["lift_off_area"] > 0.3 * 40e-3 * 16e-3
    assert found.largest["lift_off_area_error"] < found.largest["lift_off_area"]
    assert found.largest["support_force"] == pytest.approx(found.force, rel=1e-8)


def test_the_work_of_the_tool_is_the_energy():
    shares = np.linspace(0, 1, 5)[1:]
    depths = [f"{0.5 * share**2:.6g} mm" for share in shares]
    probe = BALL | {"depth": depths, "mesh_depths": [depths[0], depths[-1]]}
    found = [record for _, record in sorted(solve(probe=probe, body=on(), mesh={"rim": "0.3 mm"}).items())]
    # With d = t², F dd = 2 t F dt: Simpson's rule in t.
    slopes = [0.0, *(2 * 0.5e-3 * share * record.force for share, record in zip(shares, found, strict=True))]
    work = (slopes[0] + 4 * slopes[1] + 2 * slopes[2] + 4 * slopes[3] + slopes[4]) / 12
    assert work == pytest.approx(found[-1].energy, rel=0.01)


def test_an_inclined_tool_that_lifts_nothing_presses_as_on_a_fixed_body():
    probe = BALL | {"axis": [0.1045, 0.0, -0.9945]}
    material = LARGE | {"density": f"{DENSITY} kg/m^3"}
    fixed, rests = (one(probe=probe, body=body, material=material, load=GRAVITY) for body in ({}, on("stick")))
    assert rests.force == pytest.approx(fixed.force, rel=1e-7)
    along = rests.force_vector[2] + WEIGHT  # the force on the tool is that on the body, reversed
    assert rests.largest["support_force"] == pytest.approx(along, rel=1e-7)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body": on(), "probe": BALL | {"at": ["3 mm", "0 mm"]}}, "lets it move along x"),
        ({"body": on(0.3), "probe": BALL | {"at": ["3 mm", "0 mm"]}}, "lets it move along x"),
        (
            {"body": on("stick"), "probe": BALL, **HEAVY, "load": {"gravity": ["0 m/s^2", "0 m/s^2", "9.81 m/s^2"]}},
            "does not settle on its support",
        ),
    ],
    ids=["slides away", "is not pressed on", "falls up"],
)
def test_a_body_that_floats_fails_with_what_does_not_hold_it(changes, said):
    found = one(**changes)
    assert found.status == "failed"
    assert said in found.message


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {
                "body": on(0.3, inclusion=[CYST_OF_TISSUE | {"capsule": TAUT}]),
                "probe": BALL,
            },
            "with a capsule that is stretched before",
        ),
        ({"body": on() | {"fixed": "bottom"}}, 'must be "none" with [body.support]'),
        ({"body": on(), "probe": {"contact": "bonded"}}, "found together"),
        ({"body": on("stick"), "probe": BALL | {"history": {"ramp": "1 s", "hold": "1 s"}}}, "lifts off no support"),
        ({"body": on("stick", region=[CYST])}, "does not press the body on"),
        ({"body": {"shape": "ellipsoid", "size": None, "axes": ["30 mm"] * 3} | on()}, "an ellipsoid has no support"),
    ],
    ids=["stretched before", "fixed", "bonded", "in time", "pressed within", "ellipsoid"],
)
def test_what_is_not_computed_is_refused(changes, said, tmp_path, monkeypatch):
    points, facets = organs.sphere(8)
    organs.write_stl(tmp_path / "ball.stl", 3e-3 * points + np.array([-6e-3, -5e-3, -9e-3]), facets)
    monkeypatch.chdir(tmp_path)
    assert said in refusal(raw(**{"probe": BALL} | changes))


@pytest.mark.mpi
def test_ranks_agree():
    alone, both = (one(comm, probe=BALL, body=on(), material=LARGE) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["lift_off_area"] == pytest.approx(alone.largest["lift_off_area"], rel=1e-6)
