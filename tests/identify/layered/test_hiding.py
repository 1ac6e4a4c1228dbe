"""Factors of what may be undeclared: exact where they can be, 1 where nothing is hidden, smooth between."""

from math import radians

import numpy as np
import pytest

from epsmesh.shapes.rounded import Rounded
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer, Solid
from epsmesh_identify.layered.contact import Profile, flat
from epsmesh_identify.layered.hiding import base_factor, flat_tip, layer_factor, strain_factor, tip_of

NU, R, DEEPEST = 0.45, 8e-3, 1e-3
ROUNDED = Rounded(radians(70), 1e-3)
TOOLS = {
    "ball": Profile(lambda r: r / R),
    "cone": Profile(lambda r: 0.4 + 0 * r),
    "punch": flat(1e-3),
    "rounded cone": Profile(ROUNDED.slope, kinks=(ROUNDED.tangent,)),
}
ERROR = {"ball": 3e-3, "cone": 3e-3, "punch": 3e-3, "rounded cone": 0.05}
DEPTH = np.geomspace(1e-5, DEEPEST, 30)
HALF_SPACE = LayeredBody(base=Solid(1.0, NU))


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize(("ratio", "thickness"), [(0.05, 1e-3), (0.5, 3e-4), (4.0, 2e-3), (20.0, 5e-4)])
def test_a_hidden_layer_has_the_force_of_a_layer(tool, ratio, thickness):
    profile = TOOLS[tool]
    layered = LayeredBody((Layer(ratio, NU, thickness),), Solid(1.0, NU))
    exact = layered.force(profile, DEPTH) / HALF_SPACE.force(profile, DEPTH)
    factor = layer_factor(tip_of(profile, DEEPEST)(DEPTH), ratio, thickness, NU)
    assert factor == pytest.approx(exact, rel=ERROR[tool])


@pytest.mark.parametrize("tool", TOOLS)
def test_a_hidden_base_has_the_force_of_a_layer_on_a_rigid_one(tool):
    profile = TOOLS[tool]
    exact = LayeredBody((Layer(1.0, NU, 4e-3),)).force(profile, DEPTH) / HALF_SPACE.force(profile, DEPTH)
    factor = base_factor(tip_of(profile, DEEPEST)(DEPTH), 250.0, NU)
    assert factor == pytest.approx(exact, rel=ERROR[tool])


@pytest.mark.parametrize("tool", TOOLS)
def test_what_is_not_there_has_no_effect(tool):
    tip = tip_of(TOOLS[tool], DEEPEST)(DEPTH)
    for factor in (
        layer_factor(tip, 1.0, 1e-3, NU),
        layer_factor(tip, 10.0, 1e-12, NU),
        base_factor(tip, 0.0, NU),
        strain_factor(tip, 0.0),
    ):
        assert factor == pytest.approx(1.0, abs=1e-6)
    assert layer_factor(tip, 10.0, 1e3, NU) == pytest.approx(10.0, rel=1e-3)


def test_strain_grows_with_the_depth_of_a_ball_and_is_constant_below_a_cone():
    """A softening law has the inverse factor."""
    ball, cone = (strain_factor(tip_of(TOOLS[name], DEEPEST)(DEPTH), 1.0) for name in ("ball", "cone"))
    assert np.log(ball) == pytest.approx(DEPTH / R, rel=1e-6)
    assert np.ptp(cone) < 1e-6 < cone[0] - 1
    assert strain_factor(flat_tip(DEPTH, R), -1.0) == pytest.approx(1 / strain_factor(flat_tip(DEPTH, R), 1.0))


def test_factors_are_finite_above_the_surface_and_beyond_their_tables():
    tip = tip_of(TOOLS["ball"], DEEPEST)(np.array([-1.0, 0.0, 1e-12, 1.0]))
    factors = layer_factor(tip, 30.0, 1e-4, NU), base_factor(tip, 1e6, NU), strain_factor(tip, 3.0)
    assert all(np.all(np.isfinite(factor)) for factor in factors)
