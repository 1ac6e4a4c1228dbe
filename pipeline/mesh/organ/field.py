"""Size field around a footprint on a curved surface, from distances in space to its true edge."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import FloatArray
from pipeline.mesh.regions import EmbeddedSizes, distance_field
from pipeline.mesh.size import Sizes, set_background
from pipeline.shapes.frame import Frame


@dataclass(frozen=True, eq=False)
class Field:
    """``sizes`` around a ``frame``, and those of ``embedded`` regions.

    ``edge`` (n, 3), in m, are dense points along the footprint's edge.
    """

    sizes: Sizes
    frame: Frame
    edge: FloatArray
    embedded: tuple[EmbeddedSizes, ...] = ()

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.edge)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3) of the surface."""
        distance, _ = self._tree.query(points)
        size = self.sizes.at(points, self.frame.point, distance)
        for region in self.embedded:
            size = np.minimum(size, region.at(points))
        return size

    def set(self, scale: float, kernel: Any) -> None:
        """Set the background field of gmsh's current model, whose unit is ``scale`` metres.

        Distances are those from points along the footprint's edge, which are added to the model with its ``kernel``.
        """
        distance = distance_field(self.edge / scale, kernel)
        terms = self.sizes.terms(self.frame.point, f"F{distance}", 1 / scale)
        set_background([*terms, *(term for region in self.embedded for term in region.terms(1 / scale, kernel))])
