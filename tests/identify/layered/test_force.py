"""Forces of round tools on layers: closed forms, published values, thin and thick limits, smoothness."""

from math import pi, radians, tan

import numpy as np
import pytest

from epsmesh.shapes.rounded import Rounded
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer, Solid
from epsmesh_identify.layered.contact import Profile, flat
from tests.verification.known import LAYER, LAYER_ERROR

E, NU, R = 1e4, 0.3, 8e-3
PLANE = E / (1 - NU**2)
HALF_SPACE = LayeredBody(base=Solid(E, NU))
PARABOLA = Profile(lambda r: r / R)
BALL = Profile(Rounded(0.0, R).slope, limit=R)
FLANK = 1 / tan(radians(70))
CONE = Profile(lambda r: FLANK + 0 * r)
DEPTH = np.array([-1e-4, 0.0, 1e-8, 1e-5, 3e-4, 1e-3])


def on_rigid(poisson, thickness):
    """Return a layer on a rigid base."""
    return LayeredBody((Layer(E, poisson, thickness),))


@pytest.mark.parametrize(
    ("tool", "closed"),
    [
        (PARABOLA, lambda d: 4 / 3 * PLANE * R**0.5 * d**1.5),
        (CONE, lambda d: 2 / pi * PLANE / FLANK * d**2),
        (flat(1e-3), lambda d: 2 * PLANE * 1e-3 * d),
    ],
)
def test_a_half_space_is_that_of_hertz_love_and_boussinesq(tool, closed):
    assert HALF_SPACE.force(tool, DEPTH) == pytest.approx(closed(np.maximum(DEPTH, 0)), rel=1e-10)


def test_a_ball_is_sneddon_s_and_not_a_paraboloid():
    a = np.array([0.1, 0.5, 0.9]) * R
    touched, turned = HALF_SPACE.touch(BALL, a), np.log((R + a) / (R - a)) / 2
    assert touched.depth == pytest.approx(a * turned, rel=1e-10)
    assert touched.force == pytest.approx((a**2 + R**2) * turned - a * R, rel=1e-10)


def test_rounded_tools_are_between_what_they_round():
    """A rounded tip acts as a ball at small depth, and as a cone with an offset at large; a disc's edge likewise."""
    section = Rounded(radians(70), 1e-3)
    rounded = Profile(section.slope, kinks=(section.tangent,))
    small, large = np.array([1e-6]), np.array([1e-3, 2e-3])
    assert HALF_SPACE.force(rounded, small) == pytest.approx(4 / 3 * PLANE * 1e-3**0.5 * small**1.5, rel=1e-3)
    lost = large - np.sqrt(HALF_SPACE.force(rounded, large) * pi * FLANK / 2 / PLANE)
    assert lost[0] == pytest.approx(lost[1], rel=0.1)
    edged = Rounded(0.0, 1e-5, flat=1e-3)
    force = HALF_SPACE.force(Profile(edged.slope, limit=edged.tangent, flat=1e-3), np.array([1e-4]))
    assert 1 < force[0] / (2 * PLANE * 1e-3 * 1e-4) < 1.02


def test_the_table_has_the_stiffness_of_a_flat_punch_as_its_slope():
    """F changes as if the edge of contact did not move, at every radius; between the table's nodes as well."""
    body = LayeredBody((Layer(E, 0.5, 1e-3), Layer(5 * E, 0.4, 5e-4)), Solid(E / 3, 0.45))
    radii = np.geomspace(5e-5, 3e-3, 29)
    touched = body.touch(PARABOLA, radii)
    step = 1e-4 * touched.depth
    table = body.table(PARABOLA, 1.01 * touched.depth[-1])
    slope = (table(touched.depth + step) - table(touched.depth - step)) / (2 * step)
    assert table(touched.depth) == pytest.approx(touched.force, rel=3e-6)
    assert slope == pytest.approx(touched.stiffness, rel=3e-5)


@pytest.mark.parametrize("ratio", LAYER)
def test_punches_on_layers_are_those_published(ratio):
    """W. C. Hayes' table, for ν = 0.3."""
    force = on_rigid(0.3, 1e-3 / ratio).force(flat(1e-3), np.array([1e-4]))
    assert force == pytest.approx(2 * PLANE * 1e-3 * 1e-4 * LAYER[ratio], rel=LAYER_ERROR)


