"""Lines along a probe's axis through a triangulated surface, and nearest points of it."""

from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.edges import Edges

# Pairs of points and facets processed together: arrays of some ten megabytes.
_AT_ONCE = 2_000_000
# Four bits as numpy packs them.
_ALL_SIDES = 0b1111_0000
# A point outside a facet by less than this, in units of the facet, is on its edge.
_ON_EDGE = 1e-9


def facing(local: FloatArray, facets: IntArray, radius: float) -> IntArray:
    """Return the facets that face upwards within ``radius`` of the z axis.

    Only those connected to the point nearest to the origin at which the axis meets the surface; none without one.
    """
    # Facets whose bounding boxes meet the square around the disc.
    x, y = local[:, 0], local[:, 1]
    within = np.packbits([x <= radius, x >= -radius, y <= radius, y >= -radius], axis=0)[0]
    (chosen,) = np.nonzero((within[facets[:, 0]] | within[facets[:, 1]] | within[facets[:, 2]]) == _ALL_SIDES)
    chosen = chosen[_areas(local[facets[chosen]][:, :, :2]) > 0]
    hit, _ = pierce(local, facets[chosen], np.zeros((1, 2)), nearest=True)
    if hit[0] < 0 or not len(chosen):
        return chosen[:0]
    _, shell = Edges(facets[chosen]).shells
    return chosen[shell == shell[hit[0]]]


def pierce(
    local: FloatArray, facets: IntArray, points: FloatArray, nearest: bool = False
) -> tuple[IntArray, FloatArray]:
    """Return the first facet from above on each line along z through ``points`` (n, 2), and z there.

    The facet is -1 for a line that meets none. With ``nearest`` it is the one nearest to z = 0 instead.
    """
    a, b, c = (local[facets[:, k]] for k in range(3))
    double = _areas(np.stack([a[:, :2], b[:, :2], c[:, :2]], axis=1))
    hit, height = np.full(len(points), -1), np.full(len(points), np.nan)
    step = max(1, _AT_ONCE // max(1, len(facets)))
    for start in range(0, len(points), step):
        x, y = (points[start : start + step, k, None] for k in (0, 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            u = ((b[:, 0] - x) * (c[:, 1] - y) - (b[:, 1] - y) * (c[:, 0] - x)) / double
            v = ((c[:, 0] - x) * (a[:, 1] - y) - (c[:, 1] - y) * (a[:, 0] - x)) / double
            inside = (u >= -_ON_EDGE) & (v >= -_ON_EDGE) & (u + v <= 1 + _ON_EDGE)
        row, column = np.nonzero(inside)
        s, t = u[row, column], v[row, column]
        z = s * a[column, 2] + t * b[column, 2] + (1 - s - t) * c[column, 2]
        # The last entry written to a row must be the wanted one.
        order = np.lexsort((column, -np.abs(z) if nearest else z))
        hit[start + row[order]], height[start + row[order]] = column[order], z[order]
    return hit, height


def nearest_point(points: FloatArray, facets: IntArray, place: FloatArray) -> tuple[int, FloatArray]:
    """Return the facet nearest to a ``place`` (3), and the nearest point on it."""
    corners = points[facets]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    distance = np.linalg.norm(middle - place, axis=1)
    (candidates,) = np.nonzero(distance - radius <= (distance + radius).min())
    found = _closest(corners[candidates], place)
    best = int(np.argmin(((found - place) ** 2).sum(axis=1)))
    return int(candidates[best]), found[best]


def _closest(corners: FloatArray, place: FloatArray) -> FloatArray:
    """Return the point nearest to ``place`` in each triangle (m, 3, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    square = (normal**2).sum(axis=1)
    u = (np.cross(c - b, place - b) * normal).sum(axis=1)
    v = (np.cross(a - c, place - c) * normal).sum(axis=1)
    w = square - u - v
    inside = (u >= 0) & (v >= 0) & (w >= 0) & (square > 0)
    best = np.full(len(corners), np.inf)
    result = np.empty((len(corners), 3))
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        length = (along**2).sum(axis=1)
        t = np.clip(((place - start) * along).sum(axis=1) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        point = start + t[:, None] * along
        distance = ((point - place) ** 2).sum(axis=1)
        closer = distance < best
        best[closer], result[closer] = distance[closer], point[closer]
    weights = np.stack([u, v, w], axis=1)[inside] / square[inside, None]
    result[inside] = (weights[:, :, None] * corners[inside]).sum(axis=1)
    return result


def _areas(corners: FloatArray) -> FloatArray:
    """Return twice the areas of plane triangles (m, 3, 2), negative if clockwise."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area: Any = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return area
