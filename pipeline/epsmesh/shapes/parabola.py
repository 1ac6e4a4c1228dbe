"""Section of a paraboloid: its profile, and its contour with the shaft above it."""

from dataclasses import dataclass
from math import atan, inf, sqrt, tan

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.contour import Contour, ToContour
from epsmesh.shapes.rounded import Rounded

# Newton's steps to the nearest point of a parabola: the last ones double the digits.
_STEPS = 60


@dataclass(frozen=True)
class Parabola(Rounded):
    """The parabola r²/2R with the radius of curvature R = ``tip`` (m) at its apex, up to a slope of ``angle`` (rad).

    There, at the distance ``tangent`` from the axis, a straight flank begins.
    """

    @staticmethod
    def up_to(limit: float, radius: float) -> "Parabola":
        """Return the parabola of a ``radius`` (m) of curvature up to the distance ``limit`` (m) from the axis."""
        return Parabola(atan(radius / limit), radius)

    @property
    def tangent(self) -> float:
        """Distance (m) from the axis at which the parabola ends."""
        return self.tip / tan(self.angle)

    def height(self, distance: FloatArray) -> FloatArray:
        """Return heights (n,), in m, at distances (n,) from the axis, in m."""
        on = np.minimum(distance, self.tangent)
        height: FloatArray = on**2 / (2 * self.tip) + (distance - on) / tan(self.angle)
        return height

    def slope(self, distance: FloatArray) -> FloatArray:
        """Return the slopes (n,) at distances (n,) from the axis (m)."""
        slope: FloatArray = np.minimum(distance, self.tangent) / self.tip
        return slope

    def reach(self, depth: float) -> float:
        """Return the distance (m) from the axis at which it is ``depth`` (m) above its apex."""
        end = self.tangent**2 / (2 * self.tip)
        return sqrt(2 * self.tip * depth) if depth < end else self.tangent + (depth - end) * tan(self.angle)


@dataclass(frozen=True)
class ParabolicContour(Contour):
    """A parabola up to the distance ``limit`` (m) from the axis, and the shaft above it."""

    def distance(self, beside: FloatArray, height: FloatArray) -> ToContour:
        """Return the distance of points at distances ``beside`` (n,) from the axis and at heights (n,), in m.

        It is the largest of those to all lines that touch the parabola, the corner where it ends, and the shaft.
        """
        radius, corner = self.section.tip, self._corner
        foot = np.minimum(_nearest(beside / radius, height / radius), corner[0] / radius)
        steep = np.sqrt(1 + foot**2)
        normal = np.column_stack([foot, -np.ones_like(foot)]) / steep[:, None]
        from_foot = np.column_stack([beside - radius * foot, height - radius * foot**2 / 2])
        gap, bend = np.sum(from_foot * normal, axis=1), 1 / (radius * steep**3)
        at_end = radius * foot >= corner[0]
        from_corner = np.column_stack([beside, height]) - corner
        length = np.linalg.norm(from_corner, axis=1)
        # Between the normals of the parabola's end and of the shaft, the corner is the nearest point.
        is_around = at_end & (from_corner[:, 1] < 0) & (from_corner @ np.array([1.0, corner[0] / radius]) > 0)
        gaps = [gap, from_corner[:, 0], np.where(is_around, length, -inf)]
        normals = [normal, np.tile([1.0, 0.0], (len(beside), 1)), from_corner / np.maximum(length, 1e-300)[:, None]]
        largest, at = np.argmax(gaps, axis=0), np.arange(len(beside))
        curvature = np.where((largest == 0) & ~at_end, bend / np.maximum(1 + bend * gap, 0.5), 0.0)
        return ToContour(np.array(gaps)[largest, at], np.stack(normals)[largest, at], curvature)

    def curvature_at_axis(self, height: FloatArray) -> FloatArray:
        """Return the curvature (n,), in 1/m, at heights (n,), in m, on the axis; zero above its centre."""
        radius = self.section.tip
        return np.where(height < radius, 1 / np.maximum(radius - height, radius / 2), 0.0)


def _nearest(beside: FloatArray, height: FloatArray) -> FloatArray:
    """Return the distance (n,) from the axis of the nearest point of x²/2: the largest root of x³/2 + (1 - h) x = r.

    Newton's method falls to it from above.
    """
    linear = 1 - height
    x = np.cbrt(2 * beside) + np.sqrt(np.maximum(-2 * linear, 0.0))
    for _ in range(_STEPS):
        slope = 1.5 * x**2 + linear
        x = x - np.where(slope > 0, (x**3 / 2 + linear * x - beside) / np.where(slope > 0, slope, 1.0), 0.0)
    return np.maximum(x, 0.0)
