"""A loose layer: patch test, limits to bonded tissue and to a rigid support, balances, bars, and layers that float."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from tests.cases import ROUGH, raw, refusal, solve

BALL: dict[str, Any] = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}
GRAVITY = {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}
HEAVY: dict[str, Any] = {"material": {"density": "1060 kg/m^3"}, "load": GRAVITY}
FLAP: dict[str, Any] = {
    "name": "flap",
    "thickness": "8 mm",
    "young": "20 kPa",
    "poisson": 0.3,
    "density": "1060 kg/m^3",
}
WEIGHT = 1060 * 9.81 * 40e-3 * 40e-3 * 8e-3


def check_within_bars(coarse: Any, fine: Any) -> None:
    """Check that records of two meshes agree within the bars of both."""
    assert abs(coarse.force - fine.force) < coarse.force * coarse.force_error + fine.force * fine.force_error
    for name in ("interface_force", "lift_off_area"):
        bars = sum(each.largest[f"{name}_error"] for each in (coarse, fine))
        assert abs(coarse.largest[name] - fine.largest[name]) < bars


def flap(friction: float | str | None = 0, **more: Any) -> dict[str, Any]:
    """Return a body whose first layer is loose; it is bonded if there is no ``friction`` to give."""
    contact = {} if friction is None else {"contact": "unilateral", "friction": friction}
    return {"layer": [FLAP | contact | more]}


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one case."""
    (record,) = solve(comm, **{"probe": BALL, **changes}).values()
    return record


@pytest.mark.parametrize("degree", [2, 3])
def test_a_uniform_pressure_goes_through_the_contact_as_through_one_body(degree):
    """A patch test: without lateral strain, weight presses evenly, and displacements are quadratic in each part."""
    material, mesh = HEAVY["material"] | {"young": "10 kPa", "poisson": 0.0}, {"degree": degree}
    found = one(body=flap(poisson=0.0), load=GRAVITY, material=material, mesh=mesh)
    upper, lower = 8e-3, 12e-3
    sag = 1060 * 9.81 * (upper**2 / 2 / 20e3 + (upper * lower + lower**2 / 2) / 10e3)
    assert found.sag == pytest.approx(sag, rel=1e-7)
    assert found.largest["lift_off_area"] == pytest.approx(0, abs=1e-12)
    assert found.largest["interface_force"] == pytest.approx(WEIGHT + found.force, rel=1e-8)


@pytest.mark.parametrize("poisson", [0.3, 0.495], ids=["linear", "mixed"])
def test_a_layer_that_sticks_and_lifts_nowhere_is_bonded(poisson):
    changes = HEAVY | {"material": HEAVY["material"] | {"poisson": poisson}}
    bonded, stuck = (one(body=flap(friction, poisson=poisson), **changes) for friction in (None, "stick"))
    assert stuck.status == "ok", stuck.message
    assert stuck.largest["lift_off_area"] < 1e-9 * 40e-3**2
    assert stuck.force == pytest.approx(bonded.force, rel=1e-6)
    assert stuck.largest["interface_force"] == pytest.approx(stuck.force + WEIGHT, rel=1e-7)


@pytest.mark.parametrize("friction", [0, pytest.param(0.3, marks=pytest.mark.nightly), "stick"])
def test_on_stiff_tissue_a_layer_lies_as_on_a_rigid_support(friction):
    """The mesh of the layer is another one than that of a body of its size: bars cover the difference."""
    stiff = {"young": "1 GPa", "poisson": 0.3}
    rigid = {"size": ["40 mm", "40 mm", "8 mm"], "fixed": "none", "support": {"on": "bottom", "friction": friction}}
    mesh = {"fine": "3 mm", "rim": "0.4 mm"}
    on_rigid = one(body=rigid, material={"young": "20 kPa"}, mesh=mesh)
    loose = one(body=flap(friction), material=stiff, mesh=mesh)
    bars = on_rigid.force * on_rigid.force_error + loose.force * loose.force_error
    assert abs(loose.force - on_rigid.force) < bars < 0.05 * loose.force
    bars = on_rigid.largest["lift_off_area_error"] + loose.largest["lift_off_area_error"]
    assert abs(loose.largest["lift_off_area"] - on_rigid.largest["lift_off_area"]) < bars
    assert loose.largest["interface_force"] == pytest.approx(loose.force, rel=1e-8)


def test_friction_of_the_layer_is_between_none_and_sticking():
    smooth, some, stuck, bonded = (one(body=flap(friction), mesh=ROUGH) for friction in (0, 0.1, "stick", None))
    assert smooth.force < some.force < stuck.force < bonded.force
    assert max(each.balance for each in (smooth, some, stuck)) < 1e-8
    for each in (smooth, some, stuck):
        assert each.largest["interface_force"] == pytest.approx(each.force, rel=1e-8)
    lifted = [each.largest["lift_off_area"] for each in (smooth, some, stuck)]
    assert lifted == sorted(lifted, reverse=True)


@pytest.mark.nightly
def test_much_friction_of_the_layer_is_sticking():
    most, stuck = (one(body=flap(friction)) for friction in (2.0, "stick"))
    assert most.balance < 1e-8
    assert most.force == pytest.approx(stuck.force, rel=3e-4)
    assert most.largest["lift_off_area"] == pytest.approx(stuck.largest["lift_off_area"], abs=1e-2 * 40e-3**2)


def test_beside_the_middle_a_layer_that_sticks_is_pressed():
    found = one(body=flap("stick"), probe=BALL | {"at": ["8 mm", "5 mm"]}, mesh=ROUGH)
    assert found.status == "ok", found.message
    assert found.largest["interface_force"] == pytest.approx(found.force, rel=1e-7)


