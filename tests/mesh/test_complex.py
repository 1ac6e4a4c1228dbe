"""Tetrahedra of bodies whose regions touch: each region is filled, and neighbours have the same facets between them."""

from dataclasses import replace

import numpy as np
import pytest

from epsmesh.mesh.generate import MeshError
from epsmesh.mesh.organ.base import base
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.remesh import _closed
from epsmesh.mesh.organ.sheet import FIXED, TangledError
from epsmesh.mesh.organ.untangle import untangled
from epsmesh.mesh.organ.volume import fill
from epsmesh.mesh.size import Sizes
from epsmesh.shapes.complex import OUTSIDE, Complex
from epsmesh.shapes.files.crossings import crossings
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.skin import Skin
from tests.complexes import are_closed, blocks, neighbours, parted, scene

APART = np.array([[[1, 0, 1]]])
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


@pytest.mark.parametrize("labels", [LAYERS, APART, QUARTERS, DIAGONAL, WITHIN, HOLLOW], ids="laqdwh")
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
    assert len(neighbours(body)) == 4 + 4


def test_surfaces_that_cross_are_not_filled():
    one, other = blocks(np.zeros((2, 2, 2))), blocks(np.zeros((1, 1, 1)))
    crossing = one.holding({1: (other.points + 13e-3, other.facets)})
    with pytest.raises(MeshError, match=r"gmsh"):
        fill(crossing, even(4e-3))


@pytest.fixture(scope="module")
def organ():
    """Return an organ with a part inside it and another one that ends at its surface, and its coarse surfaces."""
    parts = parted(scene((3, 3, 3)), 1, 7, 5).partition
    made = base(parts, Skin(parts.skin), -8e-3, 10e-3)
    return parts, replace(made, sheet=untangled(made.sheet, np.empty(0, np.int64)))


def test_surfaces_between_regions_are_meshed_together_with_the_bodys(organ):
    parts, made = organ
    sheet = made.sheet
    assert 800 < len(sheet.facets) < len(parts.facets) / 3
    coarse = Complex(sheet.points, sheet.facets, sheet.sides)
    assert are_closed(coarse.facets, coarse.sides, (OUTSIDE, 0, 1, 2))
    assert not len(crossings(coarse.points, coarse.facets))
    for region in parts.regions:
        assert coarse.volume(region) == pytest.approx(parts.volume(region), rel=0.03)
    assert neighbours(coarse) == neighbours(parts)
    distance = made.faces.distance(sheet)
    assert np.quantile(distance, 0.95) < 1e-9 and distance.max() < 0.5e-3
    edges = sheet.points[sheet.junctions]
    assert len(edges) > 8 and np.median(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)) > 1.5e-3
    assert np.abs(edges[..., 0] - 19.5e-3).max() < 2e-3


def test_a_facet_that_the_remesher_doubled_within_a_wall_is_removed(organ):
    _, made = organ
    sheet = made.sheet
    number = int(np.flatnonzero((sheet.sides == (1, 0)).all(axis=1))[0])
    doubled = replace(
        sheet,
        facets=np.vstack([sheet.facets, sheet.facets[number : number + 1]]),
        group=np.append(sheet.group, sheet.group[number]),
    )
    with pytest.raises(TangledError, match=r"not closed at \("):
        doubled.neighbours()
    mended = _closed(doubled)
    mended.neighbours()
    assert len(mended.facets) == len(sheet.facets)


def test_the_support_ends_at_its_level_in_all_regions(organ):
    _, made = organ
    skin = made.sheet.skin
    below = (skin.points[skin.facets][:, :, 2] < -8e-3 + 1e-6).all(axis=1)
    np.testing.assert_array_equal(skin.kind == FIXED, below)
    fixed = skin.sides[below]
    assert {*fixed[:, 0].tolist()} == {0, 2}


def test_coarse_surfaces_are_filled(organ):
    _, made = organ
    sheet = made.sheet
    coarse = Complex(sheet.points, sheet.facets, sheet.sides)
    points, cells, regions = fill(coarse, even(8e-3))
    corners = points[cells]
    filled = np.bincount(regions, np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6)
    np.testing.assert_allclose(filled, [coarse.volume(region) for region in coarse.regions], rtol=1e-9)
