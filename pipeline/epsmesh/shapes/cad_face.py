"""Faces of a CAD solid that is stored as triangles, and its true surface between their corners."""

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.skin import Skin
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.triangles import Triangles, doubled_normals, edge_keys, half_edges

_IN_PLANE = 1e-9  # of the solid's extent


class CadFace(Surface):
    """The ``chosen`` facets (m) of a solid: those of all faces with one name.

    A point whose nearest facet is one of them is on the face: facets are slightly off the true surface. The geometry
    kernel curves elements while it meshes; this class does not.
    """

    is_curved = False

    def __init__(self, whole: Skin, triangles: Triangles, chosen: BoolArray):
        self._whole, self._chosen = whole, chosen
        self._own = Skin(Triangles(triangles.points, triangles.facets[chosen]))

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point; 0 if no other face is nearer."""
        return np.where(self._chosen[self._whole.facets(points)], 0.0, self._own.distance(points))

    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the facets."""
        return self._own.project(points)


def raised(points: FloatArray, corners: FloatArray, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the offset of facet points (n, 3) from the true surface, and its unit normals there.

    ``corners`` (n, 3, 3) are those of the facets, ``normals`` (n, 3, 3) those of the surface at the corners. Half of
    the mean projection to the tangent planes at the corners is exact for quadratic surfaces (T. Boubekeur, M. Alexa,
    ACM Trans. Graph. 27, 141, 2008).
    """
    weights = _weights(points, corners)
    heights = ((corners - points[:, None]) * normals).sum(axis=2)
    offset = ((weights * heights)[:, :, None] * normals).sum(axis=1) / 2
    normal = (weights[:, :, None] * normals).sum(axis=1)
    return offset, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _weights(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the barycentric coordinates (n, 3) of points of triangles."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    square = (normal**2).sum(axis=1)
    first = (np.cross(c - b, points - b) * normal).sum(axis=1) / square
    second = (np.cross(a - c, points - c) * normal).sum(axis=1) / square
    return np.stack([first, second, 1 - first - second], axis=1)


def plane_piece(triangles: Triangles, start: int) -> IntArray:
    """Return the ends (k, 2) of the edges around the plane piece of the surface that contains the facet ``start``."""
    points, facets = triangles.points, triangles.facets
    normals = doubled_normals(points, facets)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    off = np.abs((points[facets] - points[facets[start, 0]]) @ normals[start]).max(axis=1)
    (flat,) = np.nonzero((off < _IN_PLANE * triangles.extent) & (normals @ normals[start] > 0))
    half = half_edges(facets[flat])
    _, first, count = np.unique(edge_keys(facets[flat], len(points)), return_index=True, return_counts=True)
    ends: IntArray = half[first[count == 1]]
    return ends
