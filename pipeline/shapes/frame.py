"""Where a probe meets a body: a point, the inward normal there, the probe's axis, and its own directions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import acos, atan2, degrees, hypot, sqrt
from typing import Any, NoReturn

import numpy as np

from pipeline.arrays import FloatArray

Vector = tuple[float, float, float]
# Turns a length (m) into the units of a model.
Units = Callable[[float], float]


# A probe's axis may lie at most this far (degrees) from the inward normal where it touches.
MOST_INCLINED = 60.0
# A length nearer to a probe's axis than this (degrees) says nothing of how the probe is turned about it.
LEAST_ASIDE = 10.0
# A unit vector nearer to another than this is the same.
_SAME = 1e-12


class PlaceError(ValueError):
    """A probe cannot touch a body where it was told to; says why, and what is allowed, of the probe's key ``key``."""

    def __init__(self, message: str, key: str = "at"):
        super().__init__(message)
        self.key = key


def unit(vector: Vector) -> Vector:
    """Return a vector's direction; to the last digit what it was if it is one along an axis of coordinates."""
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
    along which it advances, ``along`` the unit vector, normal to the axis, along its length. Its own coordinates are
    (along, across, height): right-handed, and the height points back along the axis, out of the tissue.
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
                f"is inclined by {angle:.3g}° to the inward normal {_written(normal)} where the probe touches: "
                f"at most {MOST_INCLINED:g}° are allowed",
                "axis",
            )
        return Frame(point, normal, axis)

    @property
    def is_upright(self) -> bool:
        """Whether the probe presses straight down on what lies level."""
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
        """Return the frame whose probe's length lies along ``direction``, as far as it is normal to the axis."""
        inward = sum(d * a for d, a in zip(direction, self.axis, strict=True))
        x, y, z = (d - inward * a for d, a in zip(direction, self.axis, strict=True))
        # In a plane, `hypot` is what rounds least.
        length = hypot(x, y) if z == 0 else sqrt(x * x + y * y + z * z)
        return replace(self, along=(x / length, y / length, z / length))

    def facing(self, direction: Vector) -> "Frame":
        """Return the frame whose probe's length lies along ``direction``, as far as it is normal to the axis.

        The direction x stands for that of y where the probe advances along x itself.

        Raises:
            PlaceError: if the direction is that of the axis.
        """
        if self._is_aside(direction):
            return self.turned(direction)
        if direction == (1.0, 0.0, 0.0):
            return self.turned((0.0, 1.0, 0.0))
        self.refuse_direction()

    def refuse_direction(self) -> NoReturn:
        """Say that a direction is too near to the axis."""
        raise PlaceError(
            f"must not be that of the probe's axis {_written(self.axis)}: it has to lie {LEAST_ASIDE:g}° aside at "
            "least",
            "direction",
        )

    def is_replaced(self, direction: Vector) -> bool:
        """Tell whether :meth:`facing` takes another direction for this one."""
        return not self._is_aside(direction)

    def _is_aside(self, direction: Vector) -> bool:
        angle = angle_between(unit(direction), self.axis)
        return LEAST_ASIDE <= angle <= 180 - LEAST_ASIDE

    @cached_property
    def turn(self) -> FloatArray | None:
        """The matrix (3, 3) of the shortest turn after which the probe presses along -z; None if it does already."""
        x, y, z = self.outward
        if (square := x * x + y * y) < _SAME**2:
            # Half a turn about x.
            return None if z > 0 else np.diag([1.0, -1.0, -1.0])
        # 1 / (1 + z), without cancellation where the probe comes from below.
        c = 1 / (1 + z) if z > 0 else (1 - z) / square
        return np.array([[1 - c * x * x, -c * x * y, -x], [-c * x * y, 1 - c * y * y, -y], [x, y, z]])

    @cached_property
    def upright(self) -> "Frame":
        """The same place on the body once that has been turned about the origin by :attr:`turn`."""
        if self.turn is None:
            return self
        (px, py, pz), (nx, ny, nz), (ax, ay, _) = (
            map(float, self.turn @ np.array(vector)) for vector in (self.point, self.normal, self.along)
        )
        # Down to the last digit: what is left of rounding across the axis would be a movement of its own.
        return Frame((px, py, pz), (nx, ny, nz), (0.0, 0.0, -1.0), (ax, ay, 0.0))

    def at(self, along: float, across: float) -> Vector:
        """Return the point (m) of the probe's own plane with these coordinates."""
        x, y, z = (p + along * t + across * s for p, t, s in zip(self.point, self.along, self.across, strict=True))
        return x, y, z

    def inward(self, length: float) -> Vector:
        """Return a vector of a ``length`` along the axis, into the tissue."""
        x, y, z = (length * c for c in self.axis)
        return x, y, z

    def local(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3), in m, in the probe's own coordinates."""
        offset = points - np.array(self.point)
        return np.column_stack([offset @ np.array(unit) for unit in (self.along, self.across, self.outward)])

    def world(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3), in m, of the probe's own coordinates in those of the body."""
        return np.array(self.point) + points @ np.array([self.along, self.across, self.outward])

    def in_plane(self, points: FloatArray) -> FloatArray:
        """Return points (n, 2), in m, of the probe's own plane in the coordinates of the body, (n, 3)."""
        return self.world(np.column_stack([points, np.zeros(len(points))]))

    def reach(self, points: FloatArray) -> float:
        """Return the largest distance (m) of ``points`` (n, 3) from the probe's axis."""
        local = self.local(points)
        return float(np.hypot(local[:, 0], local[:, 1]).max())

    def farthest(self, points: FloatArray) -> float:
        """Return the largest distance (m) of ``points`` (n, 3) from the point of contact."""
        return float(np.linalg.norm(points - np.array(self.point), axis=1).max())

    def expressions(self, unit: float) -> tuple[str, str, str]:
        """Write the probe's own coordinates, in units of 1/``unit`` m, as text of x, y and z for a mesh generator."""
        offsets = [f"({name}-({unit * c:.12g}))" for name, c in zip("xyz", self.point, strict=True)]
        return _weighted(offsets, self.along), _weighted(offsets, self.across), _weighted(offsets, self.outward)

    def place(self, kernel: Any, shapes: list[tuple[int, int]], units: Units) -> None:
        """Turn what was drawn at ``point``, upright and along x, to how it stands."""
        x, y, z = map(units, self.point)
        tilt, level = self._tilt, self._level_along
        if level != (1.0, 0.0, 0.0):
            # numpy's arctan2 and math's differ in the last digit, by which gmsh makes another mesh.
            kernel.rotate(shapes, x, y, z, 0, 0, 1, float(np.arctan2(level[1], level[0])))
        if tilt:
            kernel.rotate(shapes, x, y, z, *tilt[0], tilt[1])

    @property
    def _tilt(self) -> tuple[Vector, float] | None:
        """Axis and angle of the shortest turn from upright to this frame, None where it is upright."""
        x, y, z = self.outward
        sine = hypot(x, y)
        if sine < _SAME:
            return None if z > 0 else ((1.0, 0.0, 0.0), acos(-1.0))
        return (-y / sine, x / sine, 0.0), atan2(sine, z)

    @property
    def _level_along(self) -> Vector:
        """Return where ``along`` points once the tilt is undone."""
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
    """Write a sum of terms with their weights, without those of weight nought."""
    parts = [term if w == 1 else f"{term}*({w:.12g})" for term, w in zip(terms, weights, strict=True) if w != 0]
    return parts[0] if len(parts) == 1 else f"({'+'.join(parts)})"
