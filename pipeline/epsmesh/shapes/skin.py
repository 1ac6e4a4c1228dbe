"""A surface of triangles with a search tree: nearest points and signed distances."""

from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.triangles import Triangles


class Skin(Surface):
    """The surface of ``triangles``; libigl's search tree is made at its first use."""

    is_curved = True

    def __init__(self, triangles: Triangles):
        self._triangles = triangles

    @cached_property
    def _tree(self) -> Any:
        return tree_of(*self._arrays)

    @cached_property
    def _arrays(self) -> tuple[FloatArray, IntArray]:
        return np.array(self._triangles.points), np.array(self._triangles.facets)

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point, never negative."""
        return np.sqrt(self._nearest(points)[0])

    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points."""
        return self._nearest(points)[2]

    def facets(self, points: FloatArray) -> IntArray:
        """Return the number of the nearest facet of each point."""
        return self._nearest(points)[1]

    def depth(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point, negative outside."""
        igl = import_module("igl")
        # Signs from winding numbers: libigl's other method, with normals, needs five times the set-up time.
        sign = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
        signed, *_ = igl.signed_distance(np.ascontiguousarray(points), *self._arrays, sign)
        return -np.asarray(signed).ravel()

    def _nearest(self, points: FloatArray) -> tuple[FloatArray, IntArray, FloatArray]:
        if not len(points):
            return np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        square, facet, nearest = self._tree.squared_distance(*self._arrays, np.ascontiguousarray(points))
        return square, np.asarray(facet, dtype=np.int64), nearest


def tree_of(points: FloatArray, facets: IntArray) -> Any:
    """Return libigl's search tree of the facets (m, 3) of a surface."""
    tree = import_module("igl").AABB()
    tree.init(points, facets)
    return tree
