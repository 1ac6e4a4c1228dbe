"""Crossing facets are decided exactly, also where a search in floating point is wrong about a common corner."""

import numpy as np
import pytest

from epsmesh.shapes.files import crossings as module
from epsmesh.shapes.files.crossings import crossings
from tests.organs import sphere

FLAT = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("other", "cross"),
    [
        ([[-1, 0, 1], [0, -1, 1]], False),
        ([[-2, 2, 0], [-2, 3, 0]], False),
        ([[1, 1, -1], [1, 1, 1]], True),
        ([[2, 2, 0], [2, 3, 0]], True),
        ([[0.5, 0, 1], [0.5, 0, 0]], True),
    ],
    ids=["beside", "in the plane, beside", "through", "upon", "touching"],
)
def test_two_facets_with_a_corner_in_common(other, cross):
    for size in (1.0, 0.1, 1e-3 / 3):
        points = size * np.array([*FLAT, *other])
        assert bool(len(crossings(points, np.array([[0, 1, 2], [0, 3, 4]])))) is cross


def test_pairs_that_are_found_by_mistake_are_dropped(monkeypatch):
    """The search reports all neighbours of a good surface: those with one common corner are recognised as errors."""
    points, facets = sphere(4)
    share = (facets[:, None, :, None] == facets[None, :, None, :]).any(axis=3).sum(axis=2)
    pairs = np.argwhere(np.triu(share == 1, 1))
    assert len(pairs) > 500
    monkeypatch.setattr(module, "_make_exact", lambda: None)
    monkeypatch.setattr(module, "_search", lambda *_: pairs)
    assert not len(crossings(points, facets))


def test_what_floating_point_is_sure_of_is_so_in_rational_numbers():
    random = np.random.Generator(np.random.PCG64(1))
    corners = random.standard_normal((400, 2, 3, 3))
    corners[::4, 1, 0] = corners[::4, 0, 0]
    sure = module._surely_cross(corners)
    exact = np.array([module._do_cross(*pair) for pair in corners])
    assert 20 < sure.sum() < 200
    np.testing.assert_array_equal(sure[1::4], exact[1::4])
    assert exact[sure].all()
    assert not len(module._surely_cross(corners[:0]))