def test_thick_layers_are_half_spaces_and_thin_ones_their_base():
    depth = np.array([1e-4])
    base = Solid(5 * E, 0.45)
    for thickness, other in ((1e3, HALF_SPACE), (1e-5, LayeredBody(base=base))):
        layered = LayeredBody((Layer(E, NU, thickness),), base).force(flat(1e-3 / 4), depth)
        assert layered == pytest.approx(other.force(flat(1e-3 / 4), depth), rel=0.15 if thickness < 1 else 1e-6)


def test_very_thin_layers_flow_or_are_pressed_flat():
    """Incompressible, F = (2 π / 3) E R² d³ / h³ by lubrication's equation; else π M R d² / h, M the oedometer's."""
    for poisson, law in (
        (0.5, lambda d, h: 2 * pi / 3 * E * R**2 * d**3 / h**3),
        (0.2, lambda d, h: pi * E * (1 - 0.2) / (1.2 * 0.6) * R * d**2 / h),
    ):
        off = []
        for wide in (20, 40):
            touched = on_rigid(poisson, 1e-3 / wide).touch(PARABOLA, np.array([1e-3]))
            plane = E / (1 - poisson**2)
            off.append(abs(plane * touched.force[0] / law(touched.depth[0], 1e-3 / wide) - 1))
        assert off[1] < 0.13
        assert off[1] < 0.6 * off[0]


def test_a_tool_that_ends_goes_on_as_a_punch():
    limit = 5e-4
    body = on_rigid(0.4, 1e-3)
    ended = Profile(PARABOLA.slope, limit=limit)
    touched = body.touch(PARABOLA, np.array([limit]))
    at = touched.depth[0] + np.array([-1e-9, 1e-5, 2e-5])
    force = body.force(ended, at)
    assert force[0] == pytest.approx(body.top.plane * touched.force[0], rel=1e-4)
    assert (force[2] - force[1]) / 1e-5 == pytest.approx(body.force(flat(limit), np.array([1.0]))[0], rel=1e-4)


def test_too_wide_a_contact_is_refused():
    with pytest.raises(ValueError, match="too wide"):
        on_rigid(0.4, 1e-6).touch(PARABOLA, np.array([1e-3]))


def test_a_point_load_moves_a_half_space_everywhere_and_a_layer_near_it():
    assert HALF_SPACE.point_load(0.02) == pytest.approx(1 / (pi * PLANE * 0.02))
    near, far = (on_rigid(0.4, 1e-2).point_load(distance) for distance in (1e-4, 5e-2))
    assert near == pytest.approx(0.99 * (1 - 0.4**2) / (pi * E * 1e-4), rel=0.01)
    assert abs(far) < 1e-2 * (1 - 0.4**2) / (pi * E * 5e-2)


def test_any_tool_on_any_layers_has_a_force_that_grows_ever_faster_and_has_no_scale():
    """Moduli over six decades, layers from a tenth to thirty radii, depths from 1e-4 to 0.5 radii."""
    rng = np.random.default_rng(5)
    for number in range(15):
        young, share = 10 ** rng.uniform(2, 8, 4), 10 ** rng.uniform(-1, 1.5, 4)
        poisson = rng.choice([0.0, 0.3, 0.45, 0.5], 4)
        depth, count = np.linspace(0, 10 ** rng.uniform(-4, -0.3), 101), rng.integers(1, 4)
        forces = []
        for radius, modulus in ((1.0, 1.0), (1e-7, 1e3)):
            layers = tuple(
                Layer(modulus * one, nu, radius * part)
                for one, nu, part in zip(young[:count], poisson[:count], share[:count], strict=True)
            )
            body = LayeredBody(layers, Solid(modulus * young[-1], 0.3))
            rounded = Rounded(0.0, 0.2 * radius, flat=0.8 * radius)
            tools = (
                Profile(Rounded(0.0, radius).slope, limit=radius),
                flat(radius),
                Profile(rounded.slope, limit=radius, flat=0.8 * radius),
            )
            forces.append(body.force(tools[number % 3], radius * depth) / (modulus * radius**2))
        assert np.all(np.diff(forces[0]) > 0)
        assert np.diff(forces[0], 2).min() > -1e-5 * forces[0][-1]
        assert forces[1] == pytest.approx(forces[0], rel=1e-9)
