"""Signed distances to tools: compared with their profiles, and with their own derivatives."""

from math import cos, radians, sin, sqrt, tan

import numpy as np
import pytest

from epsmesh.shapes.distance import intersection, slab
from epsmesh.shapes.indenter import Indenter
from epsmesh.shapes.registry import PROBES
from tests.shapes.test_contract import ROUNDED, example

STEP = 1e-8
TOOLS = {
    "sphere": example(PROBES["sphere"]),
    "sharp cone": example(PROBES["cone"]),
    "cone": example(PROBES["cone"], tip="0.4 mm"),
    "needle": example(PROBES["cone"], angle="10 deg", tip="0.4 mm", radius="1 mm"),
    "paraboloid": example(PROBES["paraboloid"], radius="3 mm"),
    "sharp pyramid": example(PROBES["pyramid"], sides=3),
    "pyramid": example(PROBES["pyramid"], tip="0.4 mm"),
    "rounded tetrahedron": example(PROBES["pyramid"], sides=3, angle="40 deg", tip="0.4 mm"),
    "sharp wedge": example(PROBES["wedge"]),
    "wedge": example(PROBES["wedge"], tip="0.4 mm"),
    "rounded wedge": example(PROBES["wedge"], tip="0.4 mm", edge="0.3 mm"),
    "rounded disc": example(PROBES["disc"], **ROUNDED),
    "rounded blade": example(PROBES["blade"], **ROUNDED),
}


@pytest.fixture(params=TOOLS)
def tool(request) -> Indenter:
    return TOOLS[request.param]


def around(tool, count=3000, share=2.0):
    """Return random points (n, 3) around a tool, to twice its size, in m."""
    half = tool.radius if hasattr(tool, "radius") else getattr(tool, "length", 2e-3) / 2
    size = share * max(half, 1e-3)
    return np.random.default_rng(7).uniform((-size, -size, -size / 2), (size, size, size), (count, 3))


def test_every_tool_of_unknown_contact_area_is_here():
    assert {name for name, kind in PROBES.items() if issubclass(kind, Indenter)} <= {t.shape for t in TOOLS.values()}


def test_the_gap_is_nought_on_the_profile_and_has_its_sign_elsewhere(tool):
    points = around(tool)
    height = tool.profile(points[:, :2])
    under = np.isfinite(height)
    on = np.column_stack([points[:, :2], np.where(under, height, 0.0)])[under]
    assert np.abs(tool.distance(on).gap).max() < 1e-12
    assert np.array_equal(tool.distance(points).gap < 0, points[:, 2] > height)


def test_the_gap_is_the_distance_to_the_nearest_point_of_the_surface(tool):
    """One step along the normal from any point ends on the surface."""
    points = around(tool)
    found = tool.distance(points)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(1, abs=1e-12)
    feet = points - found.gap[:, None] * found.normal
    assert np.abs(tool.distance(feet).gap).max() < 1e-12
    others = np.abs(tool.distance(feet[::-1]).gap)
    assert others.max() < 1e-12
    assert np.all(np.linalg.norm(points - feet[::-1], axis=1) > np.abs(found.gap) - 1e-12)


def test_normal_and_curvature_are_derivatives(tool):
    """Except where the derivatives jump, deep in a rounding, and outside of sharp edges."""
    points = around(tool)
    gap, normal, curvature = vars(tool.distance(points)).values()
    moved = [[tool.distance(points + sign * STEP * axis) for sign in (1, -1)] for axis in np.eye(3)]
    slope = np.column_stack([(up.gap - down.gap) / (2 * STEP) for up, down in moved])
    bend = np.stack([(up.normal - down.normal) / (2 * STEP) for up, down in moved], axis=2)
    smooth = np.abs(bend).max(axis=(1, 2)) < 1e5  # no change of region within the step
    np.testing.assert_allclose(normal[smooth], slope[smooth], atol=1e-6)
    near = smooth & (gap > -0.1e-3) & ~at_sharp_edges(tool, points, normal)
    assert near.sum() > 100
    np.testing.assert_allclose(curvature[near], bend[near], atol=1e-3 * np.abs(bend[near]).max())
    np.testing.assert_allclose(curvature, np.swapaxes(curvature, 1, 2), atol=1e-9)
    assert np.abs(np.einsum("nij,nj->ni", curvature, normal)).max() <= 1e-9 * np.abs(curvature).max()


