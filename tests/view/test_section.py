"""The section of a deformed body: its area is that of the plane within the body, and displacements are interpolated."""

import itertools

import numpy as np
import pytest

from epsmesh.study.read import read_mapping
from epsmesh.view.fields import Fields
from epsmesh.view.section import section_of
from tests.insertion.scenes import SCENE


def _cube(size, count):
    """Return points and cells of a cube below the top face, whose nodes are in the plane of the section, too."""
    ticks = np.linspace(-size / 2, size / 2, count)
    points = np.array([(x, y, z - size / 2) for x, y, z in itertools.product(ticks, repeat=3)])
    number = np.arange(count**3).reshape((count,) * 3)
    cells = []
    for corner in itertools.product(range(count - 1), repeat=3):
        for order in itertools.permutations(range(3)):
            steps = np.cumsum([(0, 0, 0), *(np.eye(3, dtype=int)[axis] for axis in order)], axis=0)
            cells.append([number[tuple(np.add(corner, step))] for step in steps])
    return points, np.array(cells)


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (1.0, 2.0, 0.0)])
def test_a_section_has_the_area_of_the_plane_in_the_body_and_its_displacements(direction):
    blade = {"shape": "blade", "length": "8 mm", "width": "0.4 mm", "depth": "0.1 mm", "direction": direction}
    case = next(read_mapping(SCENE | {"probe": blade}, "blade").cases())
    points, cells = _cube(8e-3, 5)
    points = points + case.frame.point
    gradient = np.array([[0.01, 0.0, 0.02], [0.0, -0.03, 0.0], [0.0, 0.01, 0.05]])
    fields = Fields(case, points, cells, {}, displacement=(points - case.frame.point) @ gradient.T)
    section = section_of(fields)
    a, b, c = np.moveaxis(section.places, 1, 0)
    edges = b - a, c - a
    area = np.abs(edges[0][:, 0] * edges[1][:, 1] - edges[0][:, 1] * edges[1][:, 0]).sum() / 2
    across, up = np.array(case.frame.across), np.array(case.frame.outward)
    width = 8e-3 / max(abs(across[0]), abs(across[1]))
    assert area == pytest.approx(width * 8e-3, rel=1e-5)
    plane = np.array([across, up])
    np.testing.assert_allclose(section.moved, section.places @ (plane @ gradient @ plane.T).T, atol=1e-8)
    np.testing.assert_allclose(section.at(0.5), section.places + section.moved / 2)
