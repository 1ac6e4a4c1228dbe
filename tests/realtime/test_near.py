"""Balls at large displacements: a half-space of any law, on a body that is linear."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from epsmesh_realtime import ModelError
from epsmesh_realtime.file import pack, unpack
from epsmesh_realtime.model import Model, model_of
from epsmesh_realtime.table import Near
from tests.realtime.synthetic import of_place, random_model

# Depth and radius over Hertz's, over x, for all ν and with ν.
ALIKE = Near(np.array([[[1.1, 0.08, -0.02]], [[0.9, -0.1, 0.01]]]), 1.2, 2e-3, 0.1, 0.08)
THICK = 0.02
VARIED = replace(ALIKE, values=np.concatenate([ALIKE.values, 0.1 * ALIKE.values, 0.03 * ALIKE.values], axis=1))
RADIUS, POISSON = 6e-3, 0.3
PLANE = 1 / (1 - POISSON**2)
BALL = {"radius": RADIUS, "at": (0.0, 0.0, 0.0)}


def large(**kind: bool) -> Model:
    return replace(random_model(**kind), near=VARIED, pairs=None)


def in_body(force: float, h: float) -> float:
    """Return the depth of a paraboloid with the ball's curvature on a body with h, beyond that on a half-space."""
    curvature = 1 / RADIUS + h * force / 2
    a = (0.75 * force / PLANE / curvature) ** (1 / 3)
    alone = (0.75 * force / PLANE) ** (2 / 3) * RADIUS ** (-1 / 3)
    return a**2 * curvature + h * force * a**2 / 10 - alone


@pytest.mark.parametrize(("c", "h"), [(0.0, 0.0), (-30.0, 0.0), (20.0, 1e5), (-30.0, 3e5)])
def test_the_half_space_of_a_law_is_added_to_a_linear_body(c, h):
    model = replace(of_place(c, h, POISSON), near=ALIKE, thickness=THICK)
    for share in (0.01, 0.1, 0.4, 0.7):
        touch = model.query("sphere", depth=share * RADIUS, **BALL)
        force = touch.force[2]
        x = np.cbrt(force / (PLANE * RADIUS**2))
        deeper, wider = np.polynomial.chebyshev.chebval(2 * x / ALIKE.most - 1, ALIKE.values[:, 0].T)
        hertz = 0.75 ** (1 / 3) * x * RADIUS
        near = deeper * hertz**2 / RADIUS * (1 - ALIKE.support * force / THICK**2)
        assert near + c * force + in_body(force, h) == pytest.approx(share * RADIUS, rel=1e-9)
        if not h:
            assert touch.contact_radius == pytest.approx(wider * hertz)
        step = 1e-5 * RADIUS
        more, less = (model.query("sphere", depth=share * RADIUS + s, **BALL).force[2] for s in (step, -step))
        assert touch.stiffness == pytest.approx((more - less) / (2 * step), rel=1e-5)
    assert model.query("sphere", depth=2.5 * RADIUS, **BALL).status == "large"


@pytest.mark.parametrize("h", [-2e3, 0.0, 2e3])
def test_a_ball_much_larger_than_the_body_may_touch_it_lightly(h):
    model = replace(of_place(-10.0, h, POISSON), near=ALIKE, thickness=THICK, largest=0.4)
    asked = {"radius": 20 * RADIUS, "at": (0.0, 0.0, 0.0), "depth": 1e-4}
    small = replace(model, near=replace(ALIKE, values=np.ones((2, 1, 1)), support=0.0)).query("sphere", **asked)
    assert small.status == "ok"
    assert model.query("sphere", **asked).force[2] == pytest.approx(small.force[2], rel=0.1)
    assert model.query("sphere", **asked | {"depth": 1e-3}).status == "large"


@pytest.mark.parametrize("kind", [{}, {"is_round": True}])
def test_a_closed_loop_does_no_work(kind):
    model, angle, weight = large(**kind), 2 * pi * np.arange(64) / 64, 2 * pi / 64
    x, y, depths = 0.008 + 0.006 * np.cos(angle), 0.01 + 0.005 * np.sin(angle), 1e-3 * (2 + np.sin(angle + 1))
    at = np.column_stack([x, y, 0 * x])
    forces = model.query_many("sphere", radius=RADIUS, at=at, depth=depths).force
    assert np.isfinite(forces).all()
    tips = at - depths[:, None] * np.array([0.0, 0.0, 1.0])
    waves = np.fft.rfftfreq(64, 1 / 64)
    speed = np.fft.irfft(1j * waves[:, None] * np.fft.rfft(tips, axis=0), 64, axis=0)
    work = np.sum(forces * speed) * weight
    assert abs(work) < 1e-6 * np.abs(np.sum(forces * speed, axis=1)).sum() * weight


def test_bars_grow_with_depth_over_the_distance_to_the_support():
    near, model = replace(ALIKE, support=0.0), of_place(-5.0, 0.0, POISSON)
    model = replace(model, thickness=0.04, largest=0.4, near=near)
    for share in (0.05, 0.3, 0.6):
        touch = model.query("sphere", depth=share * RADIUS, **BALL)
        force, depth = touch.force[2], share * RADIUS
        alone = replace(of_place(0.0, 0.0, POISSON), near=near)
        compliance = 1 / touch.stiffness + 5.0  # of the half-space, at this force
        own = alone.query("sphere", depth=depth + 5.0 * force, **BALL)
        assert own.force[2] == pytest.approx(force, rel=1e-9)
        assert 1 / own.stiffness == pytest.approx(compliance, rel=1e-9)
        bar = near.error * touch.stiffness * compliance + near.room * depth / 0.04**2 * touch.stiffness
        assert touch.force_error / touch.force[2] == pytest.approx(bar, rel=1e-9)


def test_it_answers_for_one_ball_alone():
    model, at = large(), (0.011, 0.017, 0.0)
    cone, blade = {"radius": 2e-3, "angle": 1.2}, {"length": 6e-3, "width": 1e-3}
    for tool, sizes in {"disc": {"radius": 2e-3}, "cone": cone, "blade": blade}.items():
        touch = model.query(tool, at=at, depth=1e-4, **sizes)
        assert touch.status == "tool"
        assert "sphere alone" in touch.message
    ball = {"tool": "sphere", "radius": 2e-3, "depth": 1e-4}
    assert {touch.status for touch in model.query_all([ball | {"at": at}, ball | {"at": (0, 0, 0)}])} == {"alone"}


def test_its_file_is_the_model_and_a_damaged_one_is_none():
    model = large()
    data = pack(model.numbers())
    again = model_of(data)
    assert repr(again).endswith("at large displacements")
    asked = {"at": (0.011, 0.017, 0.0), "depth": 3e-3, "radius": RADIUS, "poisson": 0.4}
    assert again.query("sphere", **asked).force.tolist() == model.query("sphere", **asked).force.tolist()
    found = unpack(data)
    wrongs = (
        {"near_most": -1.0},
        {"near_room": -1.0},
        {"near_support": -1.0},
        {"near": VARIED.values[:1]},
        {"near": np.full((2, 1, 40), 1.0)},
    )
    for wrong in (*wrongs, {"relaxation_share": [0.1], "relaxation_time": [1.0]}):
        with pytest.raises(ModelError, match="near"):
            model_of(pack({**found, **wrong}))
    # A program that does not know large displacements must not read it as a model of small ones.
    old = bytearray(data)
    old[8] = 3
    with pytest.raises(ModelError, match="another version than 4"):
        model_of(bytes(old))
    with pytest.raises(ModelError, match="near_error"):
        model_of(pack({name: value for name, value in found.items() if name != "near_error"}))
