"""Smoothed meshes: better elements of the same sizes, on the same boundary and between the same regions."""

from itertools import product

import numpy as np
import pytest

from epsmesh.mesh.generate import MeshArrays, generate
from epsmesh.mesh.of_case import _scene
from epsmesh.mesh.smooth import smoothed
from epsmesh.scene.model import FREE
from tests.cases import study

SKIN = {"name": "skin", "thickness": "4 mm", "young": "50 kPa", "poisson": 0.3}


def shapes(mesh: MeshArrays) -> np.ndarray:
    """Return the mean ratio of each cell, 1 for a regular one: 12 (3 V)^(2/3) over the sum of squared edges."""
    corners = mesh.points[mesh.cells]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    squares = sum(np.sum((corners[:, i] - corners[:, j]) ** 2, axis=1) for i in range(4) for j in range(i))
    return 12 * np.cbrt(3 * volumes) ** 2 / squares


@pytest.mark.parametrize("size", [1.0, 1e-4])
def test_the_centre_of_an_octahedron_moves_to_its_middle(size):
    corners = np.vstack([np.eye(3), -np.eye(3)])
    points = size * np.vstack([corners, [(0.2, -0.3, 0.25)]])
    faces = np.array(list(product((0, 3), (1, 4), (2, 5))))
    cells = np.column_stack([np.full(8, 6), faces])
    inverted = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[inverted] = cells[inverted][:, [0, 1, 3, 2]]
    found = smoothed(MeshArrays(points, cells, {FREE: faces}, np.empty(0, dtype=np.int64), 0.0))
    assert np.abs(found.points[6]).max() < 0.01 * size
    assert np.array_equal(found.points[:6], points[:6])


def test_elements_are_better_and_boundaries_and_regions_the_same():
    changes = {"body": {"shape": "cylinder", "radius": "20 mm", "height": "15 mm", "fixed": "bottom", "layer": [SKIN]}}
    case = study(**changes, probe={"at": ["4 mm", "3 mm"]}, mesh={"fine": "3 mm"}).case(())
    plain = generate(*_scene(case, is_coarse=False))
    found = smoothed(plain)
    before, after = shapes(plain), shapes(found)
    assert (1 / after**2).mean() < 0.98 * (1 / before**2).mean()
    assert np.quantile(after, 0.01) > np.quantile(before, 0.01)
    moved = np.any(found.points != plain.points, axis=1)
    assert not moved[np.unique(np.concatenate([triangles.reshape(-1) for triangles in plain.facets.values()]))].any()
    first, second = (np.unique(plain.cells[plain.regions == number]) for number in (0, 1))
    assert not moved[np.intersect1d(first, second)].any()
    # Their sizes, too: no cell far from the edge of contact shrinks to that of one beside it.
    sizes = [np.cbrt(np.linalg.det(m.points[m.cells][:, 1:] - m.points[m.cells][:, :1])) for m in (plain, found)]
    assert np.quantile(sizes[1] / sizes[0], [0.01, 0.99]) == pytest.approx(1, abs=0.5)