def test_the_bars_cover_a_finer_mesh():
    coarse, fine = (one(body=flap(), mesh={"fine": f, "rim": r}) for f, r in (("5 mm", "1 mm"), ("2.5 mm", "0.4 mm")))
    assert abs(coarse.force - fine.force) < coarse.force * coarse.force_error + fine.force * fine.force_error
    for name in ("interface_force", "lift_off_area"):
        bars = sum(each.largest[f"{name}_error"] for each in (coarse, fine))
        assert abs(coarse.largest[name] - fine.largest[name]) < bars


def test_the_work_of_the_tool_is_the_energy():
    shares = np.linspace(0, 1, 5)[1:]
    depths = [f"{0.5 * share**2:.6g} mm" for share in shares]
    probe = BALL | {"depth": depths, "mesh_depths": [depths[0], depths[-1]]}
    found = [record for _, record in sorted(solve(probe=probe, body=flap(), mesh={"rim": "0.3 mm"}).items())]
    # With d = t², F dd = 2 t F dt: Simpson's rule in t.
    slopes = [0.0, *(2 * 0.5e-3 * share * record.force for share, record in zip(shares, found, strict=True))]
    work = (slopes[0] + 4 * slopes[1] + 2 * slopes[2] + 4 * slopes[3] + slopes[4]) / 12
    assert work == pytest.approx(found[-1].energy, rel=0.01)


@pytest.mark.parametrize("friction", [0, pytest.param(0.2, marks=pytest.mark.nightly)])
def test_a_factorisation_finds_what_iterations_find(friction):
    iterated, factorised = (
        one(body=flap(friction), solve={"method": method}, mesh=ROUGH) for method in ("iterative", "direct")
    )
    assert factorised.force == pytest.approx(iterated.force, rel=1e-7)


@pytest.mark.mpi
def test_two_ranks_find_the_same():
    alone, both = (one(comm, body=flap(0.2)) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["lift_off_area"] == pytest.approx(alone.largest["lift_off_area"], rel=1e-6)


def test_a_layer_that_floats_says_so():
    found = one(body=flap(), probe=BALL | {"at": ["8 mm", "0 mm"]})
    assert '"flap" floats' in found.message
    assert "along x" in found.message
    held = one(body=flap() | {"fixed": "bottom+sides"}, probe=BALL | {"at": ["8 mm", "0 mm"]})
    assert held.status == "ok", held.message


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body": flap(), "probe": {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm"}}, 'must be "unilateral"'),
        ({"body": flap(0.2), "material": {"law": "neo-hookean"}}, "body.layer[1].friction"),
        ({"body": {"layer": [FLAP | {"friction": 0.2}]}}, "what is bonded does not slide"),
        ({"body": {"layer": [FLAP | {"contact": "unilateral", "thickness": None}]}}, "no tissue is below it"),
        (
            {"body": {"layer": [FLAP | {"contact": "unilateral", "name": name} for name in ("one", "two")]}},
            "one layer or region only",
        ),
        ({"body": flap() | {"fixed": "none", "support": {"on": "bottom"}}}, "support that lets go"),
        ({"body": flap(), "probe": BALL | {"at": ["20 mm", "0 mm", "-4 mm"]}}, "presses from the side"),
    ],
)
def test_what_is_not_computed_is_refused(changes, said):
    content = raw(**{"probe": BALL, **changes})
    content["body"]["layer"] = [
        {key: value for key, value in layer.items() if value is not None} for layer in content["body"]["layer"]
    ]
    assert said in refusal(content)


@pytest.mark.parametrize("friction", [0, "stick"])
def test_two_jaws_close_on_tissue_that_lies_loose(friction):
    """If nothing else holds the body, both jaws and the tissue between have one force, less than that of one body."""
    changes = {"probe": [BALL | {"together": "grasp"}, {"together": "grasp"}], "mesh": ROUGH}
    found, bonded = (one(body=flap(rubs) | {"fixed": "none"}, **changes) for rubs in (friction, None))
    assert found.status == "ok", found.message
    for name in ("jaw_force", "interface_force"):
        assert found.largest[name] == pytest.approx(found.force, rel=1e-7)
        assert found.largest[f"{name}_error"] > 0.1 * found.force_error * found.force
    assert found.largest["lift_off_area"] > 0
    assert found.force < bonded.force * (1 - 1e-4)


def test_an_inclusion_in_a_loose_layer_is_bonded_to_it():
    lump = {"name": "lump", "at": ["0 mm", "0 mm", "-4 mm"], "axes": ["2 mm", "2 mm", "2 mm"], "young": "90 kPa"}
    found = one(body=flap("stick") | {"inclusion": [lump | {"poisson": 0.3}]}, mesh=ROUGH)
    assert found.status == "ok", found.message
    assert found.largest["interface_area"] == pytest.approx(40e-3**2, rel=1e-9)
    assert found.largest["interface_force"] == pytest.approx(found.force, rel=1e-8)
    assert found.force > one(body=flap("stick"), mesh=ROUGH).force


def test_a_capsule_beside_loose_tissue_is_refused():
    capsule = {"young": "1 MPa", "thickness": "0.1 mm"}
    lump = {"name": "lump", "at": ["0 mm", "0 mm", "-4 mm"], "axes": ["2 mm", "2 mm", "2 mm"], "young": "90 kPa"}
    body = flap() | {"inclusion": [lump | {"poisson": 0.3, "capsule": capsule}]}
    assert "omit one of the two" in refusal(raw(probe=BALL, body=body))
