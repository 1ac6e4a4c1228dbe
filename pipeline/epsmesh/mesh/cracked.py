"""A plane with a straight crack, meshed by triangles: a quarter of it, up to both lines of symmetry.

The crack lies along x. Lengths are in units of half its length: the tip is at x = 1.
"""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.boxes import halve_boxes, triangulate
from epsmesh.mesh.meridian import MeridianArrays, name_edges

# Groups of edges: the face of the crack, what is ahead of its tip, the line across it, and the far boundary.
FACE, AHEAD, ACROSS, FAR = "face", "ahead", "across", "far"


@dataclass(frozen=True)
class CrackGrading:
    """Element sizes at the ``tip`` of the crack, at its ``middle``, and along its ``face``; they grow by ``growth``."""

    tip: float
    middle: float
    face: float
    growth: float

    def size(self, to_tip: FloatArray, to_middle: FloatArray, to_face: FloatArray) -> FloatArray:
        """Return the sizes (n,) of elements at distances (n,) from these three."""
        pairs = (self.tip, to_tip), (self.middle, to_middle), (self.face, to_face)
        return np.minimum.reduce([size + self.growth * distance for size, distance in pairs])


def cracked_quarter(extent: float, grading: CrackGrading) -> MeridianArrays:
    """Return a mesh of 0 < x < ``extent``, −``extent`` < z < 0, with the face of a crack at 0 < x < 1, z = 0."""

    def judge(boxes: FloatArray) -> tuple[BoolArray, BoolArray]:
        x0, x1, z0, z1 = boxes.T

        def distance(low: float, high: float) -> FloatArray:
            return np.hypot(np.maximum(np.maximum(x0 - high, low - x1), 0.0), np.maximum(-z1, 0.0))

        size = np.minimum(grading.size(distance(1, 1), distance(0, 0), distance(0, 1)), extent / 4)
        return np.maximum(x1 - x0, z1 - z0) > size, z1 - z0 > x1 - x0

    marks = [np.array([0.0, 1.0, extent]), np.array([-extent, 0.0])]
    points, cells, _ = triangulate(halve_boxes(np.array([(0.0, extent, -extent, 0.0)]), marks, judge))
    corners = [(0.0, -extent), (extent, -extent), (extent, 0.0), (1.0, 0.0), (0.0, 0.0)]
    groups = [FAR, FAR, AHEAD, FACE, ACROSS]
    facets = name_edges(list(zip(corners, [*corners[1:], corners[0]], groups, strict=True)), points)
    tip = np.array([[1.0, 0.0]])
    return MeridianArrays(points, cells, np.zeros(len(cells), dtype=np.int64), facets, tip, 1.0, 0.0)