def at_sharp_edges(tool, points, normal):
    """Return a mask of points whose nearest point of the tool is on a sharp tip, edge or corner."""
    down = -normal[:, 2]
    at_tip = (
        (down > sin(tool.angle) + 1e-9) & (tool.tip == 0) if hasattr(tool, "angle") else np.zeros(len(points), bool)
    )
    if tool.shape == "wedge":
        return at_tip | (np.abs(points[:, 0]) > tool.length / 2) & (np.abs(normal[:, 0]) < 1)
    return at_tip | (down > 1e-9) & (down < sin(tool.section.angle) - 1e-9)


def test_closed_forms_of_ball_cone_and_wedge():
    ball = TOOLS["sphere"]
    found = ball.distance(np.array([[ball.radius, 0.0, 0.0]]))
    assert found.gap == pytest.approx((sqrt(2) - 1) * ball.radius)
    assert found.normal[0] == pytest.approx(np.array([1, 0, -1]) / sqrt(2))
    assert np.sort(np.linalg.eigvalsh(found.curvature[0])) == pytest.approx(
        np.array([0, 1, 1]) / (sqrt(2) * ball.radius), abs=1e-9
    )
    cone = TOOLS["sharp cone"]
    rise, r = 1 / tan(cone.angle), 0.5e-3
    found = cone.distance(np.array([[0.0, r, r * rise]]))
    assert found.gap == pytest.approx(0, abs=1e-15)
    assert found.normal[0] == pytest.approx([0, cos(cone.angle), -sin(cone.angle)])
    # The only curvature of a cone is around its axis: cos(angle) / radius.
    assert found.curvature[0] == pytest.approx(np.diag([cos(cone.angle) / r, 0, 0]), abs=1e-9)
    wedge = TOOLS["sharp wedge"].distance(np.array([[1e-3, -0.5e-3, 0.5e-3 / tan(radians(70))]]))
    assert wedge.normal[0] == pytest.approx([0, -cos(radians(70)), -sin(radians(70))])
    assert not wedge.curvature.any()


@pytest.mark.parametrize("name", [name for name in TOOLS if name != "rounded blade"])
def test_on_the_axis_the_gap_is_along_it(name):
    tool = TOOLS[name]
    heights = np.concatenate([[0.0], np.linspace(-3e-3, 2e-3, 11)])
    centre = tool.section.tip
    found = tool.distance(np.column_stack([*np.zeros((2, len(heights) + 1)), [*heights, centre]]))
    assert found.gap == pytest.approx(-np.array([*heights, centre]))
    assert np.array_equal(found.normal, np.tile([0.0, 0.0, -1.0], (len(heights) + 1, 1)))
    assert np.all(np.isfinite(found.curvature))
    if centre and not tool.section.flat:
        at_tip = np.diag([1.0, 1.0, 0.0] if tool.shape != "wedge" else [0.0, 1.0, 0.0])
        assert found.curvature[0] == pytest.approx(at_tip / centre)


def test_deep_inside_all_values_are_finite_and_bounded(tool):
    deep = around(tool, share=1.0) * (1e-3, 1e-3, 1.0)
    gap, normal, curvature = vars(tool.distance(deep)).values()
    assert np.all(np.isfinite(gap)) and np.all(np.isfinite(normal)) and np.all(np.isfinite(curvature))
    if tip := tool.section.tip:
        assert np.abs(curvature[deep[:, 2] > 0]).max() < 2.001 / tip


def test_a_rounded_edge_is_a_quarter_of_a_torus_between_two_faces():
    at = np.array([[0.3, 0.0, 0.4], [1.3, 0.0, 1.4], [0.2, 0.0, 0.99], [0.5, 0.0, -2.0]])
    joined = intersection(slab(1.0, at, 0), slab(1.0, at, 2), rounding=0.2)
    assert joined.gap == pytest.approx([-0.6, sqrt(0.5**2 + 0.6**2) - 0.2, -0.01, 1.0])
    assert joined.normal[1] == pytest.approx(np.array([0.5, 0, 0.6]) / sqrt(0.61))
    assert np.trace(joined.curvature[1]) == pytest.approx(1 / sqrt(0.61))
