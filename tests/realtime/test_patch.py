"""Tips by a patch: held against formulas of balls and cones, H. Hertz's ellipses and a loop's work."""

from dataclasses import replace
from math import pi, tan

import numpy as np
import pytest
from scipy.special import ellipe, ellipkm1

from epsmesh_realtime import ModelError, Patch, Tip
from epsmesh_realtime.table import Table
from tests.realtime.synthetic import random_model

BALL = Tip(lambda x, y: 6e-3 - np.sqrt(np.maximum(36e-6 - x**2 - y**2, 0)), 3.6e-3)
CONE = Tip(lambda x, y: np.hypot(x, y) / tan(1.2), 5e-3)
LONG = Tip(lambda x, y: 30 * x**2 + 120 * y**2, 4e-3)
AT = (0.011, 0.007, 0.0)


def half_space():
    model = random_model()
    table = Table(np.full((1, 1, 1), 1 / 45), np.zeros((1, 1, 1)), 45.0, model.table.reach, False, (0.3, 0.49))
    return replace(model, table=table)


@pytest.mark.parametrize(
    ("tip", "name", "sizes"),
    [(BALL, "sphere", {"radius": 6e-3}), (CONE, "cone", {"radius": 5e-3, "angle": 1.2})],
)
def test_round_tips_are_those_of_the_formulas(tip, name, sizes):
    model, rng = random_model(), np.random.default_rng(2)
    patch = Patch(model, tip)
    for _ in range(12):
        x, y = 0.8 * rng.uniform(-1, 1, 2) * model.table.reach
        asked = {"at": (x, y, 0.0), "depth": float(rng.uniform(5e-5, 5e-4)), "poisson": rng.uniform(0.3, 0.49)}
        known, found = model.query(name, **asked, **sizes), patch.query(**asked, turn=rng.uniform(0, 6))
        assert (known.status, found.status) == ("ok", "ok")
        assert found.force[2] == pytest.approx(known.force[2], rel=5e-3)
        assert np.linalg.norm(found.force - known.force) < 5e-3 * known.force[2]
        assert found.stiffness == pytest.approx(known.stiffness, rel=0.06)
        assert found.force_error > known.force_error
        assert found.contact_radius == pytest.approx(known.contact_radius, rel=0.12)


@pytest.mark.parametrize("ratio", [1.0 - 1e-9, 0.5, 0.3])
def test_an_ellipsoid_is_that_of_hertz(ratio):
    a, model = 1.2e-3, half_space()
    b, plane = ratio * a, 1 / (1 - 0.45**2)
    square = 1 - ratio**2
    k, e = ellipkm1(ratio**2), ellipe(square)
    pressure = 0.05 * plane  # K. L. Johnson, Contact Mechanics, 4.2
    along = pressure / plane * b / (square * a**2) * (k - e)
    across = pressure / plane * b / (square * a**2) * (e / ratio**2 - k)
    depth, force = pressure / plane * b * k, 2 / 3 * pi * pressure * a * b
    tip = Tip(lambda x, y: along * x**2 + across * y**2, 3e-3)
    patch = Patch(model, tip)
    for turn in (0.0, 0.7):
        touch = patch.query(at=AT, depth=depth, turn=turn)
        assert touch.status == "ok"
        assert touch.force[2] / model.young == pytest.approx(force, rel=6e-3)
        assert np.abs(touch.force[:2]).max() < 1e-9 * touch.force[2]


def test_a_closed_loop_does_no_work():
    model = random_model()
    patch = Patch(model, LONG)
    angle = 2 * pi * np.arange(48) / 48
    places = np.stack([0.008 + 0.006 * np.cos(angle), 0.01 + 0.005 * np.sin(angle), 0 * angle], axis=1)
    moved = np.stack([-0.006 * np.sin(angle), 0.005 * np.cos(angle), 0 * angle], axis=1)
    touches = [patch.query(at=place, depth=2e-4, turn=0.4) for place in places]
    assert {touch.status for touch in touches} == {"ok"}
    work = 2 * pi / 48 * sum(float(t.force @ m) for t, m in zip(touches, moved, strict=True))
    size = 2 * pi / 48 * sum(abs(float(t.force @ m)) for t, m in zip(touches, moved, strict=True))
    assert abs(work) < 1e-3 * size
    assert abs(work) < 1e-6 * 0.4 * touches[0].force[2] * 2e-4


