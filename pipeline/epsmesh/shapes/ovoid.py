"""The surface of an ellipsoid with its axes along the coordinates."""

from dataclasses import dataclass
from math import pi, prod
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.closed import Closed, FarSizes
from epsmesh.shapes.frame import Vector

# Newton's method from the left converges monotonically; points near the centre of flat ellipsoids need most steps.
_STEPS = 200
_SMALL, _NUDGE, _NEAR = 1e-15, 1e-12, 1e-3
_GOLDEN = pi * (3 - 5**0.5)


@dataclass(frozen=True)
class Ovoid(Closed):
    """The ellipsoid about ``centre`` with semi-``axes`` (m) along x, y and z."""

    LEAST: ClassVar[str] = "its smallest semi-axis"

    centre: Vector
    axes: Vector

    @property
    def least(self) -> float:
        """Its smallest semi-axis (m)."""
        return min(self.axes)

    @property
    def volume(self) -> float:
        """Enclosed volume (m³)."""
        return 4 / 3 * pi * prod(self.axes)

    @property
    def area(self) -> float:
        """Area (m²), within 1 % (K. Thomsen's formula)."""
        a, b, c = (axis**1.6 for axis in self.axes)
        return float(4 * pi * ((a * b + a * c + b * c) / 3) ** (1 / 1.6))

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """Lowest and highest coordinates (m)."""
        (x, y, z), (a, b, c) = self.centre, self.axes
        return (x - a, y - b, z - c), (x + a, y + b, z + c)

    @property
    def identity(self) -> str:
        """Its centre and semi-axes."""
        return repr((self.centre, self.axes))

    def sizes(self, far: FarSizes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return its centre (m), the size (m) of elements by its smallest semi-axis, and its area (m²)."""
        away = np.abs(self.distance(np.array([far.contact])))
        return np.array([self.centre]), far.size_on(np.array([self.least]), away), np.array([self.area])

    def has_axis(self, within: float) -> bool:
        """Return whether it is centred on the z axis, within ``within`` (m), and round about it."""
        return max(map(abs, self.centre[:2])) <= within and self.axes[0] == self.axes[1]

    def is_mirrored(self, axis: int) -> bool:
        """Return whether its centre is in the plane."""
        return self.centre[axis] == 0.0

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point, positive outside."""
        outside = self.level(points) > 1
        return np.where(outside, 1, -1) * np.linalg.norm(points - self.project(points), axis=1)

    def level(self, points: FloatArray) -> FloatArray:
        """Return the factor by which the ellipsoid must be scaled about its centre to reach each point."""
        return np.linalg.norm((points - np.array(self.centre)) / np.array(self.axes), axis=1)

    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the surface: y = a² x / (a² + t), with t such that y is on it.

        The sum of (a x / (a² + t))² decreases from t = -min a² on and is convex. Newton's method, begun where the
        largest single term is 1, therefore converges to the root from one side.
        """
        axes = np.array(self.axes) / max(self.axes)
        x = (points - np.array(self.centre)) / max(self.axes)
        # Deep inside, on a plane of symmetry, the nearest point is off that plane: a small shift selects a side.
        nudged = np.where(np.abs(x) < _NUDGE, _NUDGE, x)
        t = (axes * np.abs(nudged) - axes**2).max(axis=1)
        for _ in range(_STEPS):
            reach = axes**2 + t[:, None]
            squares = (axes * nudged / reach) ** 2
            step = (squares.sum(axis=1) - 1) / (2 * (squares / reach).sum(axis=1))
            t = t + step
            if np.all(np.abs(step) <= _SMALL * (1 + np.abs(t))):
                break
        reach = axes**2 + t[:, None]
        stays = (x == 0) & (reach > _NEAR * axes**2)
        return np.array(self.centre) + max(self.axes) * np.where(stays, 0.0, axes**2 * nudged / reach)

    def sample(self, count: int) -> FloatArray:
        """Return the six ends of its axes, and ``count`` points spread evenly over it, shape (count + 6, 3)."""
        number = np.arange(count) + 0.5
        height, angle = 1 - 2 * number / count, _GOLDEN * number
        ring = np.sqrt(1 - height**2)
        spread = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), height])
        return np.array(self.centre) + np.array(self.axes) * np.vstack([np.eye(3), -np.eye(3), spread])
