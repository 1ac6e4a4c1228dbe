"""Size field around a contact on a curved surface, from distances in space to its true or expected edge."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import FloatArray
from epsmesh.mesh.regions import LocalSizes, distance_field
from epsmesh.mesh.size import Sizes, set_background
from epsmesh.shapes.frame import Frame


@dataclass(frozen=True, eq=False)
class Field:
    """``sizes`` around a ``frame``, and those of the body's regions, or around a second jaw.

    ``edge`` (n, 3), in m, are dense points along the edge of contact, where it is expected to end if it is found.
    """

    sizes: Sizes
    frame: Frame
    edge: FloatArray
    local: tuple[LocalSizes, ...] = ()

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.edge)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3) of the surface."""
        size = self.sizes.at(points, self.frame.point, self._to_rim(points))
        for part in self.local:
            size = np.minimum(size, part.at(points))
        return size

    def set(self, scale: float, kernel: Any) -> None:
        """Set the background field of gmsh's current model, whose unit is ``scale`` metres.

        Points to which it refers are added to the model with its ``kernel``.
        """
        set_background(self.terms(1 / scale, kernel))
        kernel.synchronize()

    def terms(self, unit: float, kernel: Any) -> Iterator[str]:
        """Yield limits of the size, whose minimum counts, as text for gmsh: see :class:`.LocalSizes`."""
        yield from self.sizes.terms(self.frame.point, self._rim_text(unit, kernel), unit)
        for part in self.local:
            yield from part.terms(unit, kernel)

    def _to_rim(self, points: FloatArray) -> FloatArray:
        """Return distances (m) to the expected edge of contact."""
        return np.asarray(self._tree.query(points)[0])

    def _rim_text(self, unit: float, kernel: Any) -> str:
        """Return the same as text for gmsh: the distance from points along that edge."""
        return f"F{distance_field(unit * self.edge, kernel)}"
