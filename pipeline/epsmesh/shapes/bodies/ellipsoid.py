"""An ellipsoid."""

from math import atan2, hypot, inf, pi, sqrt
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Drawn
from epsmesh.shapes.convex import ball
from epsmesh.shapes.frame import Frame, PlaceError, Units, Vector, unit
from epsmesh.shapes.half_plane import HalfEllipse
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.section import Words, in_mm
from epsmesh.shapes.support import Below
from epsmesh.shapes.surface import Surface
from epsmesh.units import Length

# Segments of each ellipse in pictures and in the search for the reach, and bisections for the farthest point.
_ROUND = 200
_BISECTIONS = 80
# The ellipsoid is a stretched ball: angle (rad) by which the ball's poles are turned about the point of contact. gmsh's
# surface mesher sometimes fails with poles at the ends of the axes, where curvature is largest.
_ASIDE = 0.7


def _below(value: Any) -> Any:
    if isinstance(value, str):
        raise PydanticCustomError(
            "not_supported", 'an ellipsoid has no faces: fix everything below a height, {below = "-15 mm"}'
        )
    return value if isinstance(value, Below) else Below.read(value)


class Ellipsoid(Drawn):
    """An ellipsoid about the origin, its semi-axes along x, y and z."""

    is_smooth: ClassVar[bool] = True

    shape: Literal["ellipsoid"]
    axes: Annotated[
        tuple[Length, Length, Length],
        Words("Semi-axes along x, y and z. The centre is the origin.", '["40 mm", "35 mm", "25 mm"]'),
    ]
    fixed: Annotated[
        Below,
        BeforeValidator(_below),
        Words(
            "Support of the body: all tissue below a height. Displacements are zero there.",
            '{below = "-6 mm"}',
            takes="{below = length}",
        ),
    ]

    @property
    def extent(self) -> float:
        """Longest axis (m)."""
        return 2 * max(self.axes)

    @property
    def heights(self) -> tuple[float, float]:
        """Heights (m) of the lowest and of the highest point."""
        return -self.axes[2], self.axes[2]

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        a, b, c = self.axes
        return 4 / 3 * pi * a * b * c

    def frame(self, at: tuple[float, ...], axis: Vector | None = None) -> Frame:
        """Return the frame above x and y, or at the surface point nearest to three coordinates (m).

        Raises:
            PlaceError: if there is no such point, or the axis is inclined too far.
        """
        a, b, c = self.axes
        if len(at) == 2:
            x, y = at
            if (square := (x / a) ** 2 + (y / b) ** 2) > 1:
                raise PlaceError(f"is outside the body ({self.face}) as seen from above")
            z = c * sqrt(1 - square)
        else:
            if not any(at):
                raise PlaceError("is the ellipsoid's centre, where no side is nearest: move it off the centre")
            x, y, z = map(float, self._surface.project(np.array([at]))[0])
        steepest = unit((x / a**2, y / b**2, z / c**2))
        return Frame.touching((x, y, z), (0.0 - steepest[0], 0.0 - steepest[1], 0.0 - steepest[2]), axis)

    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along the axis enter the ellipsoid, and the normals there."""
        origins = frame.in_plane(points)
        axis, axes = np.array(frame.axis), np.array(self.axes)
        found = origins + ball(origins / axes, axis / axes)[0][:, None] * axis
        steepest = found / axes**2
        return found, steepest / np.linalg.norm(steepest, axis=1, keepdims=True)

    def thickness(self, frame: Frame) -> float:
        """Return the extent (m) along the axis."""
        farthest = hypot(*(semi * c for semi, c in zip(self.axes, frame.axis, strict=True)))
        return farthest - sum(p * c for p, c in zip(frame.point, frame.axis, strict=True))

    def reach(self, frame: Frame) -> float:
        """Return the largest distance (m) of the silhouette from the axis, at most 1e-4 too large."""
        semi = np.array([frame.along, frame.across]) * np.array(self.axes)
        turned, lengths, _ = np.linalg.svd(semi)
        angle = np.linspace(0.0, 2 * pi, _ROUND + 1)
        ellipse = (turned * lengths) @ np.array([np.cos(angle), np.sin(angle)]) / np.cos(pi / _ROUND)
        centre = frame.local(np.zeros((1, 3)))[0, :2]
        return float(np.linalg.norm(ellipse.T + centre, axis=1).max())

    def farthest(self, frame: Frame) -> float:
        """Return the distance (m) of the farthest point, whose normal points away from the point of contact p.

        Such points x satisfy x - p = t x / a². The farthest has the largest t, at least the square of the longest
        semi-axis.
        """
        longest = max(range(3), key=lambda n: self.axes[n])
        pairs = [(semi**2, p) for semi, p in zip(self.axes, frame.point, strict=True)]
        low = self.axes[longest] ** 2
        high = low + sqrt(sum(square * p * p for square, p in pairs))
        for _ in range(_BISECTIONS):
            t = (low + high) / 2
            too_low = sum(square * (p / (t - square)) ** 2 for square, p in pairs) > 1 if t > low else True
            low, high = (t, high) if too_low else (low, t)
        found = [square * p / (square - high) if square < high else 0.0 for square, p in pairs]
        others = sum(
            x * x / square for n, (x, (square, _)) in enumerate(zip(found, pairs, strict=True)) if n != longest
        )
        rest = self.axes[longest] * sqrt(max(0.0, 1 - others))
        found[longest] = -rest if frame.point[longest] > 0 else rest
        return hypot(*(x - p for x, p in zip(found, frame.point, strict=True)))

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points to the surface, negative outside."""
        return -self._surface.distance(points)

    def gap(self, point: Vector) -> float:
        """Return infinity: its surface has no edge."""
        return inf

    @property
    def face(self) -> str:
        """Its semi-axes."""
        return "semi-axes " + " × ".join(map(in_mm, self.axes))

    @property
    def is_round(self) -> bool:
        """Whether the body is axisymmetric: equal semi-axes along x and y, and axisymmetric inclusions."""
        return self.axes[0] == self.axes[1] and self.holds_round

    @property
    def half_sides(self) -> tuple[float, float]:
        """The semi-axes along x and y (m)."""
        return self.axes[0], self.axes[1]

    def half_plane(self) -> HalfEllipse | None:
        """Return half of its ellipse if it is one of revolution; None with regions or otherwise."""
        a, b, c = self.axes
        return HalfEllipse(a, c) if a == b and not self.embedded else None

    def draw(self, kernel: Any, units: Units, frame: Frame | None = None) -> int:
        """Add a stretched ball; its seam is opposite to the point of contact, its poles are away from both."""
        tag = int(kernel.addSphere(0, 0, 0, 1))
        px, py, pz = frame.point if frame else (0.0, 0.0, self.axes[2])
        a, b, c = self.axes
        # The ball has its seam at +x and its poles at ±z: -x is turned to the point of contact.
        x, y, z = unit((px / a, py / b, pz / c))
        kernel.rotate([(3, tag)], 0, 0, 0, 1, 0, 0, _ASIDE)
        kernel.rotate([(3, tag)], 0, 0, 0, 0, 1, 0, atan2(z, hypot(x, y)))
        kernel.rotate([(3, tag)], 0, 0, 0, 0, 0, 1, atan2(-y, -x) if hypot(x, y) else 0.0)
        kernel.dilate([(3, tag)], 0, 0, 0, *map(units, self.axes))
        return tag

    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return the one surface."""
        return {"surface": (self._surface,)}

    @property
    def _surface(self) -> Ovoid:
        return Ovoid((0.0, 0.0, 0.0), self.axes)

    @property
    def bend(self) -> float:
        """Smallest radius of curvature (m), at the ends of the longest axis."""
        return min(self.axes) ** 2 / max(self.axes)

    def outline(self) -> list[FloatArray]:
        """Return its three ellipses in the coordinate planes."""
        angle = np.linspace(0.0, 2 * pi, _ROUND + 1)
        zero = np.zeros(len(angle))
        circles = [np.roll(np.column_stack([np.cos(angle), np.sin(angle), zero]), turn, axis=1) for turn in range(3)]
        return [circle * np.array(self.axes) for circle in circles]
