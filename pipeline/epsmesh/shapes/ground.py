"""The rigid surface of a support: a plane, or a cylinder or a ball, of which the body is outside or inside."""

from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.shapes.frame import Vector

# Height (m) above a surface that is not there: beside a ball.
_NOWHERE = 1e3
# Components of unit vectors, and distances from a centre in units of the radius: rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Ground:
    """A surface through a ``point`` (m), where its unit ``normal`` is towards the body.

    It has the ``radius`` (m) in the directions ``across``, unit vectors at right angles to the normal: one of a
    cylinder, two of a ball, none of a plane. The body is outside of the cylinder or ball, or inside if that is
    ``hollow``.
    """

    point: Vector
    normal: Vector
    radius: float = inf
    across: tuple[Vector, ...] = ()
    hollow: bool = False

    @cached_property
    def _axes(self) -> FloatArray:
        """The directions across and the normal, in rows."""
        return np.array([*self.across, self.normal])

    def turned(self, turn: FloatArray) -> "Ground":
        """Return it in other coordinates."""
        point, normal, *across = (_vector(turn @ np.array(each)) for each in (self.point, self.normal, *self.across))
        return Ground(point, normal, self.radius, tuple(across), self.hollow)

    @property
    def is_round(self) -> bool:
        """Whether it is axisymmetric about its normal."""
        return len(self.across) != 1

    def height(self, points: FloatArray) -> FloatArray:
        """Return the heights (n), m, of points (n, 3) above it, along its normal."""
        *aside, up = self._along(points)
        if not aside:
            return up
        square = np.sum(np.square(aside), axis=0)
        fall = square / (self.radius + np.sqrt(np.maximum(self.radius**2 - square, 0.0)))
        return np.where(square < self.radius**2, up - fall if self.hollow else up + fall, _NOWHERE)

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance of points (n, 3), as that of a tool: negative within the support.

        Deeper than half the radius, its curvature is at most twice that of its surface.
        """
        *aside, up = self._along(points)
        if not aside:
            flat = np.zeros((*points.shape, points.shape[1]))
            return Distance(up, np.tile(np.array(self.normal), (len(points), 1)), flat)
        side, radius = (-1.0 if self.hollow else 1.0), self.radius
        from_centre = np.array([*aside, up + side * radius])
        away = np.maximum(np.linalg.norm(from_centre, axis=0), _ROUNDING * radius)
        # Their difference, without that of large numbers.
        gap = side * (np.sum(np.square(aside), axis=0) + up**2 + 2 * side * radius * up) / (away + radius)
        outward = side * (from_centre / away).T @ self._axes
        round_ = self._axes.T @ self._axes - outward[:, :, None] * outward[:, None, :]
        return Distance(gap, outward, side * round_ / np.maximum(away, radius / 2)[:, None, None])

    def _along(self, points: FloatArray) -> FloatArray:
        """Return how far (m) points (n, 3) are from its own one, in the directions across and along the normal."""
        found: FloatArray = self._axes @ (points - np.array(self.point)).T
        return found


def _vector(values: FloatArray) -> Vector:
    x, y, z = map(float, values)
    return x, y, z
