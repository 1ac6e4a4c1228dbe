"""Tools in unilateral contact: their section, their candidates, and values that are refused."""

from math import asin, cos, inf, log, pi, sqrt, tan

import numpy as np
import pytest

from epsmesh.plan.key import case_key, mesh_key
from epsmesh.plan.plan import make_plan
from epsmesh.shapes.parabola import Parabola
from epsmesh.shapes.rounded import Rounded
from epsmesh.study.problems import StudyError
from tests.cases import probe, raw, refusal, study

SPHERE = {"shape": "sphere", "radius": "3 mm", "depth": "0.1 mm", "contact": "unilateral"}
CONE = {"shape": "cone", "angle": "80 deg", "radius": "3 mm", "depth": "0.1 mm", "contact": "unilateral"}
WEDGE = {"shape": "wedge", "angle": "80 deg", "length": "6 mm", "depth": "0.1 mm", "contact": "unilateral"}
DISC = {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "contact": "unilateral"}
FLAT = {"shape": "blade", "length": "4 mm", "width": "1 mm", "depth": "0.1 mm", "contact": "unilateral"}
PARABOLOID = SPHERE | {"shape": "paraboloid", "shaft": "2 mm"}
TOOLS = {"sphere": SPHERE, "paraboloid": PARABOLOID, "cone": CONE, "wedge": WEDGE}


def test_a_section_is_smooth_where_its_rounding_ends():
    section = Rounded(pi / 3, 2e-3)
    near = section.tangent + np.array([-1e-9, 1e-9])
    assert np.ptp(section.height(near)) < 3e-9
    assert section.slope(near) == pytest.approx(1 / tan(pi / 3), rel=1e-5)
    distance = np.linspace(1e-5, 5e-3, 40)
    slopes = (section.height(distance + 1e-8) - section.height(distance - 1e-8)) / 2e-8
    np.testing.assert_allclose(slopes, section.slope(distance), rtol=1e-6)
    for depth in (1e-6, 1e-4, 2e-3):
        assert section.height(np.array([section.reach(depth)]))[0] == pytest.approx(depth)


def test_a_ball_ends_at_its_equator_and_is_a_paraboloid_at_its_pole():
    ball = Rounded(0.0, 3e-3)
    assert ball.height(np.array([0.0, 3e-6, 3e-3, 3.001e-3])) == pytest.approx([0, 1.5e-9, 3e-3, inf])
    assert ball.reach(1e-3) == pytest.approx(sqrt(2 * 3e-3 * 1e-3 - 1e-6))
    assert ball.reach(4e-3) == 3e-3


def test_the_contact_on_a_half_space_is_that_of_closed_forms():
    """I. N. Sneddon (1965): cone, ball, rounded cone, and paraboloid at any depth."""
    assert Parabola.up_to(9e-3, 2e-3).contact_radius(3e-3) == pytest.approx(sqrt(2e-3 * 3e-3))
    assert Rounded(pi / 3).contact_radius(1e-3) == pytest.approx(2 / pi * tan(pi / 3) * 1e-3)
    a = Rounded(0.0, 3e-3).contact_radius(0.5e-3)
    assert a / 2 * log((3e-3 + a) / (3e-3 - a)) == pytest.approx(0.5e-3)
    rounded = Rounded(pi / 3, 1e-4)
    a, b, radius = rounded.contact_radius(1e-3), rounded.tangent, 1e-4
    ball = a * log((radius + a) / (sqrt(radius**2 - b**2) + sqrt(a**2 - b**2)))
    assert ball + a / tan(pi / 3) * (pi / 2 - asin(b / a)) == pytest.approx(1e-3, rel=1e-3)
    assert b == pytest.approx(radius * cos(pi / 3))


def test_contact_on_a_dome_is_smaller():
    """H. Hertz: curvatures add up; a cone's share is Love's."""
    bump = 1 / 6e-3
    assert Rounded(0.0, 3e-3).contact_radius(1e-7, bump) == pytest.approx(sqrt(1e-7 / (1 / 3e-3 + bump)), rel=1e-4)
    a = Rounded(pi / 3).contact_radius(1e-3, bump)
    assert pi / 2 * a / tan(pi / 3) + bump * a**2 == pytest.approx(1e-3)


@pytest.mark.parametrize("axes", [(20, 20, 20), (40, 20, 20), (20, 30, 10)])
def test_contact_is_expected_on_the_surface_below_the_tool(axes):
    """On top of an ellipsoid, with its mean curvature there."""
    body = {"shape": "ellipsoid", "axes": [f"{axis} mm" for axis in axes], "fixed": {"below": "-4 mm"}}
    case = study(body=body, probe=SPHERE | {"depth": "0.01 mm"}).case(())
    a, b, c = axes
    ratio = case.probe.contact_width / case.expected.contact_width
    assert ratio**2 == pytest.approx(1 + 3 * (c / a**2 + c / b**2) / 2, rel=0.01)
    assert case.expected.footprint == case.probe.footprint


