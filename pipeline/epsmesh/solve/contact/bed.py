"""A rigid surface on which a body rests, and off which it may lift: a contact besides the tool's, which does not move.

A contact is a constraint between nodes of a surface and a distance. All contacts of a body are found together, in one
loop: the tool's nodes have the tool's distance, those above a bed have the bed's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance


@dataclass(frozen=True)
class Bed:
    """A rigid surface by its ``distance`` from points (n, 3), m; the body at rest lies on it.

    On it tissue slides without friction, or ``sticks`` where it touches. ``normal`` is the unit vector from the bed
    into the body, in the mean.
    """

    distance: Callable[[FloatArray], Distance]
    normal: tuple[float, float, float]
    sticks: bool = False

    def at_rest(self, places: FloatArray) -> "Bed":
        """Return the bed of linear elasticity: gaps are those above ``places`` (n, 3) at rest, along normals there."""
        found = self.distance(places)
        flat = np.zeros_like(found.curvature)

        def distance(points: FloatArray) -> Distance:
            moved = np.einsum("ni,ni->n", points - places, found.normal)
            return Distance(found.gap + moved, found.normal, flat)

        return replace(self, distance=distance)


def plane(point: FloatArray, normal: FloatArray) -> Callable[[FloatArray], Distance]:
    """Return the distance to a half-space that ends at a ``point`` (3), m, with the outward unit ``normal`` (3)."""

    def distance(points: FloatArray) -> Distance:
        flat = np.zeros((*points.shape, points.shape[1]))
        return Distance((points - point) @ normal, np.tile(normal, (len(points), 1)), flat)

    return distance


@dataclass(frozen=True, eq=False)
class Resting:
    """The ``nodes`` (n) above beds, among all that may be touched; those that touch at the start of a path, ``begin``.

    In a loop without friction, those that ``stick`` (n) are held at ``anchors`` (n, 3), m, where they touch.
    """

    nodes: BoolArray
    begin: BoolArray
    stick: BoolArray
    anchors: FloatArray
