"""The integral equation that contact on layers is held against, against closed forms and a published table."""

import pytest

from pipeline.shapes.rounded import Rounded
from pipeline.verify.known import LAYER
from pipeline.verify.layer_contact import layer_contact

BALL = Rounded(0.0, 8.0)


def test_a_very_thick_layer_is_hertz_s_half_space():
    depth, force = layer_contact(lambda r: r / 1e3, 1.0, 1e4, 0.3)
    assert (depth, force) == pytest.approx((1e-3, 4 / 3e3), rel=1e-4)


@pytest.mark.parametrize("ratio", LAYER)
def test_the_slope_of_force_over_depth_is_the_stiffness_of_a_flat_punch(ratio):
    """Along contact that grows, F changes as if its edge stood still: Hayes' table of punches on layers."""
    (first, less), (second, more) = (layer_contact(BALL.slope, a, 1 / ratio, 0.3) for a in (0.999, 1.001))
    assert (more - less) / (second - first) == pytest.approx(2 * LAYER[ratio], rel=2e-3)
