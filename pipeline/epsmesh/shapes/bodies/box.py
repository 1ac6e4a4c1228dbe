"""A box."""

from itertools import pairwise, product
from math import copysign, hypot, inf
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Layered
from epsmesh.shapes.convex import slab
from epsmesh.shapes.frame import Frame, Units, Vector
from epsmesh.shapes.section import Words, in_mm
from epsmesh.shapes.surface import Plane, Surface
from epsmesh.units import Length, canonical

# Rounding of coordinates, in units of the body's extent.
_ROUNDING = 1e-12


class Box(Layered):
    """A box with its top face centred on the origin, tissue at z <= 0."""

    is_smooth: ClassVar[bool] = False
    has_round_top: ClassVar[bool] = False
    # Infinite: all faces are flat.
    bend: ClassVar[float] = inf

    shape: Literal["box"]
    size: Annotated[
        tuple[Length, Length, Length],
        Words(
            "Size along x, y and z. The top face is centred on the origin.",
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
        """Heights z (m) of bottom and top."""
        return -self.size[2], 0.0

    def without_top(self, depth: float) -> dict[str, Any]:
        """Return a smaller size along z."""
        return {"size": (*self.size[:2], canonical(self.size[2] - depth))}

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        return self.size[0] * self.size[1] * self.size[2]

    def frame(self, at: tuple[float, ...], axis: Vector | None = None) -> Frame:
        """Return the frame at x and y on the top, or at the surface point nearest to three coordinates (m).

        Raises:
            PlaceError: if the axis is inclined too far.
        """
        if len(at) == 2:
            return Frame.touching((at[0], at[1], 0.0), (0.0, 0.0, -1.0), axis)
        x, y, z = (max(low, min(high, c)) for c, (low, high) in zip(at, self._sides, strict=True))
        number, is_high = self._nearest_face((x, y, z))
        point, normal = [x, y, z], [0.0, 0.0, 0.0]
        point[number] = self._sides[number][is_high]
        normal[number] = -1.0 if is_high else 1.0
        return Frame.touching((point[0], point[1], point[2]), (normal[0], normal[1], normal[2]), axis)

    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along the axis enter the body, and the normals there: see :meth:`Body.lift`."""
        origins = frame.in_plane(points)
        units = np.eye(3)
        spans = [slab(origins, frame.axis, tuple(unit), *sides) for unit, sides in zip(units, self._sides, strict=True)]
        enter, leave = (np.array(ends) for ends in zip(*spans, strict=True))
        first = enter.argmax(axis=0)
        distance = enter.max(axis=0)
        # A line through an edge must not miss the body by rounding.
        hit = distance <= leave.min(axis=0) + _ROUNDING * self.extent
        found = origins + np.where(hit, distance, np.nan)[:, None] * np.array(frame.axis)
        return found, -np.sign(np.array(frame.axis))[first][:, None] * units[first]

    def thickness(self, frame: Frame) -> float:
        """Return the extent (m) along the axis: the height, or the depth of the farthest corner."""
        if frame.is_upright and frame.point[2] == 0:
            return self.size[2]
        return float(-frame.local(self.corners)[:, 2].min())

    def far_side(self, x: float, y: float) -> float:
        """Return the distance (m) of the farthest vertical edge."""
        return hypot(self.size[0] / 2 + abs(x), self.size[1] / 2 + abs(y))

    def reach_below(self, directions: FloatArray) -> float:
        """Return the distance (m) of a corner."""
        return float(np.linalg.norm(self.corners @ directions.T, axis=1).max())

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points to the nearest face, negative outside."""
        x, y, z = points.T
        return np.minimum.reduce([self.size[0] / 2 - np.abs(x), self.size[1] / 2 - np.abs(y), -z, z + self.size[2]])

    def gap(self, point: Vector) -> float:
        """Return the distance (m) of a point of a face to the edge of this face, negative outside."""
        number, is_high = self._nearest_face(point)
        if number == 2 and is_high:
            return min(self.size[0] / 2 - abs(point[0]), self.size[1] / 2 - abs(point[1]))
        beside = [(c, sides) for n, (c, sides) in enumerate(zip(point, self._sides, strict=True)) if n != number]
        return min(min(c - low, high - c) for c, (low, high) in beside)

    def to_side(self, point: tuple[float, float], direction: tuple[float, float]) -> float:
        """Return the distance (m) to the nearest of the four sides in a direction."""
        sizes = zip(point, direction, self.size, strict=False)
        return min((copysign(size / 2, d) - p) / d for p, d, size in sizes if d != 0)

    @property
    def _sides(self) -> tuple[tuple[float, float], ...]:
        x, y, z = self.size
        return (-x / 2, x / 2), (-y / 2, y / 2), (-z, 0.0)

    @property
    def corners(self) -> FloatArray:
        """The eight corners (m)."""
        return np.array(list(product(*self._sides)))

    def _nearest_face(self, point: Vector) -> tuple[int, int]:
        """Return the face with the nearest plane: its axis, and 1 for the upper one; the top comes first."""
        faces = [(2, 1), (2, 0), (0, 0), (0, 1), (1, 0), (1, 1)]
        return min(faces, key=lambda face: abs(point[face[0]] - self._sides[face[0]][face[1]]))

    @property
    def face(self) -> str:
        """Length and width of the top."""
        return f"{in_mm(self.size[0])} × {in_mm(self.size[1])}"

    @property
    def half_sides(self) -> tuple[float, float]:
        """Half the extents along x and y (m)."""
        return self.size[0] / 2, self.size[1] / 2

    def draw(self, kernel: Any, units: Units, frame: Frame | None = None) -> int:
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

    def outline(self) -> list[FloatArray]:
        """Return the twelve edges."""
        x, y, z = self.size
        ring = [(-x / 2, -y / 2), (x / 2, -y / 2), (x / 2, y / 2), (-x / 2, y / 2), (-x / 2, -y / 2)]
        rings = [np.array([(*start, height), (*end, height)]) for height in (0.0, -z) for start, end in pairwise(ring)]
        return [*rings, *(np.array([(*corner, 0.0), (*corner, -z)]) for corner in ring[:4])]