def test_a_sharp_edge_touches_less_than_a_cone():
    wedge = Rounded(pi / 3)
    assert 0.2 < wedge.contact_width(1e-4, 6e-3) / wedge.reach(1e-4) < 0.64


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"contact": "bonded"}, ["probe.contact", "unilateral"]),
        ({"contact": "frictionless"}, ["probe.contact", "is computed, not prescribed"]),
        ({"motion": "all"}, ["probe.motion", "bonded"]),
        ({"action": "slash"}, ["probe.action"]),
        ({"at": ["19.9 mm", "0 mm"]}, ["probe.at", "contact area", "top"]),
    ],
    ids=str,
)
def test_what_such_a_tool_cannot_do_is_refused(tool, change, words):
    said = refusal(raw(probe=TOOLS[tool] | change))
    assert all(word in said for word in words), said


@pytest.mark.parametrize(
    ("probe", "words"),
    [
        *((tool | {"angle": angle}, ["probe.angle", "60 deg"])
          for tool in (CONE, WEDGE) for angle in ("0 deg", "90 deg", "120 deg", "-10 deg", 60, "3 mm")),
        (CONE | {"angle": "10 deg", "radius": "0.4 mm", "tip": "0.5 mm"}, ["probe.tip", "leaves no cone"]),
        (CONE | {"radius": "50 mm", "tip": "40 mm", "angle": "70 deg", "depth": "9 mm"}, ["probe.at", "contact area"]),
        (DISC | {"edge": "0.2 mm", "contact": "bonded"}, ["probe.edge", "no meaning", "unilateral"]),
        (DISC | {"edge": "0.2 mm", "contact": "frictionless"}, ["probe.edge", "no meaning", "unilateral"]),
        (DISC | {"edge": "2 mm"}, ["probe.edge", "leaves no flat face", "sphere"]),
        (DISC | {"edge": "9 mm", "depth": "0.5 mm"}, ["probe.edge", "leaves no flat face"]),
        (DISC | {"edge": "-1 mm"}, ["probe.edge", "at least 0"]),
        (DISC | {"edge": "0.2 mm", "mesh_depths": ["0.1 mm", "0.2 mm"]}, ["probe.mesh_depths", "a disc has no"]),
        (FLAT | {"edge": "0.5 mm"}, ["probe.edge", "leaves no flat face"]),
        (FLAT | {"edge": "9 mm", "depth": "0.5 mm"}, ["probe.edge", "leaves no flat face"]),
        (FLAT | {"edge": "0.2 mm", "slice": "0.1 mm"}, ["probe.contact", "bonded to the blade"]),
        (FLAT | {"edge": "0.2 mm", "incision": "5 mm"}, ["probe.contact", "lift off"]),
        (WEDGE | {"tip": "0.2 mm", "edge": "0.3 mm"}, ["probe.edge", "at most `tip`"]),
        (CONE | {"depth": "0.6 mm"}, ["probe.depth", "shaft"]),
        (SPHERE | {"depth": "3.1 mm"}, ["probe.depth", "radius 3 mm"]),
        (SPHERE | {"radius": "400 mm", "depth": "1 mm"}, ["probe.at", "contact area"]),
        (WEDGE | {"tip": "30 mm"}, ["probe.tip", "wider"]),
        (SPHERE | {"axis": [1.0, 0.0, -1.0]}, ["probe.at", "from its axis"]),
        (FLAT | {"slice": "0.1 mm"}, ["probe.contact", "bonded to the blade"]),
        (FLAT | {"incision": "5 mm"}, ["probe.contact", "lift off"]),
    ],
    ids=str,
)  # fmt: skip
def test_tools_that_make_no_sense_are_refused(probe, words):
    said = refusal(raw(probe=probe))
    assert all(word in said for word in words), said


@pytest.mark.parametrize(("probe", "warned"), [(SPHERE, False), (SPHERE | {"depth": "1 mm"}, True), (CONE, False),
                                               (CONE | {"angle": "60 deg"}, True)], ids=str)  # fmt: skip
def test_steep_tools_are_warned_of(probe, warned):
    assert any("slope" in warning for warning in study(probe=probe).warnings) == warned
    large = study(probe=probe, material={"law": "neo-hookean"})
    assert not any("slope" in warning for warning in large.warnings)


@pytest.mark.parametrize("outside", ["coarse", "free"])
def test_a_small_epsilon_is_held_against_what_may_touch(outside):
    """The candidates of a ball extend beyond its radius of contact, so contact may well end within ε."""
    (warning,) = (w for w in study(probe=SPHERE, mesh={"epsilon": "1 mm", "outside": outside}).warnings if "less" in w)
    assert "1.152 mm, up to which the sphere may touch" in warning
    assert ("column" in warning) == (outside == "free")


