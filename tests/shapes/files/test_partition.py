"""Surfaces between several labels: closed around each of them, common to neighbours, accurate, and of their volume."""

import numpy as np
import pytest

from epsmesh.shapes.complex import OUTSIDE
from epsmesh.shapes.files.crossings import crossings
from epsmesh.shapes.files.labels import LabelMap
from epsmesh.shapes.files.marching import march
from epsmesh.shapes.files.partition import partition_of
from epsmesh.shapes.triangles import SurfaceError, doubled_normals
from tests.complexes import AXES, CENTRE, INNER, are_closed, neighbours, parted, scene


@pytest.mark.parametrize("spacing", [(2, 2, 2), (3, 3, 3), (1.5, 1.5, 3)])
def test_labels_share_accurate_surfaces_and_keep_their_volumes(spacing):
    image = scene(spacing)
    found = parted(image, 1, 7, 5)
    body = found.partition
    assert not found.notices
    for region, label in enumerate((1, 7, 5)):
        wanted = (image.values == label).sum() * np.prod(image.spacing)
        assert body.volume(region) == pytest.approx(wanted, rel=1e-3)
    assert neighbours(body) == {(OUTSIDE, 0), (OUTSIDE, 2), (0, 1), (0, 2)}
    assert are_closed(body.facets, body.sides, (OUTSIDE, 0, 1, 2))
    within = body.points[np.unique(body.facets[(body.sides == (1, 0)).all(axis=1)])] * 1e3
    level = np.linalg.norm((within - CENTRE) / INNER, axis=1)
    slope = np.linalg.norm((within - CENTRE) / INNER**2, axis=1) / level
    assert np.sqrt((((level - 1) / slope) ** 2).mean()) < 0.2 * max(spacing)
    plane = body.points[np.unique(body.facets[(body.sides == (2, 0)).all(axis=1)])] * 1e3
    inner = np.linalg.norm(plane[:, 1:] / AXES[1:], axis=1) < 0.4
    assert np.abs(plane[inner, 0] - 18).max() < 0.5 * max(spacing) + 0.1


def test_an_offset_moves_the_bodys_surface_and_regions_that_it_bounds():
    inward, as_is, outward = (parted(scene((3, 3, 3)), 1, 7, 5, offset=offset).partition for offset in (-1e-3, 0, 1e-3))
    moved = [(outward.volume(region) - inward.volume(region)) / 2e-3 for region in (0, 1, 2)]
    areas = np.linalg.norm(doubled_normals(as_is.points, as_is.facets), axis=1) / 2
    area = [areas[(as_is.sides == (region, OUTSIDE)).all(axis=1)].sum() for region in (0, 1, 2)]
    np.testing.assert_allclose(moved, area, rtol=0.06)


def test_two_labels_have_the_surface_of_one():
    image = scene((2, 2, 2))
    alone = parted(image, 1, 5).partition
    whole = parted(LabelMap(np.where(image.values == 5, 1, image.values), image.affine), 1).partition
    assert alone.volume(0) + alone.volume(1) == pytest.approx(whole.volume(0), rel=1e-3)
    skin = alone.points[np.unique(alone.facets[alone.sides[:, 1] == OUTSIDE])]
    distance = np.array([np.linalg.norm(skin - point, axis=1).min() for point in whole.points[::20]])
    assert np.median(distance) < 0.01e-3
    assert np.quantile(distance, 0.95) < 0.3e-3  # also where the labels meet at the surface


@pytest.mark.parametrize("count", [2, 3, 6])
def test_no_facets_cross_between_labels_at_random(count):
    weights, outside = np.random.default_rng(count).random((count, 7, 6, 5)), np.ones((7, 6, 5))
    outside[1:-1, 1:-1, 1:-1] = np.random.default_rng(9).random((5, 4, 3)) - 0.6
    points, facets, sides = march(outside, weights)
    assert are_closed(facets, sides, range(OUTSIDE, count))
    assert not len(crossings(points, facets))


def test_what_is_too_thin_or_too_small_is_told():
    image = scene((2, 2, 2))
    values = image.values.copy()
    sheet = np.zeros_like(values, dtype=bool)
    sheet[:, values.shape[1] // 2] = True
    values[sheet & (values == 1)] = 3
    thin = LabelMap(values, image.affine)
    with pytest.raises(SurfaceError, match=r'label 3 is thinner than the width of the filter.* `smooth = "1 mm"`'):
        parted(thin, 1, 7, 5, 3, smooth=6e-3)
    body = partition_of(thin, [(1, 6e-3), (7, 6e-3), (5, 6e-3), (3, 1e-3)]).partition
    assert body.volume(3) == pytest.approx((values == 3).sum() * 8e-9, rel=1e-3)
    values = image.values.copy()
    values[20, 18, 10:30][values[20, 18, 10:30] == 1] = 3
    line = parted(LabelMap(values, image.affine), 1, 7, 5, 3)  # the default filter is narrowed
    assert line.partition.volume(3) == pytest.approx((values == 3).sum() * 8e-9, rel=0.01)
    assert any("label 3 is thin: its filter is 1 mm wide" in notice for notice in line.notices)
    values = image.values.copy()
    values[20, 20, 12] = 7
    assert values.shape > (20, 20, 12) and image.values[20, 20, 12] == 1
    notices = parted(LabelMap(values, image.affine), 1, 7, 5, smooth=0.8e-3).notices
    assert len(notices) == 1 and "label 7: parts of less than 8 voxels" in notices[0]
