"""The frame of a probe on a body: point of contact, inward normal, the probe's axis, and its own directions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import acos, atan2, degrees, hypot, sqrt
from typing import Any, NoReturn

import numpy as np

from epsmesh.arrays import FloatArray

Vector = tuple[float, float, float]
# Converts a length (m) to the units of a model.
Units = Callable[[float], float]


# Largest angle (degrees) between a probe's axis and the inward normal at the contact.
MOST_INCLINED = 60.0
# Smallest angle (degrees) between a length's direction and the axis: a smaller one does not define a rotation.
LEAST_ASIDE = 10.0
# Unit vectors are equal within this distance.
_SAME = 1e-12


class PlaceError(ValueError):
    """A probe cannot touch a body at its place. The message says why, and what is allowed, for the probe's ``key``."""

    def __init__(self, message: str, key: str = "at"):
        super().__init__(message)
        self.key = key


def unit(vector: Vector) -> Vector:
    """Return a vector's direction; a vector along a coordinate axis is exact."""
    x, y, z = vector
    length = hypot(x, y, z)
    return x / length, y / length, z / length


def angle_between(first: Vector, second: Vector) -> float:
    """Return the angle (degrees) between two unit vectors."""
    return degrees(acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(first, second, strict=True))))))


@dataclass(frozen=True)
class Frame:
    """A probe's place on a body, in the body's coordinates.

    ``point`` (m) is where its axis meets the surface, ``normal`` the inward unit normal there, ``axis`` the unit vector
    along which it advances, ``along`` the unit vector of its length, normal to the axis. Its own coordinates are
    (along, across, height): right-handed, with the height pointing back along the axis, out of the tissue.
    """

    point: Vector
    normal: Vector = (0.0, 0.0, -1.0)
    axis: Vector = (0.0, 0.0, -1.0)
    along: Vector = (1.0, 0.0, 0.0)

    @staticmethod
    def touching(point: Vector, normal: Vector, axis: Vector | None = None) -> "Frame":
        """Return the frame at a ``point`` of a surface with the inward unit ``normal``, for an ``axis`` of any length.

        Raises:
            PlaceError: if the axis is inclined too far from the normal.
        """
        if axis is None:
            return Frame(point, normal, normal)
        axis = unit(axis)
        if (angle := angle_between(axis, normal)) > MOST_INCLINED:
            raise PlaceError(
                f"is inclined by {angle:.3g}° to the inward normal {_written(normal)} at the point of contact: "
                f"at most {MOST_INCLINED:g}° are allowed",
                "axis",
            )
        return Frame(point, normal, axis)

    @property
    def is_upright(self) -> bool:
        """Whether the probe presses straight down on a horizontal surface."""
        return self.axis == self.normal == (0.0, 0.0, -1.0)

    @property
    def outward(self) -> Vector:
        """Unit vector back along the axis."""
        x, y, z = self.axis
        return 0.0 - x, 0.0 - y, 0.0 - z

    @cached_property
    def across(self) -> Vector:
        """Unit vector normal to the axis and to ``along``."""
        (a, b, c), (x, y, z) = self.outward, self.along
        return b * z - c * y, c * x - a * z, a * y - b * x

    def turned(self, direction: Vector) -> "Frame":
        """Return the frame whose length is the projection of ``direction`` normal to the axis."""
        inward = sum(d * a for d, a in zip(direction, self.axis, strict=True))
        x, y, z = (d - inward * a for d, a in zip(direction, self.axis, strict=True))
        # In a plane, `hypot` rounds least.
        length = hypot(x, y) if z == 0 else sqrt(x * x + y * y + z * z)
        return replace(self, along=(x / length, y / length, z / length))

    def facing(self, direction: Vector) -> "Frame":
        """Return the frame whose length is the projection of ``direction`` normal to the axis.

        A direction along x is replaced by y if the probe advances along x itself.

        Raises:
            PlaceError: if the direction is that of the axis.
        """
        if self._is_aside(direction):
            return self.turned(direction)
        if direction == (1.0, 0.0, 0.0):
            return self.turned((0.0, 1.0, 0.0))
        self.refuse_direction()

    def refuse_direction(self) -> NoReturn:
        """Raise the error for a direction that is too close to the axis."""
        raise PlaceError(
            f"must not be that of the probe's axis {_written(self.axis)}: the angle between them must be at least "
            f"{LEAST_ASIDE:g}°",
            "direction",
        )

    def is_replaced(self, direction: Vector) -> bool:
        """Return whether :meth:`facing` replaces this direction by another one."""
        return not self._is_aside(direction)

    def _is_aside(self, direction: Vector) -> bool:
        angle = angle_between(unit(direction), self.axis)
        return LEAST_ASIDE <= angle <= 180 - LEAST_ASIDE

    @cached_property
    def turn(self) -> FloatArray | None:
        """Matrix (3, 3) of the smallest rotation after which the probe presses along -z; None if none is needed."""
        x, y, z = self.outward
        if (square := x * x + y * y) < _SAME**2:
            # Half a turn about x.
            return None if z > 0 else np.diag([1.0, -1.0, -1.0])
        # 1 / (1 + z), without cancellation if the probe comes from below.
        c = 1 / (1 + z) if z > 0 else (1 - z) / square
        return np.array([[1 - c * x * x, -c * x * y, -x], [-c * x * y, 1 - c * y * y, -y], [x, y, z]])

    @cached_property
    def upright(self) -> "Frame":
        """The same place after :attr:`turn` has rotated the body about the origin."""
        if self.turn is None:
            return self
        (px, py, pz), (nx, ny, nz), (ax, ay, _) = (
            map(float, self.turn @ np.array(vector)) for vector in (self.point, self.normal, self.along)
        )
        # Exact zeros: rounding across the axis would be a movement.
        return Frame((px, py, pz), (nx, ny, nz), (0.0, 0.0, -1.0), (ax, ay, 0.0))

    def turned_by(self, turn: FloatArray | None) -> "Frame":
        """Return the same place after a rotation (3, 3) of the body about the origin; None is none."""
        if turn is None:
            return self
        vectors = (self.point, self.normal, self.axis, self.along)
        return Frame(*((float(x), float(y), float(z)) for x, y, z in (turn @ np.array(vector) for vector in vectors)))

    def at(self, along: float, across: float) -> Vector:
        """Return the point (m) with these coordinates in the probe's own plane."""
        x, y, z = (p + along * t + across * s for p, t, s in zip(self.point, self.along, self.across, strict=True))
        return x, y, z

    def inward(self, length: float) -> Vector:
        """Return a vector of a ``length`` along the axis, into the tissue."""
        x, y, z = (length * c for c in self.axis)
        return x, y, z

    def local(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3), in m, in the probe's own coordinates."""
        offset = points - np.array(self.point)
        return np.column_stack([offset @ unit for unit in self.axes])

    @property
    def axes(self) -> FloatArray:
        """Unit vectors of the probe's own coordinates, in rows (3, 3)."""
        return np.array([self.along, self.across, self.outward])

    def world(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3), in m, from the probe's own coordinates in those of the body."""
        return np.array(self.point) + points @ self.axes

    def in_plane(self, points: FloatArray) -> FloatArray:
        """Return points (n, 2), in m, of the probe's own plane in the body's coordinates, (n, 3)."""
        return self.world(np.column_stack([points, np.zeros(len(points))]))

    def reach(self, points: FloatArray) -> float:
        """Return the largest distance (m) of ``points`` (n, 3) from the probe's axis."""
        local = self.local(points)
        return float(np.hypot(local[:, 0], local[:, 1]).max())

    def farthest(self, points: FloatArray) -> float:
        """Return the largest distance (m) of ``points`` (n, 3) from the point of contact."""
        return float(np.linalg.norm(points - np.array(self.point), axis=1).max())

    def expressions(self, unit: float) -> tuple[str, str, str]:
        """Return the probe's own coordinates, in units of 1/``unit`` m, as text in x, y and z for a mesh generator."""
        offsets = [f"({name}-({unit * c:.12g}))" for name, c in zip("xyz", self.point, strict=True)]
        return _weighted(offsets, self.along), _weighted(offsets, self.across), _weighted(offsets, self.outward)

    def place(self, kernel: Any, shapes: list[tuple[int, int]], units: Units) -> None:
        """Rotate a shape drawn at ``point``, upright and along x, into this frame."""
        x, y, z = map(units, self.point)
        tilt, level = self._tilt, self._level_along
        if level != (1.0, 0.0, 0.0):
            # numpy's arctan2 and math's differ in the last digit, which changes gmsh's mesh.
            kernel.rotate(shapes, x, y, z, 0, 0, 1, float(np.arctan2(level[1], level[0])))
        if tilt:
            kernel.rotate(shapes, x, y, z, *tilt[0], tilt[1])

    @property
    def _tilt(self) -> tuple[Vector, float] | None:
        """Axis and angle of the smallest rotation from upright to this frame; None if it is upright."""
        x, y, z = self.outward
        sine = hypot(x, y)
        if sine < _SAME:
            return None if z > 0 else ((1.0, 0.0, 0.0), acos(-1.0))
        return (-y / sine, x / sine, 0.0), atan2(sine, z)

    @property
    def _level_along(self) -> Vector:
        """Return the direction of ``along`` after the tilt is undone."""
        tilt = self._tilt
        if tilt is None:
            return self.along
        (kx, ky, kz), angle = tilt
        k, v = np.array((kx, ky, kz)), np.array(self.along)
        back = v * np.cos(angle) - np.cross(k, v) * np.sin(angle) + k * (k @ v) * (1 - np.cos(angle))
        return float(back[0]), float(back[1]), float(back[2])


def _written(vector: Vector) -> str:
    return f"[{', '.join(f'{c + 0.0:.3g}' for c in vector)}]"


def _weighted(terms: list[str], weights: Vector) -> str:
    """Return a sum of terms with their weights as text, without those of weight zero."""
    parts = [term if w == 1 else f"{term}*({w:.12g})" for term, w in zip(terms, weights, strict=True) if w != 0]
    return parts[0] if len(parts) == 1 else f"({'+'.join(parts)})"
