"""Tetrahedra of bodies whose regions touch: each region is filled, and neighbours have the same facets between them."""

import numpy as np
import pytest

from pipeline.mesh.generate import MeshError
from pipeline.mesh.organ.field import Field
from pipeline.mesh.organ.volume import fill
from pipeline.mesh.size import Sizes
from pipeline.shapes.complex import OUTSIDE, Complex
from pipeline.shapes.frame import Frame
from tests.complexes import blocks

LAYERS = np.array([[[0, 1, 2]]])
QUARTERS = np.array([[[0], [1]], [[3], [2]]])
DIAGONAL = np.array([[[0], [1]], [[1], [0]]])
WITHIN = np.pad(np.array([[[1, 2]]]), 1)
HOLLOW = np.pad(np.array([[[1, OUTSIDE]]]), 1)


def even(size: float) -> Field:
    """Return the size field of elements of one ``size`` (m)."""
    return Field(Sizes(np.inf, size, size, size, 0.0), Frame((0.0, 0.0, 0.0)), np.zeros((1, 3)))


def walls(points, cells, regions):
    """Return the facets between cells of different regions, sorted, as a set."""
    of_facet = {}
    for cell, region in zip(np.sort(cells, axis=1).tolist(), regions.tolist(), strict=True):
        for k in range(4):
            of_facet.setdefault(tuple(cell[:k] + cell[k + 1 :]), []).append(region)
    return {facet for facet, sides in of_facet.items() if len({*sides, *[OUTSIDE] * (2 - len(sides))}) == 2}


@pytest.mark.parametrize("labels", [LAYERS, QUARTERS, DIAGONAL, WITHIN, HOLLOW], ids="lqdwh")
def test_regions_that_touch_are_filled_up_to_their_common_facets(labels):
    body = blocks(labels)
    points, cells, regions = fill(body, even(4e-3))
    np.testing.assert_array_equal(points[: len(body.points)], body.points)
    corners = points[cells]
    filled = np.bincount(regions, np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6)
    np.testing.assert_allclose(filled, np.bincount(labels[labels >= 0]) * 1e-6, rtol=1e-9)
    assert walls(points, cells, regions) == {*map(tuple, np.sort(body.facets, axis=1).tolist())}


def test_the_volume_of_a_region_is_that_of_the_facets_around_it():
    body = blocks(QUARTERS)
    assert [body.volume(region) for region in body.regions] == pytest.approx([1e-6] * 4)
    assert len(body.walls()[0]) == 4 + 4


def test_surfaces_that_cross_are_not_filled():
    one, other = blocks(np.zeros((2, 2, 2))), blocks(np.zeros((1, 1, 1)))
    crossing = Complex.nested([(one.points, one.facets), (other.points + 13e-3, other.facets)])
    with pytest.raises(MeshError, match=r"gmsh"):
        fill(crossing, even(4e-3))
