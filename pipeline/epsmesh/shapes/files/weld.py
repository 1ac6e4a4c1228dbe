"""Merging of equal points."""

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray


def weld(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct points among ``points`` (n, 3), in order of appearance, and the number of each point (n,)."""
    points = points + 0.0  # -0 is 0
    keys = _mixed(points)
    order = np.argsort(keys, kind="stable")
    new = np.ones(len(keys), dtype=bool)
    new[1:] = np.diff(keys[order]) != 0
    number, first = _numbered(order, new)
    if (points[first][number] != points).any():  # two points share a key
        order = np.lexsort(points.T)
        new[1:] = (np.diff(points[order], axis=0) != 0).any(axis=1)
        number, first = _numbered(order, new)
    return points[first], number


def _numbered(order: IntArray, new: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the number of each element sorted by ``order``, grouped where ``new`` begins one, and the first ones."""
    groups = np.empty(len(order), dtype=np.int64)
    groups[order] = np.cumsum(new) - 1
    first = order[new]  # sorts are stable: the first of each group
    by_place = np.argsort(first)
    rank = np.empty(len(first), dtype=np.int64)
    rank[by_place] = np.arange(len(first))
    return rank[groups], first[by_place]


def _mixed(points: FloatArray) -> IntArray:
    """Return a key for each point, equal for equal points: one number sorts faster than three."""
    bits = np.ascontiguousarray(points, dtype=np.float64).view(np.uint64)
    factors = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
    bits = bits ^ (bits >> np.uint64(29))
    mixed = (bits * factors).sum(axis=1, dtype=np.uint64)
    return mixed ^ (mixed >> np.uint64(32))


def drop_unused(points: FloatArray, facets: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the points that facets use, and the facets renumbered."""
    used = np.zeros(len(points), dtype=bool)
    used[facets] = True
    return points[used], (np.cumsum(used) - 1)[facets]
