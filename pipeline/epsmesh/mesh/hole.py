"""A slice of a body with a round hole, in the half plane (r, z), meshed by triangles.

Lengths are in units of the hole's radius. The slice is as high.
"""

from math import ceil, log

import numpy as np

from epsmesh.mesh.boxes import triangulate
from epsmesh.mesh.cracked import FACE, FAR
from epsmesh.mesh.meridian import MeridianArrays, name_edges

# Group of the edges between which the slice is.
LEVEL = "level"


def slice_round_hole(extent: float, columns: int) -> MeridianArrays:
    """Return a mesh of 1 < r < ``extent``, −1 < z < 0, with so many ``columns`` along each factor e of the radius."""
    radii = np.geomspace(1.0, extent, 1 + ceil(columns * log(extent)))
    low, top = np.full(len(radii) - 1, -1.0), np.zeros(len(radii) - 1)
    points, cells, _ = triangulate(np.column_stack([radii[:-1], radii[1:], low, top]))
    corners = [(1.0, -1.0), (float(radii[-1]), -1.0), (float(radii[-1]), 0.0), (1.0, 0.0)]
    groups = [LEVEL, FAR, LEVEL, FACE]
    facets = name_edges(list(zip(corners, [*corners[1:], corners[0]], groups, strict=True)), points)
    return MeridianArrays(points, cells, np.zeros(len(cells), dtype=np.int64), facets, np.empty((0, 2)), 1.0, 0.0)
