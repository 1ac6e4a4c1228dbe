"""Tissue that sticks on other tissue at large displacements: limit to bonded tissue, balances, work, and bars."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from tests.cases import ROUGH, solve
from tests.solve.test_loose import BALL, GRAVITY, flap

SOFT: dict[str, Any] = {"law": "neo-hookean", "young": "5 kPa", "density": "1060 kg/m^3"}
DEEP = BALL | {"depth": "2 mm"}
# What keeps a layer on the tissue below, beside the tool, too.
PRESSED: dict[str, Any] = GRAVITY | {"traction": [{"on": "top", "pressure": "0.4 kPa"}]}


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one case."""
    (record,) = solve(comm, **{"probe": DEEP, "material": SOFT, "mesh": ROUGH, **changes}).values()
    assert record.status == "ok", record.message
    return record


def work_of(body: dict[str, Any]) -> tuple[float, float]:
    """Return the work (J) of a ball that goes 2 mm deep, and the energy at the end."""
    shares = np.linspace(0, 1, 5)[1:]
    depths = [f"{2 * share**2:.6g} mm" for share in shares]
    probe = DEEP | {"depth": depths, "mesh_depths": [depths[0], depths[-1]]}
    found = [
        record for _, record in sorted(solve(probe=probe, body=body, material=SOFT, mesh={"rim": "0.4 mm"}).items())
    ]
    # With d = t², F dd = 2 t F dt: Simpson's rule in t.
    slopes = [0.0, *(2 * 2e-3 * share * record.force for share, record in zip(shares, found, strict=True))]
    return (slopes[0] + 4 * slopes[1] + 2 * slopes[2] + 4 * slopes[3] + slopes[4]) / 12, found[-1].energy


@pytest.mark.parametrize("poisson", [0.3, 0.495], ids=["displacements", "mixed"])
def test_a_layer_that_lifts_nowhere_is_bonded(poisson):
    material = SOFT | {"poisson": poisson}
    bonded, stuck = (one(body=flap(rubs, poisson=poisson), material=material, load=PRESSED) for rubs in (None, "stick"))
    assert stuck.largest["lift_off_area"] < 1e-9 * 40e-3**2
    assert stuck.force == pytest.approx(bonded.force, rel=1e-6)
    assert stuck.energy == pytest.approx(bonded.energy, rel=1e-6)


def test_a_layer_lifts_off_beside_the_tool():
    bonded, stuck = (one(body=flap(friction)) for friction in (None, "stick"))
    assert 0.9 * bonded.force < stuck.force < bonded.force * (1 - 1e-4)
    assert 0 < stuck.largest["lift_off_area"] < stuck.largest["interface_area"]
    assert stuck.balance < 1e-7
    # The surface between is bent: its pressure adds up to more than the resultant.
    assert stuck.largest["interface_force_vector_z"] == pytest.approx(stuck.force, rel=1e-7)
    assert stuck.force < stuck.largest["interface_force"] < 1.05 * stuck.force


def test_at_a_small_depth_it_is_that_of_small_displacements():
    shallow = BALL | {"depth": "0.05 mm"}
    large, small = (
        one(body=flap("stick"), probe=shallow, material=SOFT | {"law": law}) for law in ("neo-hookean", "linear")
    )
    assert large.force == pytest.approx(small.force, rel=5e-3)
    bars = sum(each.largest["lift_off_area_error"] for each in (large, small))
    assert abs(large.largest["lift_off_area"] - small.largest["lift_off_area"]) < bars


@pytest.mark.nightly
def test_the_work_of_the_tool_is_the_energy():
    work, energy = work_of(flap("stick"))
    assert work == pytest.approx(energy, rel=0.01)


def test_beside_the_middle_of_soft_tissue_nodes_come_back():
    """Some nodes neither press where they stuck before nor are clear: they are in the bar of the area."""
    found = one(
        body=flap("stick"), probe=BALL | {"depth": "3 mm", "at": ["8 mm", "5 mm"]}, material=SOFT | {"young": "2 kPa"}
    )
    assert found.largest["interface_force_vector_z"] == pytest.approx(found.force, rel=1e-7)
    assert 0 < found.largest["lift_off_area_error"] < 0.2 * found.largest["interface_area"]


@pytest.mark.nightly
def test_a_factorisation_finds_what_iterations_find():
    iterated, factorised = (one(body=flap("stick"), solve={"method": method}) for method in ("iterative", "direct"))
    assert factorised.force == pytest.approx(iterated.force, rel=1e-7)


@pytest.mark.nightly
def test_the_bars_cover_a_finer_mesh():
    sizes = ({"fine": "5 mm", "rim": "1 mm"}, {"fine": "2.5 mm", "rim": "0.5 mm"})
    coarse, fine = (one(body=flap("stick"), mesh=mesh) for mesh in sizes)
    assert abs(coarse.force - fine.force) < coarse.force * coarse.force_error + fine.force * fine.force_error
    for name in ("interface_force", "lift_off_area"):
        bars = sum(each.largest[f"{name}_error"] for each in (coarse, fine))
        assert abs(coarse.largest[name] - fine.largest[name]) < bars


@pytest.mark.nightly
@pytest.mark.parametrize("friction", [0.3, "stick"])
def test_friction_of_the_tool_is_found_with_it(friction):
    smooth, rough = (one(body=flap("stick"), probe=DEEP | {"friction": rubs}) for rubs in (0, friction))
    assert smooth.force < rough.force < 1.2 * smooth.force
    assert rough.largest["interface_force_vector_z"] == pytest.approx(rough.force, rel=1e-6)


@pytest.mark.nightly
def test_two_jaws_have_one_force():
    jaws = [DEEP | {"together": "grasp"}, {"together": "grasp"}]
    found = one(body=flap("stick") | {"fixed": "none"}, probe=jaws)
    assert found.largest["jaw_force"] == pytest.approx(found.force, rel=1e-7)
    assert found.largest["interface_force_vector_z"] == pytest.approx(found.force, rel=1e-7)


def test_a_ball_in_the_body_lifts_off_its_socket():
    own = {"name": "ball", "at": ["0 mm", "0 mm", "-9 mm"], "radius": "5 mm", "young": "30 kPa", "poisson": 0.4}
    body = {"fixed": "bottom+sides", "inclusion": [own | {"contact": "unilateral", "friction": "stick"}]}
    found = one(body=body, mesh={"fine": "6 mm", "rim": "1 mm"})
    assert 0 < found.largest["lift_off_area"] < found.largest["interface_area"]
    assert abs(found.largest["interface_force_vector_z"]) < 1e-9 * found.largest["interface_force"]


@pytest.mark.mpi
def test_two_ranks_find_the_same():
    alone, both = (one(comm, body=flap("stick")) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["lift_off_area"] == pytest.approx(alone.largest["lift_off_area"], rel=1e-6)
