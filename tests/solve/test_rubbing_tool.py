"""A tool that deforms with friction, and above loose tissue: limits, balances, Dundurs' constant, and output points."""

from math import isnan
from typing import Any

import pytest
from mpi4py import MPI

from epsmesh.plan.estimate import cells
from tests.cases import solved, study
from tests.solve.test_elastic_tool import BALL, FLAT, SKIN, SOFT, WIDE

ROUGH: dict[str, Any] = {"fine": "6 mm", "coarse": "12 mm", "rim": "0.4 mm"}
STIFF: dict[str, Any] = BALL | {"young": "1 GPa", "poisson": 0.3}
CONE: dict[str, Any] = SOFT | {"shape": "cone", "angle": "75 deg"}


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    return solved(comm, **{"mesh": ROUGH} | changes)


def loose(**keys: Any) -> dict[str, Any]:
    return {"layer": [SKIN | {"contact": "unilateral"} | keys]}


def added(tool: dict[str, Any], friction: float | str, **changes: Any) -> float:
    """Return what friction adds to F, as a share of it."""
    return float(one(probe=tool | {"friction": friction}, **changes).force / one(probe=tool, **changes).force - 1)


def test_friction_acts_on_both_and_is_between_none_and_stick():
    smooth, rough, stuck = (one(probe=CONE | more) for more in ({}, {"friction": 0.1}, {"friction": "stick"}))
    assert smooth.force < rough.force < stuck.force * 1.001
    for each in (rough, stuck):
        assert each.balance < 1e-7


@pytest.mark.nightly
@pytest.mark.parametrize("friction", [0.3, "stick"])
def test_friction_of_a_stiff_tool_is_that_of_a_rigid_one(friction):
    assert added(STIFF, friction) == pytest.approx(added(BALL, friction), rel=0.05)


@pytest.mark.nightly
@pytest.mark.parametrize("friction", [0.05, 0.2])
def test_friction_adds_to_two_bodies_what_it_adds_to_a_rigid_one_with_their_dundurs_constant(friction):
    """Friction depends on β alone, here 0.3245: of two half-spaces, and of a rigid body on one."""
    tool = WIDE | {"young": "14.9 kPa", "poisson": 0.49}
    both = added(tool, friction, material={"young": "10 kPa", "poisson": 0.0}, **FLAT)
    rigid = added(WIDE, friction, material={"young": "10 kPa", "poisson": 0.2598}, **FLAT)
    assert both == pytest.approx(rigid, rel=0.05)


@pytest.mark.nightly
def test_a_factorisation_finds_the_friction_that_iterations_find():
    probe = SOFT | {"friction": 0.3}
    assert one(probe=probe, solve={"method": "direct"}).force == pytest.approx(one(probe=probe).force, rel=1e-5)


@pytest.mark.mpi
def test_two_ranks_find_the_same_friction():
    alone, both = (one(comm, probe=CONE | {"friction": 0.1}) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-6)


@pytest.mark.nightly
def test_a_loose_layer_below_a_stiff_tool_is_that_below_a_rigid_one():
    rigid, stiff = (one(probe=tool, body=loose()) for tool in (BALL, STIFF))
    assert stiff.force == pytest.approx(rigid.force, rel=5e-3)
    assert stiff.largest["lift_off_area"] == pytest.approx(rigid.largest["lift_off_area"], rel=5e-3)


def test_a_loose_layer_that_sticks_below_a_soft_tool_is_nearly_bonded():
    bonded, stuck, slides = (
        one(probe=SOFT, body=body) for body in ({"layer": [SKIN]}, loose(friction="stick"), loose())
    )
    assert slides.force < stuck.force <= bonded.force
    assert stuck.force == pytest.approx(bonded.force, rel=5e-3)
    for each in (stuck, slides):
        assert each.largest["interface_force"] == pytest.approx(each.force, rel=1e-6)
        assert each.balance < 1e-8


@pytest.mark.nightly
def test_both_contacts_may_rub():
    found = one(probe=SOFT | {"friction": 0.2}, body=loose(friction=0.2))
    assert one(probe=SOFT, body=loose()).force < found.force < one(probe=SOFT, body={"layer": [SKIN]}).force
    assert found.balance < 1e-8


def test_an_output_at_a_point_is_that_of_the_tissue():
    at = {"at": ["0 mm", "0 mm", "0 mm"], "of": "displacement_z"}
    found = one(probe=SOFT, output=[at | {"name": "below"}, at | {"name": "inside", "at": ["0 mm", "0 mm", "3 mm"]}])
    expected = -0.2e-3 + found.largest["tool_shortening"]
    assert found.largest["below"] == pytest.approx(expected, rel=1e-3)
    assert isnan(found.largest["inside"])


def test_a_plan_counts_the_elements_of_a_tool_that_deforms():
    rigid, soft = (cells(study(probe=tool, mesh=ROUGH).case(())) for tool in (BALL, SOFT))
    assert 1.1 * rigid < soft < 2 * rigid
