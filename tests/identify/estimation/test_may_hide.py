"""Unknowns of what may be undeclared."""

import numpy as np
import pytest

from epsmesh.shapes.rounded import Rounded
from epsmesh_identify.estimation.may_hide import KINDS, hidden_parts
from epsmesh_identify.estimation.tools import tip_of_probe
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Solid
from epsmesh_identify.surrogate.wide import profile_of
from tests.cases import probe

NOTHING = {
    "hidden_layer_ratio": 1.0,
    "hidden_layer_thickness": 1e-3,
    "hidden_base_curvature": 0.0,
    "hidden_strain": 0.0,
}
DEEPEST = 5e-4


BALL = probe(shape="sphere", radius="8 mm", depth="0.5 mm")
SMALL = probe(shape="sphere", radius="2 mm", depth="0.5 mm")
BLADE = probe(shape="blade", length="4 mm", width="1 mm", depth="0.5 mm")


def parts(*probes):
    """Return what may be undeclared, for each tool."""
    return hidden_parts(KINDS, [tip_of_probe(tool, DEEPEST) for tool in probes], [DEEPEST] * len(probes), 0.45)


def test_each_kind_has_its_unknowns_and_all_are_shared_by_the_curves():
    first, second = parts(BALL, SMALL)
    assert [part.kind for part in first] == list(KINDS)
    assert [part.unknowns for part in first] == [part.unknowns for part in second]
    unknowns = {unknown.name: unknown for part in first for unknown in part.unknowns}
    assert unknowns.keys() == NOTHING.keys()
    assert all(unknowns[name].low <= value <= unknowns[name].high for name, value in NOTHING.items())
    contact = np.sqrt([2e-3 * DEEPEST, 8e-3 * DEEPEST])
    assert unknowns["hidden_layer_thickness"].low == pytest.approx(0.1 * contact[0], rel=0.1)
    assert unknowns["hidden_base_curvature"].high == pytest.approx(1 / contact[1], rel=0.02)


@pytest.mark.parametrize("tool", [BALL, BLADE], ids=["ball", "blade"])
def test_factors_are_1_without_hidden_parts_and_differ_with_them(tool):
    depth = np.linspace(-1e-4, DEEPEST, 20)
    changed = NOTHING | {"hidden_layer_ratio": 5.0, "hidden_base_curvature": 300.0, "hidden_strain": 1.0}
    for part in parts(tool)[0]:
        assert part.factor(depth, NOTHING) == pytest.approx(1.0, abs=1e-9)
        assert part.factor(depth, changed)[-1] > 1.01


def test_a_small_ball_sees_a_hidden_layer_better_than_a_large_one():
    with_layer = NOTHING | {"hidden_layer_ratio": 5.0, "hidden_layer_thickness": 2e-4}
    large, small = (part[0].factor(np.array([1e-4]), with_layer)[0] for part in parts(BALL, SMALL))
    assert 1.05 < large < 0.9 * small


def test_profiles_are_those_of_the_program_s_tools():
    """The radius of contact is that which the tool expects on a half-space."""
    rod = {"shape": "disc", "edge": "0.2 mm", "contact": "unilateral"}
    for tool in (
        BALL,
        probe(shape="cone", angle="60 deg", radius="5 mm", tip="0.2 mm", depth="0.5 mm"),
        probe(shape="paraboloid", radius="5 mm", shaft="5 mm", depth="0.5 mm"),
        probe(**rod, radius="2 mm", depth="0.1 mm"),
        probe(shape="disc", radius="2 mm", depth="0.1 mm", contact="frictionless"),
    ):
        table = LayeredBody(base=Solid(1.0, 0.0)).table(profile_of(tool), tool.depth)
        depth = tool.depth * np.array([0.999, 1.001])
        force = table(depth)
        expected = getattr(tool, "contact_width", tool.half_width)
        assert np.diff(force) / np.diff(depth) == pytest.approx(2 * expected, rel=1e-3)
    assert profile_of(BLADE) is None
    assert profile_of(BALL).slope(np.array([1e-3])) == pytest.approx(Rounded(0.0, 8e-3).slope(np.array([1e-3])))
