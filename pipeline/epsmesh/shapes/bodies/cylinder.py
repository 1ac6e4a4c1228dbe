"""An upright cylinder."""

from math import atan2, hypot, pi, sqrt
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Layered
from epsmesh.shapes.convex import ball, slab
from epsmesh.shapes.frame import Frame, PlaceError, Units, Vector
from epsmesh.shapes.half_plane import Rectangle
from epsmesh.shapes.section import Words, in_mm
from epsmesh.shapes.surface import Plane, Surface, Tube
from epsmesh.units import Length, canonical

# Segments of each circle in pictures.
_ROUND = 200
# Rounding of coordinates, in units of the body's extent.
_ROUNDING = 1e-12


class Cylinder(Layered):
    """A cylinder about the z axis with its top face in z = 0."""

    is_smooth: ClassVar[bool] = False
    has_round_top: ClassVar[bool] = True

    shape: Literal["cylinder"]
    radius: Annotated[Length, Words("Radius of the cylinder. Its axis is z, and its top face is at z = 0.", '"30 mm"')]
    height: Annotated[Length, Words("Height of the cylinder: the thickness of the tissue.", '"20 mm"')]

    @property
    def extent(self) -> float:
        """Twice the larger of radius and height (m)."""
        return 2 * max(self.radius, self.height)

    @property
    def heights(self) -> tuple[float, float]:
        """Heights z (m) of bottom and top."""
        return -self.height, 0.0

    def without_top(self, depth: float) -> dict[str, Any]:
        """Return a smaller height."""
        return {"height": canonical(self.height - depth)}

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        return pi * self.radius**2 * self.height

    def frame(self, at: tuple[float, ...], axis: Vector | None = None) -> Frame:
        """Return the frame at x and y on the top, or at the surface point nearest to three coordinates (m).

        Raises:
            PlaceError: if the axis is inclined too far, or no point is nearest because `at` is on the axis.
        """
        if len(at) == 2:
            return Frame.touching((at[0], at[1], 0.0), (0.0, 0.0, -1.0), axis)
        (x, y), r = at[:2], hypot(at[0], at[1])
        z = max(-self.height, min(0.0, at[2]))
        if r > self.radius:
            x, y, r = x * self.radius / r, y * self.radius / r, self.radius
        if self._is_side((x, y, z)):
            if r == 0:
                raise PlaceError("is on the cylinder's axis, where no side is nearest: move it off the axis")
            return Frame.touching((x * self.radius / r, y * self.radius / r, z), (-x / r, -y / r, 0.0), axis)
        if z > -self.height / 2:
            return Frame.touching((x, y, 0.0), (0.0, 0.0, -1.0), axis)
        return Frame.touching((x, y, -self.height), (0.0, 0.0, 1.0), axis)

    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along the axis enter top, bottom or side, and the normals there."""
        origins, axis = frame.in_plane(points), np.array(frame.axis)
        end_in, end_out = slab(origins, frame.axis, (0.0, 0.0, 1.0), -self.height, 0.0)
        if np.hypot(axis[0], axis[1]) > 0:
            side_in, side_out = ball(origins[:, :2] / self.radius, axis[:2] / self.radius)
        else:
            inside = np.linalg.norm(origins[:, :2], axis=1) <= self.radius
            side_in, side_out = np.where(inside, -np.inf, np.nan), np.where(inside, np.inf, np.nan)
        distance = np.maximum(end_in, side_in)
        hit = distance <= np.minimum(end_out, side_out) + _ROUNDING * self.extent
        found = origins + np.where(hit, distance, np.nan)[:, None] * axis
        radial = np.column_stack([found[:, :2] / self.radius, np.zeros(len(found))])
        upward = np.array([0.0, 0.0, -float(np.sign(axis[2]))])
        return found, np.where((side_in > end_in)[:, None], radial, upward)

    def thickness(self, frame: Frame) -> float:
        """Return the extent (m) along the axis: the height, or the depth of the farthest point of a rim."""
        if frame.is_upright and frame.point[2] == 0:
            return self.height
        (x, y, z), (a, b, c) = frame.point, frame.axis
        return self.radius * hypot(a, b) + self.height * (abs(c) - c) / 2 - (a * x + b * y + c * z)

    def far_side(self, x: float, y: float) -> float:
        """Return the distance (m) of the far side."""
        return self.radius + hypot(x, y)

    def reach_below(self, directions: FloatArray) -> float:
        """Return the radius."""
        return self.radius

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points to the nearest face, negative outside."""
        x, y, z = points.T
        return np.minimum.reduce([self.radius - np.hypot(x, y), -z, z + self.height])

    def gap(self, point: Vector) -> float:
        """Return the distance (m) of a point of a face to the edge of this face, negative outside."""
        if self._is_side(point):
            return min(-point[2], point[2] + self.height)
        return self.radius - hypot(point[0], point[1])

    def to_side(self, point: tuple[float, float], direction: tuple[float, float]) -> float:
        """Return the distance (m) to the circle."""
        (x, y), (a, b) = point, direction
        inward = a * x + b * y
        return sqrt(inward**2 + self.radius**2 - x**2 - y**2) - inward

    @property
    def corners(self) -> FloatArray:
        """Points (n, 3) in m on circles just outside the edges of top and bottom: their hull contains the body."""
        angle = np.linspace(0.0, 2 * pi, _ROUND + 1)[1:]
        radius = self.radius / np.cos(pi / _ROUND)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        return np.vstack([np.column_stack([x, y, np.full(len(angle), z)]) for z in (0.0, -self.height)])

    def _is_side(self, point: Vector) -> bool:
        """Return whether the side is nearer than top and bottom."""
        to_side = abs(self.radius - hypot(point[0], point[1]))
        return to_side < min(abs(point[2]), abs(point[2] + self.height))

    @property
    def face(self) -> str:
        """Radius of the top."""
        return f"radius {in_mm(self.radius)}"

    @property
    def half_sides(self) -> tuple[float, float]:
        """The radius (m), twice."""
        return self.radius, self.radius

    def half_plane(self) -> Rectangle | None:
        """Return radius, height and layers; None with inclusions or regions."""
        return None if self.embedded else Rectangle(self.radius, self.height, self.interfaces, self.is_filled)

    def draw(self, kernel: Any, units: Units, frame: Frame | None = None) -> int:
        """Add the cylinder, with the seam of its side away from the frame."""
        height = units(self.height)
        tag = int(kernel.addCylinder(0, 0, -height, 0, 0, height, units(self.radius)))
        if frame is not None and self._is_side(frame.point):
            x, y, _ = frame.point
            kernel.rotate([(3, tag)], 0, 0, 0, 0, 0, 1, atan2(-y, -x))
        return tag

    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return top, bottom and side."""
        return {
            "top": (Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),),
            "bottom": (Plane((0.0, 0.0, -self.height), (0.0, 0.0, -1.0)),),
            "sides": (Tube((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), self.radius),),
        }

    @property
    def bend(self) -> float:
        """Radius of the side (m)."""
        return self.radius

    def outline(self) -> list[FloatArray]:
        """Return the circles round top and bottom."""
        angle = np.linspace(0.0, 2 * pi, _ROUND + 1)
        x, y = self.radius * np.cos(angle), self.radius * np.sin(angle)
        return [np.column_stack([x, y, np.full(len(angle), z)]) for z in (0.0, -self.height)]
