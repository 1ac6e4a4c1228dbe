"""A half-space under a force along its face (V. Cerruti, 1882; K. L. Johnson, Contact Mechanics, 3.6)."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.far_field import PointForce


@dataclass(frozen=True)
class SideForce(PointForce):
    """A half-space under a point force along x, or y (``direction`` 0 or 1), in the units of ``PointForce``."""

    direction: int = 0

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) by a unit force, in m."""
        x, y, depth, r = self._along(points)
        softness, sunk = 1 - 2 * self.poisson, r + depth
        found = np.zeros((len(points), 3))
        along, across = self.direction, 1 - self.direction
        found[:, along] = 1 / r + x**2 / r**3 + softness * (1 / sunk - x**2 / (r * sunk**2))
        found[:, across] = x * y / r**3 - softness * x * y / (r * sunk**2)
        found[:, 2] = -(x * depth / r**3 + softness * x / (r * sunk))
        return self.radius * found

    def stress(self, points: FloatArray) -> FloatArray:
        """Return the stress (n, 3, 3) by a unit force, in units of μ; 0 at the force itself."""
        offsets = points - np.array(self.centre)
        away = np.linalg.norm(offsets, axis=1) > 1e-9 * self.radius
        x, y, depth, r = self._along(points[away])
        softness, sunk = 1 - 2 * self.poisson, r + depth
        first, second = 1 / (r * sunk**2), 1 / (r**3 * sunk**2) + 2 / (r**2 * sunk**3)
        xx = -3 * x**3 / r**5 + softness * (x / r**3 - 3 * x * first + x**3 * second)
        yy = -3 * x * y**2 / r**5 + softness * (x / r**3 - x * first + x * y**2 * second)
        xy = -3 * x**2 * y / r**5 + softness * (-y * first + x**2 * y * second)
        zz, xz, yz = -3 * x * depth**2 / r**5, 3 * x**2 * depth / r**5, 3 * x * y * depth / r**5
        a, b = self.direction, 1 - self.direction
        found = np.zeros((len(points), 3, 3))
        for (i, j), values in {(a, a): xx, (b, b): yy, (a, b): xy, (2, 2): zz, (a, 2): xz, (b, 2): yz}.items():
            found[away, i, j] = found[away, j, i] = values
        return 2 * self.radius * found

    def _along(self, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return coordinates (m) along the force and across it, the depth, and the distance."""
        offsets = points - np.array(self.centre)
        along, across = offsets[:, self.direction], offsets[:, 1 - self.direction]
        return along, across, -offsets[:, 2], np.linalg.norm(offsets, axis=1)
