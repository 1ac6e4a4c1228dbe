"""Ellipsoids: nearest points, and sampling points."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from epsmesh.shapes.ovoid import Ovoid


@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (3.0, 2.0, 1.0), (5.0, 1.0, 0.2)])
def test_projection_is_the_nearest_point(axes):
    ovoid = Ovoid((1.0, -2.0, 3.0), axes)
    points = np.array(ovoid.centre) + 3 * np.random.default_rng(2).normal(size=(1000, 3))
    points[:100, 0] = ovoid.centre[0]
    projected = ovoid.project(points)
    assert ovoid.level(projected) == pytest.approx(1.0, abs=1e-12)
    sample = ovoid.sample(100_000)
    nearest, _ = cKDTree(sample).query(points)
    distance = ovoid.distance(points)
    assert np.all(np.abs(distance) <= nearest + 1e-9)
    assert np.all(nearest <= np.abs(distance) + 0.05)
    assert np.array_equal(distance > 0, ovoid.level(points) > 1)
    outside = ovoid.level(points) > 1
    assert np.array_equal(projected[outside & (points[:, 0] == 1.0), 0], np.ones((outside[:100]).sum()))


def test_a_point_on_it_stays_and_its_centre_goes_to_the_nearest_end():
    ovoid = Ovoid((0.0, 0.0, 0.0), (3.0, 2.0, 1.0))
    sample = ovoid.sample(500)
    np.testing.assert_allclose(ovoid.project(sample), sample, atol=1e-12)
    assert ovoid.distance(np.zeros((1, 3))) == pytest.approx([-1.0], rel=1e-4)
