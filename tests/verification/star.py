"""STL files of star-shaped surfaces about the origin."""

import numpy as np
from scipy.spatial import ConvexHull

from epsmesh.arrays import FloatArray
from epsmesh.shapes.files import stl

_GOLDEN = np.pi * (3 - 5**0.5)


def directions(count: int) -> FloatArray:
    """Return ``count`` unit vectors (count, 3) with about equal distances: a spiral from pole to pole."""
    number = np.arange(count) + 0.5
    height, angle = 1 - 2 * number / count, _GOLDEN * number
    ring = np.sqrt(1 - height**2)
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), height])


def star_file(points: FloatArray) -> bytes:
    """Return an STL file of the surface through ``points`` (n, 3), joined as they are on the unit sphere."""
    facets = ConvexHull(points / np.linalg.norm(points, axis=1, keepdims=True)).simplices
    inward = np.linalg.det(points[facets]) < 0
    facets[inward] = facets[inward][:, ::-1]
    return stl.written(points, facets)
