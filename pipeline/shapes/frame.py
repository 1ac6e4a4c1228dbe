"""Where a probe meets a body: a point, the inward normal there, the probe's axis, and its own directions."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import acos, atan2, hypot, sqrt
from typing import Any

from pipeline.shapes.arrays import FloatArray, np

Vector = tuple[float, float, float]
# Turns a length (m) into the units of a model.
Units = Callable[[float], float]


class PlaceError(ValueError):
    """A probe cannot touch a body where it was told to; says why, and what is allowed."""


# A unit vector nearer to another than this is the same.
_SAME = 1e-12


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

    def at(self, along: float, across: float) -> Vector:
        """Return the point (m) of the probe's own plane with these coordinates."""
        x, y, z = (
            p + along * t + across * s for p, t, s in zip(self.point, self.along, self.across, strict=True)
        )  # fmt: skip
        return x, y, z

    def local(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3), in m, in the probe's own coordinates."""
        offset = points - np.array(self.point)
        return np.column_stack([offset @ np.array(unit) for unit in (self.along, self.across, self.outward)])

    def world(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3), in m, of the probe's own coordinates in those of the body."""
        return np.array(self.point) + points @ np.array([self.along, self.across, self.outward])

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


def _weighted(terms: list[str], weights: Vector) -> str:
    """Write a sum of terms with their weights, without those of weight nought."""
    parts = [term if w == 1 else f"{term}*({w:.12g})" for term, w in zip(terms, weights, strict=True) if w != 0]
    return parts[0] if len(parts) == 1 else f"({'+'.join(parts)})"
