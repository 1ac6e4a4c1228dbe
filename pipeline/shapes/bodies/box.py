"""A box."""

from itertools import pairwise
from math import hypot, inf
from typing import Annotated, Any, Literal

from pipeline.shapes.arrays import FloatArray, np
from pipeline.shapes.body import Layered
from pipeline.shapes.frame import Frame, PlaceError, Units, Vector
from pipeline.shapes.section import Words, in_mm
from pipeline.shapes.surface import Plane, Surface
from pipeline.units import Length


class Box(Layered):
    """A box with its top face centred on the origin, tissue at z <= 0."""

    shape: Literal["box"]
    size: Annotated[
        tuple[Length, Length, Length],
        Words(
            "Extent along x, y and z; the top face is centred on the origin.",
            '["40 mm", "40 mm", "20 mm"]',
            is_used=True,
        ),
    ]

    @property
    def extent(self) -> float:
        """Longest edge (m)."""
        return max(self.size)

    @property
    def heights(self) -> tuple[float, float]:
        """Heights (m) of the bottom and of the top."""
        return -self.size[2], 0.0

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        return self.size[0] * self.size[1] * self.size[2]

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
        return self.size[2]

    def reach(self, frame: Frame) -> float:
        """Return the distance (m) of the farthest vertical edge from the axis."""
        x, y, _ = frame.point
        return hypot(self.size[0] / 2 + abs(x), self.size[1] / 2 + abs(y))

    def farthest(self, frame: Frame) -> float:
        """Return the distance (m) of the farthest corner."""
        return float((self.reach(frame) ** 2 + self.size[2] ** 2) ** 0.5)

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points inside to the nearest face, negative outside."""
        x, y, z = points.T
        return np.minimum.reduce(
            [self.size[0] / 2 - np.abs(x), self.size[1] / 2 - np.abs(y), -z, z + self.size[2]]
        )  # fmt: skip

    def gap(self, point: Vector) -> float:
        """Return the distance (m) to the edge of the top, negative outside."""
        return min(self.size[0] / 2 - abs(point[0]), self.size[1] / 2 - abs(point[1]))

    @property
    def face(self) -> str:
        """Length and width of the top."""
        return f"{in_mm(self.size[0])} × {in_mm(self.size[1])}"

    def mirror_planes(self) -> tuple[str, ...]:
        """Return both planes."""
        return "x", "y"

    def half_plane(self) -> None:
        """Return none: it has corners."""

    def draw(self, kernel: Any, units: Units) -> int:
        """Add the box."""
        a, b, c = map(units, self.size)
        return int(kernel.addBox(-a / 2, -b / 2, -c, a, b, c))

    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return top, bottom and four sides."""
        x, y, z = self.size
        sides = (
            Plane((-x / 2, 0.0, 0.0), (-1.0, 0.0, 0.0)),
            Plane((x / 2, 0.0, 0.0), (1.0, 0.0, 0.0)),
            Plane((0.0, -y / 2, 0.0), (0.0, -1.0, 0.0)),
            Plane((0.0, y / 2, 0.0), (0.0, 1.0, 0.0)),
        )
        bottom = Plane((0.0, 0.0, -z), (0.0, 0.0, -1.0))
        return {"top": (Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),), "bottom": (bottom,), "sides": sides}

    @property
    def bend(self) -> float:
        """Infinite: all is flat."""
        return inf

    def outline(self) -> list[FloatArray]:
        """Return the twelve edges."""
        x, y, z = self.size
        ring = [(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2), (-x / 2, -y / 2)]
        rings = [np.array([(*start, height), (*end, height)]) for height in (0.0, -z) for start, end in pairwise(ring)]
        return [*rings, *(np.array([(*corner, 0.0), (*corner, -z)]) for corner in ring[:4])]