def test_where_it_begins_tells_nothing_of_where_it_ends():
    model = random_model()
    warm = Patch(model, LONG)
    for depth in (4e-4, 1e-5, 2e-4):
        touch = warm.query(at=AT, depth=depth, turn=0.3)
        cold = Patch(model, LONG).query(at=AT, depth=depth, turn=0.3)
        assert touch.force == pytest.approx(cold.force, rel=1e-9)
    other = warm.query(at=AT, depth=2e-4, turn=0.3 + pi, young=2 * model.young)
    assert other.force[2] == pytest.approx(2 * touch.force[2], rel=5e-3)


@pytest.mark.parametrize(
    ("asked", "status"),
    [
        ({"depth": -1e-4}, "no contact"),
        ({"depth": 1e-3}, "large"),
        ({"at": (0.0, 0.0249, 0.0), "depth": 4.7e-4}, "large"),
        ({"at": (0.0301, 0.0, 0.0)}, "outside"),
        ({"at": (0.0, 0.0, 1e-3)}, "off"),
        ({"poisson": 0.2}, "poisson"),
        ({"depth": np.nan}, "input"),
        ({"turn": np.inf}, "input"),
    ],
)
def test_what_a_patch_does_not_know_it_refuses(asked, status):
    touch = Patch(random_model(), LONG).query(**({"at": AT, "depth": 1e-4} | asked))
    assert touch.status == status
    assert status == "no contact" or np.isnan([*touch.force, touch.force_error]).all()


@pytest.mark.parametrize(
    ("height", "word"),
    [
        (lambda x, y: np.sqrt(np.hypot(x, y)), "convex"),
        (lambda x, y: 1e-3 + x**2 + y**2, "axis"),
        (lambda x, y: x**2, "higher"),
        (lambda x, y: x**2 / (y > 0), "finite"),
    ],
)
def test_what_is_no_convex_tip_is_refused(height, word):
    with pytest.raises(ValueError, match=word), np.errstate(all="ignore"):
        Tip(height, 2e-3)


def test_a_face_that_is_not_flat_has_no_patch():
    with pytest.raises(ModelError, match="flat"):
        Patch(random_model(curved=True), LONG)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_tip_whose_height_fails_has_no_force():
    known = {"fails": False}

    def height(x, y):
        if known["fails"]:
            raise ArithmeticError
        return 30 * x**2 + 120 * y**2

    patch = Patch(random_model(), Tip(height, 4e-3))
    assert patch.query(at=AT, depth=1e-4).status == "ok"
    known["fails"] = True
    touch = patch.query(at=AT, depth=1e-4)
    assert touch.status == "large"
    assert np.isnan(touch.force).all()


def test_many_queries_of_a_tip_are_those_of_many_calls():
    model, rng = random_model(), np.random.default_rng(8)
    at = np.column_stack([rng.uniform(-0.02, 0.02, (12, 2)), np.zeros(12)])
    depth, turn = rng.uniform(-5e-5, 4e-4, 12), rng.uniform(0, 6, 12)
    one = Patch(model, LONG)
    known = [one.query(at=at[k], depth=depth[k], turn=turn[k]) for k in range(12)]
    found = Patch(model, LONG).query_many(at=at, depth=depth, turn=turn)
    assert {*found.status} == {"ok", "no contact"}
    assert [*found.status] == [touch.status for touch in known]
    np.testing.assert_array_equal(found.force, [touch.force for touch in known])
    np.testing.assert_array_equal(found.stiffness, [touch.stiffness for touch in known])
