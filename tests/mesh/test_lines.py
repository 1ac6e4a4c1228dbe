"""Lines in a plane."""

import numpy as np
import pytest

from epsmesh.mesh.organ.contact import cross

_SQUARE = np.array([[0.0, 0.0], [1, 0], [1, 1], [0, 1]])


@pytest.mark.parametrize(
    ("points", "crosses"),
    [
        pytest.param(_SQUARE, False, id="square"),
        pytest.param(_SQUARE[[0, 2, 1, 3]], True, id="bow tie"),
        pytest.param(np.insert(_SQUARE, 3, [0.5, -0.1], axis=0), True, id="a corner through the other side"),
        pytest.param(np.insert(_SQUARE, 3, [0.5, 0.0], axis=0), True, id="a corner on the other side"),
        pytest.param(np.insert(_SQUARE, 3, [0.5, 0.1], axis=0), False, id="a corner close to the other side"),
        pytest.param(
            np.array([[0, 0], [0.3, 0], [0.7, 0], [1, 0], [1, 1], [0, 1]]), False, id="straight legs in pieces"
        ),
    ],
)
def test_closed_lines_cross(points, crosses):
    assert cross(points, np.roll(points, -1, axis=0)) == crosses


def test_lines_apart_and_one_through_another():
    start = np.vstack([_SQUARE, 3 * _SQUARE - 1])
    end = np.vstack([np.roll(_SQUARE, -1, axis=0), 3 * np.roll(_SQUARE, -1, axis=0) - 1])
    assert not cross(start, end)
    assert cross(start, end + np.repeat([[0.0], [1.5]], 4, axis=0))


@pytest.mark.parametrize(("begin", "crosses"), [(0.5, True), (1.5, False)])
def test_pieces_of_one_line_meet_where_they_overlap(begin, crosses):
    along = np.array([3.0, 1.0])
    assert cross(np.outer([0.0, begin], along), np.outer([1.0, begin + 1.0], along)) == crosses