@pytest.mark.parametrize("tool", [*TOOLS, "disc"])
def test_f_is_proportional_to_stress_alone(tool):
    """F is a record of its own for each depth of a tool whose contact area grows, but not of a flat one, and not for
    each modulus. There is no basis in Poisson's ratios, and the plan says why.
    """
    probe = TOOLS.get(tool, DISC)
    ratios = [round(0.30 + 0.01 * n, 2) for n in range(12)]
    materials = {"young": ["10 kPa", "20 kPa"], "poisson": ratios}
    found = study(probe=probe | {"depth": ["0.1 mm", "0.2 mm"]}, material=materials)
    plan = make_plan(found)
    assert len(set(plan.keys)) == (1 if tool == "disc" else 2) * len(ratios)
    assert not any(solve.reduced for solve in plan.solves)
    reasons = {skipped.name: skipped.reason for skipped in plan.skipped}
    assert "mostly to the depth" in reasons["scaling"]
    assert "contact area changes" in reasons["reduced"]
    shallow, deep = (found.case((0, 0, depth)) for depth in (0, 1))
    assert shallow.proportional_to == ("young",)
    assert case_key(shallow, scaled=True) != case_key(deep, scaled=True)
    # The candidates of a flat tool are its face; the mesh of a ball depends on its depth.
    assert (mesh_key(shallow) == mesh_key(deep)) == (tool == "disc")


def test_contact_of_a_flat_tool_is_on_the_mesh_of_any_other():
    disc = {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm"}
    keys = {mesh_key(*study(probe=disc | {"contact": c}).cases()) for c in ("bonded", "frictionless", "unilateral")}
    assert len(keys) == 1


def test_a_rounded_edge_is_between_a_flat_disc_and_a_ball():
    """Contact on a half-space ends on the rounding; a disc that is all edge is a ball."""
    disc = study(probe=DISC | {"edge": "0.5 mm"}).case(()).probe
    assert disc.section.flat < disc.contact_width < disc.footprint.radius <= disc.radius
    assert disc.contact_width - disc.section.flat < disc.edge_width < disc.contact_width
    almost = Rounded(0.0, 2e-3 - 1e-9, 1e-9)
    assert almost.contact_radius(1e-4) == pytest.approx(Rounded(0.0, 2e-3).contact_radius(1e-4), rel=1e-5)
    assert Rounded(0.0, 1e-6, 2e-3).contact_radius(1e-4) == pytest.approx(2e-3, rel=1e-3)


def test_an_edge_of_zero_is_a_sharp_tool_and_can_be_swept():
    sharp, rounded = (case.probe for case in study(probe=DISC | {"edge": ["0 mm", "0.2 mm"]}).cases())
    assert sharp.has_singular_edge and not rounded.has_singular_edge
    assert sharp.force_exponent == 1.0
    assert rounded.force_exponent is None


@pytest.mark.parametrize(
    ("tool", "taken", "refused"),
    [(CONE | {"angle": "70 deg"}, 8, 11), (SPHERE | {"radius": "5 mm", "depth": "0.5 mm"}, 15, 25)],
)
def test_a_tilted_tool_whose_contact_leaves_the_searched_region_is_refused_when_the_study_is_read(tool, taken, refused):
    """The solver finds contact at the first of the two angles (degrees), at the second it reaches the region's edge."""
    axis = {angle: {"axis": [tan(angle * pi / 180), 0.0, -1.0]} for angle in (taken, refused)}
    study(probe=tool | axis[taken])
    with pytest.raises(StudyError, match=f"inclined by {refused}° to the surface"):
        study(probe=tool | axis[refused])


@pytest.mark.parametrize(
    ("keys", "sharp"),
    [
        ({"shape": "disc", "radius": "3 mm"}, True),
        ({"shape": "disc", "radius": "3 mm", "edge": "1 mm", "contact": "unilateral"}, False),
        ({"shape": "ellipse", "axes": ["3 mm", "2 mm"]}, True),
        ({"shape": "wedge", "angle": "70 deg", "length": "3 mm"}, True),
        ({"shape": "wedge", "angle": "70 deg", "length": "3 mm", "tip": "1 mm", "edge": "1 mm"}, False),
        ({"shape": "sphere", "radius": "3 mm"}, False),
    ],
)
def test_tools_say_whether_they_end_at_a_sharp_edge(keys, sharp):
    """Tissue slides off it at large displacements, for which bars are wider; an ellipse counted as rounded."""
    assert probe(depth="0.1 mm", **keys).ends_sharply is sharp
