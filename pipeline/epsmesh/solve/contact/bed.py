"""Contacts besides the tool's: a support off which a body may lift, an opposite jaw, or tissue below a loose layer.

A contact is a constraint between nodes of a surface and a distance. All contacts of a body are found together, in one
loop: the tool's nodes have the tool's distance, those above a bed have the bed's.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance


@dataclass(frozen=True)
class Bed:
    """A rigid surface by its ``distance`` from points (n, 3), m, where the tool is at a depth (m) from its first touch.

    The body at rest touches it. On it tissue has Coulomb's coefficient ``friction``; a support of infinite friction
    holds what touches it from the beginning. ``normal`` is the unit vector from the bed into the body, in the mean.

    A jaw advances along its normal by ``pace`` times the tool's depth. ``height`` are its heights (m) at rest above
    points (n, 3) of the undeformed surface, along its axis; ``ends_at`` is a mask of points (n, 3) on the edge of its
    candidates: true where it ends itself. Both are None for a support. ``foot`` (m) is on a jaw's axis.
    ``is_tissue``: it is the tissue below a loose layer, whose displacements are those relative to it.
    """

    distance: Callable[[FloatArray, float], Distance]
    normal: tuple[float, float, float]
    friction: float = 0.0
    pace: float = 0.0
    height: Callable[[FloatArray], FloatArray] | None = None
    ends_at: Callable[[FloatArray], BoolArray] | None = None
    foot: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_tissue: bool = False

    @property
    def is_support(self) -> bool:
        """Whether the body rests on it before the tool comes."""
        return self.height is None

    @property
    def sticks(self) -> bool:
        """Whether it is a support that holds what touches it."""
        return self.is_support and self.friction == inf

    @property
    def advance(self) -> FloatArray:
        """How far (3), m, it goes where the tool goes 1 m."""
        return self.pace * np.array(self.normal)

    def at_rest(self, places: FloatArray) -> "Bed":
        """Return the bed of linear elasticity: gaps are those above ``places`` (n, 3) at rest, along normals there.

        Those of a jaw are along its axis.
        """
        if self.height is not None:
            heights, outward = self.height(places), -np.array(self.normal)
            return replace(
                self,
                distance=lambda points, depth: Distance.along(outward, heights - self.pace * depth, points - places),
            )
        found = self.distance(places, 0.0)
        flat = np.zeros_like(found.curvature)

        def distance(points: FloatArray, _: float) -> Distance:
            moved = np.einsum("ni,ni->n", points - places, found.normal)
            return Distance(found.gap + moved, found.normal, flat)

        return replace(self, distance=distance)

    def moved(self, by: FloatArray) -> "Bed":
        """Return the jaw elsewhere, ``by`` (3), m."""
        height, ends_at = self.height, self.ends_at
        assert height is not None and ends_at is not None
        x, y, z = map(float, np.array(self.foot) + by)
        return replace(
            self,
            distance=lambda points, depth: self.distance(points - by, depth),
            height=lambda points: height(points - by),
            ends_at=lambda points: ends_at(points - by),
            foot=(x, y, z),
        )

    def advanced(self, change: float) -> "Bed":
        """Return the bed where the tool is farther by ``change`` (m)."""
        height = self.height
        return replace(
            self,
            distance=lambda points, depth: self.distance(points, depth + change),
            height=None if height is None else lambda points: height(points) - self.pace * change,
        )


def plane(point: FloatArray, normal: FloatArray) -> Callable[[FloatArray, float], Distance]:
    """Return the distance to a half-space that ends at a ``point`` (3), m, with the outward unit ``normal`` (3)."""

    def distance(points: FloatArray, _: float) -> Distance:
        flat = np.zeros((*points.shape, points.shape[1]))
        return Distance((points - point) @ normal, np.tile(normal, (len(points), 1)), flat)

    return distance


@dataclass(frozen=True, eq=False)
class Resting:
    """The ``nodes`` (n) above beds, among all that may be touched; those that touch at the start of a path, ``begin``.

    In a loop without friction, those that ``stick`` (n) are held at ``anchors`` (n, 3), m, where they touch. ``jaws``
    are masks (n) of those of each second jaw; ``floats`` says that nothing holds the body but the tool and these.
    """

    nodes: BoolArray
    begin: BoolArray
    stick: BoolArray
    anchors: FloatArray
    jaws: tuple[BoolArray, ...] = ()
    floats: bool = False
