"""Compliances of a layer on a rigid base, from integral equations, and what tools say of themselves by them."""

from math import radians, tan

import numpy as np
import pytest

from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from tests.cases import probe
from tests.verification import known

YOUNG, NU = 10e3, 0.3
PLANE = YOUNG / (1 - NU**2)


def added(force, half_space, depth, exponent):
    """Return the compliance (1/m) that brings the force on a half-space to ``force``."""
    return YOUNG * depth / force * (1 - (force / half_space) ** (1 / exponent))


def test_a_small_disc_finds_the_compliance_of_the_layer():
    disc = probe(shape="disc", radius="1 mm", depth="0.01 mm")
    alone, _ = known.half_space_disc(YOUNG, NU, 1e-3, 1e-5, "frictionless")
    for thickness, rest in ((20e-3, 1e-5), (10e-3, 1e-4)):
        layer = LayeredBody((Layer(YOUNG, NU, thickness),))
        (c, g), force = layer.added_compliance(), layer.punch(1e-3) * 1e-5
        found = added(force, alone, 1e-5, disc.force_exponent)
        assert found == pytest.approx(c + g * disc.mean_square, rel=rest)
        assert abs(found / c - 1) > 20 * rest


@pytest.mark.parametrize("shape", ["sphere", "cone"])
def test_tools_of_which_more_touches_with_depth_find_the_same(shape):
    """Their law is F = f(d - F c / E) with f on a half-space, which is a power, and the term of second order is right.

    A paraboloid stands for the ball, from which it differs by (a/R)².
    """
    angle, radius, a, thickness = radians(89), 1.0, 1e-3, 20e-3
    slope = (lambda r: r / radius) if shape == "sphere" else (lambda r: 1 / tan(angle) + 0 * r)
    layer = LayeredBody((Layer(YOUNG, NU, thickness),))
    touched, (c, g) = layer.touch(Profile(slope), np.array([a])), layer.added_compliance()
    depth, force = float(touched.depth[0]), float(touched.force[0])
    keys = {"radius": "1 m"} if shape == "sphere" else {"angle": "89 deg", "radius": "1 m"}
    tool = probe(shape=shape, depth=f"{depth!r} m", **keys)
    n = tool.force_exponent
    half_space = {
        "sphere": known.half_space_ball(YOUNG, NU, radius, depth),
        "cone": known.half_space_cone(YOUNG, NU, angle, depth),
    }[shape]
    found = added(PLANE * force, half_space, depth, n)
    assert found == pytest.approx(c + g * tool.mean_square, rel=2e-4)
    assert abs(found / c - 1) > 1e-3


def test_flat_tools_press_between_evenly_and_at_their_edges():
    for keys, sides in (
        ({"shape": "blade", "length": "8 mm", "width": "1 mm"}, (8e-3, 1e-3)),
        ({"shape": "blade", "length": "2 mm", "width": "2 mm"}, (2e-3, 2e-3)),
    ):
        evenly = sum(side**2 for side in sides) / 12
        assert evenly < probe(depth="0.1 mm", **keys).mean_square < 1.5 * evenly
    round_one = probe(shape="disc", radius="2 mm", depth="0.1 mm")
    assert probe(shape="ellipse", axes=["2 mm", "2 mm"], depth="0.1 mm").mean_square == round_one.mean_square
