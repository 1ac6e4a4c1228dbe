"""The size field round a footprint on a curved surface: distances are those in space from its true edge."""

from dataclasses import dataclass
from functools import cached_property
from math import inf
from typing import Any

import gmsh
import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import FloatArray
from pipeline.mesh.regions import InclusionSizes
from pipeline.mesh.size import Sizes
from pipeline.shapes.frame import Frame

# A body is a few elements thick wherever it is round: they are a half of the radius at most.
PER_RADIUS = 2


@dataclass(frozen=True, eq=False)
class Field:
    """``sizes`` round a ``frame``, and those that ``inclusions`` ask for.

    ``edge`` (n, 3), in m, are points close to each other along the footprint's edge.
    """

    sizes: Sizes
    frame: Frame
    edge: FloatArray
    inclusions: tuple[InclusionSizes, ...] = ()

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.edge)

    @property
    def largest(self) -> float:
        """The size (m) that no element exceeds by design, infinite if there is none."""
        far = self.sizes.column / PER_RADIUS
        return min(far, self.sizes.fine if self.sizes.epsilon == inf else self.sizes.coarse)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3) of the surface."""
        sizes = self.sizes
        distance, _ = self._tree.query(points)
        size = np.minimum(sizes.rim + sizes.growth * distance, self.largest)
        if sizes.epsilon < inf:
            beyond = np.linalg.norm(points - np.array(self.frame.point), axis=1) - sizes.epsilon
            size = np.minimum(size, sizes.fine + sizes.growth * np.maximum(beyond, 0.0))
        for inclusion in self.inclusions:
            size = np.minimum(size, inclusion.at(points))
        return size

    def terms(self, distance: str, scale: float) -> list[str]:
        """Write what the size is the least of, in units of ``scale`` m, from text of the distance to the edge."""
        sizes = self.sizes
        terms = [f"{sizes.rim / scale:.12g}+{sizes.growth:.12g}*{distance}"]
        if self.largest < inf:
            terms.append(f"{self.largest / scale:.12g}")
        if sizes.epsilon < inf:
            squares = "+".join(f"({n}-({c / scale:.12g}))^2" for n, c in zip("xyz", self.frame.point, strict=True))
            outside = f"Max(Sqrt({squares})-{sizes.epsilon / scale:.12g},0)"
            terms.append(f"{sizes.fine / scale:.12g}+{sizes.growth:.12g}*{outside}")
        for inclusion in self.inclusions:
            terms += inclusion.terms(1 / scale)
        return terms


def set_field(field: Field, scale: float, kernel: Any) -> None:
    """Make ``field`` the background field of gmsh's current model, whose unit is ``scale`` metres.

    Distances are those from points along the footprint's edge, which are added to the model with its ``kernel``.
    """
    model = gmsh.model
    points = [kernel.addPoint(*p) for p in (field.edge / scale).tolist()]
    kernel.synchronize()
    distance = model.mesh.field.add("Distance")
    model.mesh.field.setNumbers(distance, "NodesList", points)
    tags = []
    for term in field.terms(f"F{distance}", scale):
        tags.append(model.mesh.field.add("MathEval"))
        model.mesh.field.setString(tags[-1], "F", term)
    smallest = model.mesh.field.add("Min")
    model.mesh.field.setNumbers(smallest, "FieldsList", tags)
    model.mesh.field.setAsBackgroundMesh(smallest)
