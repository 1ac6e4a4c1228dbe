"""A closed surface of triangles, such as a segmented organ, and the error for one that is not closed."""

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.frame import Vector

# Bits of a point's number: three of them fit one integer.
_POINT_BITS = 21


class SurfaceError(ValueError):
    """A file does not bound a piece of tissue. The message says what was found in it and how to repair it."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """The boundary of one piece of tissue.

    ``points`` (n, 3) in m are distinct, and each has a facet. ``facets`` (m, 3) are point numbers, counterclockwise
    seen from outside. Every edge has two facets. Both arrays are read-only.
    """

    points: FloatArray
    facets: IntArray

    def __post_init__(self) -> None:
        for array in (self.points, self.facets):
            array.setflags(write=False)

    @cached_property
    def volume(self) -> float:
        """Enclosed volume (m³)."""
        return enclosed(self.points, self.facets)

    @cached_property
    def area(self) -> float:
        """Area (m²)."""
        return float(np.linalg.norm(doubled_normals(self.points, self.facets), axis=1).sum()) / 2

    @cached_property
    def curvature(self) -> float:
        """Twice the surface integral (m) of the mean curvature: angle between facets at each edge, times its length."""
        edges, owners = closed_edges(self.facets)
        start, end = self.points[edges.T]
        normals = doubled_normals(self.points, self.facets)
        one, other = normals[owners.T]
        turn = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1))
        return float((turn * np.linalg.norm(end - start, axis=1)).sum())

    @cached_property
    def bounds(self) -> tuple[Vector, Vector]:
        """Lowest and highest coordinates (m)."""
        low, high = self.points.min(axis=0).tolist(), self.points.max(axis=0).tolist()
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])

    @cached_property
    def extent(self) -> float:
        """Largest extent (m) along a coordinate axis."""
        low, high = self.bounds
        return max(top - bottom for bottom, top in zip(low, high, strict=True))

    @cached_property
    def hash(self) -> str:
        """Hash of its points and facets, by which meshes of it are identified."""
        content = sha256(f"{self.points.shape}{self.facets.shape}".encode())
        content.update(np.ascontiguousarray(self.points, dtype="<f8").data)
        content.update(np.ascontiguousarray(self.facets, dtype="<i8").data)
        return content.hexdigest()


def half_edges(facets: IntArray) -> IntArray:
    """Return start and end points (3m, 2): row 3f + k is the edge of facet f from its corner k to the next."""
    return np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)


def edge_keys(facets: IntArray, count: int) -> IntArray:
    """Return a key for each half edge (3m,) of facets of ``count`` points, equal for both directions."""
    pairs = np.sort(half_edges(facets), axis=1)
    keys: IntArray = pairs[:, 0] * count + pairs[:, 1]
    return keys


def facet_keys(facets: IntArray) -> IntArray:
    """Return one integer for each facet (k, 3), whatever the order of its points."""
    low, middle, high = np.sort(facets, axis=1).T.astype(np.int64)
    return np.asarray((low << 2 * _POINT_BITS) | (middle << _POINT_BITS) | high)


def closed_edges(facets: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (k, 2) of a closed surface, lower number first, and the two facets (k, 2) of each."""
    pairs = np.sort(half_edges(facets), axis=1)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return pairs[order[::2]], (order // 3).reshape(-1, 2)


def doubled_normals(points: FloatArray, facets: IntArray) -> FloatArray:
    """Return the normals (m, 3) of facets, with twice the facets' areas as lengths."""
    a, b, c = (points[facets[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def enclosed(points: FloatArray, facets: IntArray) -> float:
    """Return the volume within closed facets, negative if they are clockwise seen from outside."""
    # Relative to the centre of the points: a distant origin would cause cancellation.
    a, b, c = (points[facets[:, k]] - points.mean(axis=0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6
