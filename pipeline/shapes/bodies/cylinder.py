"""An upright cylinder."""

from math import hypot, pi
from typing import Annotated, Any, Literal

from pipeline.shapes.arrays import FloatArray, np
from pipeline.shapes.body import Layered
from pipeline.shapes.frame import Frame, PlaceError, Units, Vector
from pipeline.shapes.half_plane import Rectangle
from pipeline.shapes.section import Words, in_mm
from pipeline.shapes.surface import Plane, Surface, Tube
from pipeline.units import Length

# Edges of each circle in pictures.
_ROUND = 200


class Cylinder(Layered):
    """A cylinder about the z axis with its top face in z = 0."""

    shape: Literal["cylinder"]
    radius: Annotated[Length, Words("Radius; the axis is z, and the top face in z = 0.", '"30 mm"')]
    height: Annotated[Length, Words("Height: the thickness of the tissue.", '"20 mm"')]

    @property
    def extent(self) -> float:
        """Twice the larger of radius and height (m)."""
        return 2 * max(self.radius, self.height)

    @property
    def heights(self) -> tuple[float, float]:
        """Heights (m) of the bottom and of the top."""
        return -self.height, 0.0

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        return pi * self.radius**2 * self.height

    def frame(self, at: tuple[float, ...], axis: Vector | None = None) -> Frame:
        """Return the place at x and y on the top."""
        if len(at) != 2 or axis is not None:
            raise PlaceError("give two coordinates: the top is what a probe touches, upright")
        return Frame((at[0], at[1], 0.0))

    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points themselves: the top is flat."""
        flat = np.column_stack([points, np.zeros(len(points))])
        return frame.world(flat), np.tile(np.array(frame.outward), (len(points), 1))

    def thickness(self, frame: Frame) -> float:
        """Return the height (m)."""
        return self.height

    def reach(self, frame: Frame) -> float:
        """Return the distance (m) of the far side from the axis."""
        return self.radius + hypot(frame.point[0], frame.point[1])

    def farthest(self, frame: Frame) -> float:
        """Return the distance (m) of the farthest point of the bottom's edge."""
        return float((self.reach(frame) ** 2 + self.height**2) ** 0.5)

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points inside to the nearest face, negative outside."""
        x, y, z = points.T
        return np.minimum.reduce([self.radius - np.hypot(x, y), -z, z + self.height])

    def gap(self, point: Vector) -> float:
        """Return the distance (m) to the edge of the top, negative outside."""
        return self.radius - hypot(point[0], point[1])

    @property
    def face(self) -> str:
        """Radius of the top."""
        return f"radius {in_mm(self.radius)}"

    def mirror_planes(self) -> tuple[str, ...]:
        """Return both planes."""
        return "x", "y"

    def half_plane(self) -> Rectangle | None:
        """Return radius, height and layers; inclusions have none."""
        return None if self.inclusion else Rectangle(self.radius, self.height, self.interfaces, self.is_filled)

    def draw(self, kernel: Any, units: Units) -> int:
        """Add the cylinder."""
        height = units(self.height)
        return int(kernel.addCylinder(0, 0, -height, 0, 0, height, units(self.radius)))

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
