"""Friction on the meridian: closed forms of sticking tools, the limits of the coefficient, and three dimensions."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest

from epsmesh.mesh.meridian import Meridian
from epsmesh.shapes.rounded import Rounded
from epsmesh.solve.compiled import compiling
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.meridian.contact import MeridianContact
from epsmesh.solve.meridian.large_contact import DEGREE_OF_STEPS, LargeMeridianContact
from epsmesh.solve.meridian.problem import MeridianProblem, compile_axisymmetric
from epsmesh.solve.meridian.punch import RoundTool
from epsmesh.solve.movement import Movement
from tests.cases import solve
from tests.solve.test_meridian_large_contact import BALL, BODY, law, round_tool
from tests.verification import known

FLAT = RoundTool(lambda radii: 0 * radii, 1.0)
SHARP = round_tool(Rounded(1.5, 1e-4), 4.0)
WIDE = Meridian(20.0, 20.0, 1.0)
LAWS = [law(0.3, "linear"), law(0.3)]


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    with compiling():
        compile_axisymmetric(lowest=DEGREE_OF_STEPS - 1)
        compile_axisymmetric(DEGREE_OF_STEPS, laws=("neo-hookean",))


def pressed(tool, depth, of, friction, body=BODY, **how):
    """Return the solution on the first mesh that is good to 1 %."""
    how = {"accuracy": 1e-2, "degree": DEGREE_OF_STEPS} | how
    tool = replace(tool, friction=friction)
    return LargeMeridianContact(body, tool, **how).solve(of, Movement.along((0.0, 0.0, -depth)))


@pytest.mark.parametrize(
    "of", [pytest.param(LAWS[0], marks=pytest.mark.nightly), LAWS[1]], ids=["linear", "neo-hookean"]
)
def test_little_friction_is_none_and_much_sticks(of):
    none, little, some, much, sticks = (pressed(BALL, 0.1, of, mu) for mu in (0.0, 1e-9, 0.2, 30.0, inf))
    assert little.reaction[2] == pytest.approx(none.reaction[2], rel=1e-6)
    assert none.reaction[2] < some.reaction[2] < sticks.reaction[2]
    assert much.reaction[2] == pytest.approx(sticks.reaction[2], rel=1e-6)
    assert sticks.contact.slip_area == much.contact.slip_area == 0
    assert 0.1 < some.contact.slip_area / some.contact.area < 0.9
    assert little.contact.slip_area > 0.9 * little.contact.area
    assert np.isnan(none.contact.slip_area)
    assert np.isnan(none.contact.friction_force)
    assert 0 < some.contact.friction_force < 0.2 * some.reaction[2]
    assert some.contact.torque == some.contact.torque_bar == 0
    assert 0 < some.contact.slip_area_bar < 0.5 * some.contact.area
    assert some.bar < some.contact.friction_force_bar / some.contact.friction_force < 0.5
    assert sticks.contact.slip_area_bar == 0 < much.contact.slip_area_bar


@pytest.mark.parametrize(
    ("tool", "power"), [(BALL, 2), pytest.param(SHARP, 1, marks=pytest.mark.nightly)], ids=["ball", "cone"]
)
def test_sticking_tools_have_their_closed_forms(tool, power):
    """On a body of 200 radii of contact, whose ratio to the frictionless force is that of a half-space."""
    depth = 0.01 if power == 2 else 0.008
    smooth = MeridianContact(WIDE, tool).solve(LAWS[0], Movement.along((0.0, 0.0, -depth)))
    sticks = pressed(tool, depth, LAWS[0], inf, WIDE)
    assert sticks.reaction[2] / smooth.reaction[2] == pytest.approx(known.stick_ratio(0.3, power), rel=sticks.bar)
    assert sticks.bar < 0.01
    assert sticks.contact.slip_area == 0


def test_a_disc_that_sticks_is_bonded():
    movement = Movement.along((0.0, 0.0, -0.1))
    bonded = MeridianProblem(BODY, Conditions(bonded=True)).solve(LAWS[0], movement)
    sticks = pressed(FLAT, 0.1, LAWS[0], inf)
    assert sticks.reaction[2] == pytest.approx(bonded.reaction[2], rel=sticks.bar)
    assert sticks.contact.area == pytest.approx(np.pi, rel=1e-9)


def test_friction_below_a_sharp_disc_is_the_integral_of_the_size_of_the_traction():
    """Nodal forces alternate beside its edge, where the traction is singular. The value is that of a far finer mesh."""
    found = pressed(FLAT, 0.1, law(0.45, "linear"), 0.3).contact
    assert found.friction_force == pytest.approx(0.012014, abs=found.friction_force_bar)
    assert found.friction_force_bar < 0.03 * found.friction_force


def test_what_sticking_adds_fades_with_the_depth():
    """Another code has 1.008 at d/R = 0.05 and 1.001 at 0.2, with ν = 0.3 and a height of 5 R."""
    added = []
    for depth in (0.001, 0.05, 0.2):
        smooth, sticks = (pressed(BALL, depth, LAWS[1], mu) for mu in (0.0, inf))
        added.append(sticks.reaction[2] / smooth.reaction[2] - 1)
    assert added == pytest.approx([0.0162, 0.008, 0.001], abs=4e-3)
    assert added[0] > added[1] > added[2] > 0


@pytest.mark.parametrize(
    "material",
    [{"poisson": 0.4}, pytest.param({"poisson": 0.45, "law": "neo-hookean"}, marks=pytest.mark.nightly)],
    ids=["linear", "neo-hookean"],
)
def test_a_study_is_solved_on_the_meridian_as_in_three_dimensions(material):
    scene = {
        "body": {"shape": "cylinder", "radius": "20 mm", "height": "15 mm", "fixed": "bottom"},
        "material": material,
        "probe": {"shape": "sphere", "radius": "4 mm", "depth": "1 mm", "contact": "unilateral", "friction": 0.2},
        "mesh": {"rim": "1 mm", "fine": "4 mm", "coarse": "6 mm", "growth": 1.2},
    }
    (plane,), (space,) = (solve(**scene, plan={"without": without}).values() for without in ([], ["axisymmetric"]))
    assert (plane.status, plane.kind) == ("ok", "meridian friction")
    assert plane.force == pytest.approx(space.force, rel=space.force_error + plane.force_error)
    assert plane.contact_area == pytest.approx(space.contact_area, rel=0.1)
    assert 0 < plane.slip_area < plane.contact_area
    assert plane.force_error < 5e-3
