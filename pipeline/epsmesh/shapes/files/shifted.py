"""A surface shifted along its normals: the boundary of a segmentation a bit further out, or in."""

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files.raw import Raw
from epsmesh.shapes.files.whole import made_whole
from epsmesh.shapes.triangles import SurfaceError, Triangles, doubled_normals

_STEEPEST = 0.5  # least cosine between a point's normal and those of its facets, on average


def shifted(triangles: Triangles, offset: float) -> Triangles:
    """Return a surface whose facets are shifted outward by an ``offset`` (m).

    Points move along their normals, the mean by angle of those of their facets, so far that these move by the offset:
    exact where two or three planes meet at equal angles, and to first order on curved surfaces.

    Raises:
        SurfaceError: if facets then cross, or overturn.
    """
    points, facets = triangles.points, triangles.facets
    doubled = doubled_normals(points, facets)
    units = doubled / np.linalg.norm(doubled, axis=1, keepdims=True)
    corners = points[facets]
    sums, weights = np.zeros_like(points), np.zeros(len(points))
    angles = [_angle(corners[:, k], corners[:, k - 1], corners[:, k - 2]) for k in range(3)]
    for k, angle in enumerate(angles):
        np.add.at(sums, facets[:, k], angle[:, None] * units)
        np.add.at(weights, facets[:, k], angle)
    normals = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    along = np.linalg.norm(sums, axis=1) / weights  # the mean cosine
    moved = points + offset * normals / np.maximum(along, _STEEPEST)[:, None]
    flipped = (doubled_normals(moved, facets) * doubled).sum(axis=1) <= 0
    if flipped.any():
        x, y, z = 1e3 * points[facets[flipped][0, 0]]
        raise SurfaceError(
            f"`offset` {1e3 * offset:.3g} mm overturns {int(flipped.sum())} facets, the first at {x:.4g}, {y:.4g}, "
            f"{z:.4g} mm: use a smaller offset, or `smooth`"
        )
    try:
        return made_whole(Raw(moved, facets), 1.0)[0]
    except SurfaceError as error:
        raise SurfaceError(f"after an `offset` of {1e3 * offset:.3g} mm, {error}") from error


def _angle(corner: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    first, second = one - corner, other - corner
    size = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.arctan2(size, (first * second).sum(axis=1)))
