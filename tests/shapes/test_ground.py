"""The surface of a support: its distance, what that is derived to, and its heights."""

from math import inf

import numpy as np
import pytest

from epsmesh.shapes.ground import Ground

UP, ALONG_X, ALONG_Y = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
PLACE = (0.1, -0.2, -2.0)
SURFACES = {
    "plane": Ground(PLACE, UP),
    "ball": Ground(PLACE, UP, 3.0, (ALONG_X, ALONG_Y)),
    "bowl": Ground(PLACE, UP, 3.0, (ALONG_X, ALONG_Y), hollow=True),
    "bolster": Ground(PLACE, UP, 3.0, (ALONG_X,)),
    "cradle": Ground(PLACE, UP, 3.0, (ALONG_Y,), hollow=True),
}


@pytest.fixture(params=SURFACES.values(), ids=SURFACES)
def ground(request):
    return request.param


def _points(count: int) -> np.ndarray:
    points = np.random.default_rng(3).uniform(-1, 1, (count, 3))
    return points * [1.0, 1.0, 0.4] + [0.0, 0.0, -1.9]


def test_the_normal_and_the_curvature_are_derivatives_of_the_distance(ground):
    points, step = _points(40), 1e-5
    found = ground.distance(points)
    assert np.linalg.norm(found.normal, axis=1) == pytest.approx(1, abs=1e-12)
    for axis, move in enumerate(step * np.eye(3)):
        after, before = ground.distance(points + move), ground.distance(points - move)
        assert (after.gap - before.gap) / (2 * step) == pytest.approx(found.normal[:, axis], abs=1e-8)
        turned = (after.normal - before.normal) / (2 * step)
        assert turned == pytest.approx(found.curvature[:, :, axis], abs=1e-8)


def test_points_at_their_height_below_are_on_the_surface(ground):
    points = _points(40)
    below = points - ground.height(points)[:, None] * np.array(UP)
    assert ground.distance(below).gap == pytest.approx(0, abs=1e-12)
    centre = np.array(PLACE) + (-1 if not ground.hollow else 1) * ground.radius * np.array(UP)
    if ground.across:
        away = (below - centre) @ np.array([*ground.across, UP]).T
        assert np.linalg.norm(away, axis=1) == pytest.approx(ground.radius, rel=1e-12)


def test_beside_a_ball_there_is_nothing_below():
    assert SURFACES["ball"].height(np.array([[4.0, 0.0, 0.0]]))[0] > 100
    assert SURFACES["bolster"].height(np.array([[0.0, 9.0, 0.0]]))[0] == pytest.approx(2.0, rel=1e-2)


def test_a_large_radius_is_a_plane(ground):
    points = _points(40)
    wide = Ground(PLACE, UP, 1e9, ground.across, ground.hollow)
    assert wide.distance(points).gap == pytest.approx(SURFACES["plane"].distance(points).gap, abs=1e-8)
    assert wide.height(points) == pytest.approx(SURFACES["plane"].height(points), abs=1e-8)
    assert SURFACES["plane"].radius == inf


def test_a_turn_of_all_changes_no_distance(ground):
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    points = _points(40)
    turned, found = ground.turned(turn).distance(points @ turn.T), ground.distance(points)
    assert turned.gap == pytest.approx(found.gap, abs=1e-12)
    assert turned.normal == pytest.approx(found.normal @ turn.T, abs=1e-12)
