"""How large elements may be where two sides of a surface are near to each other: across thin parts, and narrow gaps.

Chords of elements leave the true surface, by more the larger they are: those of two sides would meet.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import FloatArray, IntArray
from pipeline.shapes.skin import tree_of
from pipeline.shapes.triangles import doubled_normals

# Elements shrink no further than to this share of what they are elsewhere: at sharp rims the thickness is nought.
_LEAST = 0.25
# Two sides face each other if the cosine between their normals is below this; those of a wedge of 60° or more do not.
_OPPOSITE = -0.5
# Rays start this far off the surface, in units of the largest elements.
_OFF = 1e-4
# Points, at most, from which rays start: some ten across an element.
_MOST_RAYS = 40_000
# How fast sizes grow with the distance from there, and in how many steps they are told apart.
_GROWTH, _STEPS = 1.0, 8


@dataclass(frozen=True, eq=False)
class Narrow:
    """The ``points`` (n, 3) where sides are near to each other, and the ``sizes`` (n) of elements there, all in m."""

    points: FloatArray
    sizes: FloatArray

    def __bool__(self) -> bool:
        return len(self.points) > 0

    def at(self, points: FloatArray) -> FloatArray:
        """Return the largest size (m) that elements may have at points (n, 3), infinite if nothing is narrow."""
        size = np.full(len(points), np.inf)
        for least, tree in self._trees:
            distance, _ = tree.query(points)
            size = np.minimum(size, least + _GROWTH * distance)
        return size

    @cached_property
    def _trees(self) -> list[tuple[float, cKDTree]]:
        """The points in groups of much the same size, with the smallest one of each group."""
        if not self:
            return []
        bounds = np.geomspace(self.sizes.min(), self.sizes.max(), _STEPS + 1)[1:-1]
        group = np.searchsorted(bounds, self.sizes)
        return [(float(self.sizes[group == k].min()), cKDTree(self.points[group == k])) for k in np.unique(group)]


NOWHERE = Narrow(np.empty((0, 3)), np.empty(0))


def narrow_places(points: FloatArray, facets: IntArray, largest: float) -> Narrow:
    """Return where sides of a surface are nearer to each other than the ``largest`` elements are large (m).

    Elements there are to be no larger than that distance.
    """
    some = slice(None, None, -(-len(points) // _MOST_RAYS))
    distance = across(points, facets, some, _OFF * largest)
    near = distance < largest
    return Narrow(points[some][near], np.maximum(distance[near], _LEAST * largest))


def across(points: FloatArray, facets: IntArray, some: slice, off: float) -> FloatArray:
    """Return the distance (m) of ``some`` points to the side across from them, within or outside; infinite if none is.

    Lines along their normals start ``off`` (m) the surface.
    """
    normals = doubled_normals(points, facets)
    mean = np.zeros_like(points)
    np.add.at(mean, facets, normals[:, None])
    start, direction = points[some], _unit(mean)[some]
    tree, unit = tree_of(points, facets), _unit(normals)
    least = np.full(len(start), np.inf)
    for sense in (-1.0, 1.0):
        ray = sense * direction
        facet, distance, _ = tree.intersect_ray_first(points, facets, start + off * ray, ray)
        is_across = (facet >= 0) & ((unit[facet] * direction).sum(axis=1) < _OPPOSITE)
        least = np.where(is_across, np.minimum(least, distance + off), least)
    return least


def _unit(vectors: FloatArray) -> FloatArray:
    result: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny)
    return result
