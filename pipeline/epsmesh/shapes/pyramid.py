"""A regular pyramid with its apex down, sharp, or rounded by a ball that rolls inside of it: heights and distances.

The pyramid is all that no plane with a normal between those of its faces cuts off: normals at the apex fill a spherical
polygon, those at a ridge an arc, and a face has one. A rounding of radius ``tip`` is a smaller pyramid plus a ball.
"""

from dataclasses import dataclass
from functools import cached_property
from math import cos, pi, sin

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance

# Rounding of what is on a boundary between a face, a ridge and the apex.
_TINY = 1e-12


@dataclass(frozen=True)
class Pyramid:
    """``sides`` faces at an ``angle`` (rad) to the axis; apex and ridges are rounded to the radius ``tip`` (m).

    The first face looks along the first coordinate. Heights are above the lowest point.
    """

    sides: int
    angle: float
    tip: float = 0.0

    @cached_property
    def faces(self) -> FloatArray:
        """Outward unit normals (sides, 3) of the faces."""
        turns = 2 * pi * np.arange(self.sides) / self.sides
        level, down = cos(self.angle), sin(self.angle)
        return np.column_stack([level * np.cos(turns), level * np.sin(turns), np.full(self.sides, -down)])

    @cached_property
    def ridges(self) -> FloatArray:
        """Unit vectors (sides, 3) along the ridges, upwards; each is between a face and the next one."""
        cross = np.cross(self.faces, np.roll(self.faces, -1, axis=0))
        cross *= np.sign(cross[:, 2:])
        found: FloatArray = cross / np.linalg.norm(cross, axis=1, keepdims=True)
        return found

    def height(self, points: FloatArray) -> FloatArray:
        """Return the heights (n,), in m, at ``points`` (n, 2): the highest plane that touches it there."""
        height = np.max((points @ self.faces[:, :2].T - self.tip) / -self.faces[:, 2], axis=1)
        if not self.tip:
            return height
        squared = np.sum(points**2, axis=1)
        for ridge, pair in zip(self.ridges, self._pairs, strict=True):
            # Lower root of |q|² - (q e)² = tip² for q = (x, z).
            along, steep = points @ ridge[:2], 1 - ridge[2] ** 2
            root = (along * ridge[2]) ** 2 - steep * (squared - along**2 - self.tip**2)
            z = (along * ridge[2] - np.sqrt(np.maximum(root, 0.0))) / steep
            q = np.column_stack([points, z])
            is_on = (root >= 0) & _is_between(q - np.outer(q @ ridge, ridge), pair)
            height = np.where(is_on, np.maximum(height, z), height)
        z = -np.sqrt(np.maximum(self.tip**2 - squared, 0.0))
        is_on = (squared <= self.tip**2) & self._is_at_apex(np.column_stack([points, z]))
        lowest: FloatArray = self.tip + np.where(is_on, np.maximum(height, z), height)
        return lowest

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance of ``points`` (n, 3), in m: the largest of those to all planes that touch it."""
        q = points - np.array([0.0, 0.0, self.tip])
        to_faces = q @ self.faces.T
        number = np.argmax(to_faces, axis=1)
        gap, normal = to_faces[np.arange(len(q)), number], self.faces[number]
        curvature = np.zeros((len(q), 3, 3))
        for ridge, pair in zip(self.ridges, self._pairs, strict=True):
            beside = q - np.outer(q @ ridge, ridge)
            is_on = _is_between(beside, pair)
            across = np.cross(ridge, _unit(beside))
            gap, normal, curvature = self._nearer(is_on, beside, across[:, :, None] * across[:, None, :],
                                                  (gap, normal, curvature))  # fmt: skip
        is_on = self._is_at_apex(q)
        outward = _unit(q)
        around = np.eye(3) - outward[:, :, None] * outward[:, None, :]
        gap, normal, curvature = self._nearer(is_on, q, around, (gap, normal, curvature))
        on_axis = np.linalg.norm(q[:, :2], axis=1) <= _TINY * np.maximum(np.abs(q[:, 2]), _TINY)
        above = on_axis & (q[:, 2] >= 0)  # above the centre of the rounding, where the gradient is not unique
        down = np.array([0.0, 0.0, -1.0])
        normal = np.where(above[:, None], down, normal)
        curvature = np.where(above[:, None, None], 0.0, curvature)
        return Distance(np.where(above, -points[:, 2], gap - self.tip), normal, curvature)

    def _nearer(
        self,
        is_on: BoolArray,
        offset: FloatArray,
        bend: FloatArray,
        before: tuple[FloatArray, FloatArray, FloatArray],
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return distance, normal and curvature with those of points ``is_on`` a ridge or the apex, by ``offset``."""
        gap, normal, curvature = before
        length = np.linalg.norm(offset, axis=1)
        is_on = is_on & (length >= gap)
        # As around other roundings, the curvature is at most twice its own; a sharp ridge has none.
        found = bend / np.maximum(length, self.tip / 2)[:, None, None] if self.tip else np.zeros_like(bend)
        return (
            np.where(is_on, length, gap),
            np.where(is_on[:, None], _unit(offset), normal),
            np.where(is_on[:, None, None], found, curvature),
        )

    @property
    def _pairs(self) -> list[FloatArray]:
        """The normals (2, 3) of the two faces at each ridge."""
        return [self.faces[[number, (number + 1) % self.sides]] for number in range(self.sides)]

    def _is_at_apex(self, q: FloatArray) -> BoolArray:
        """Return a mask of offsets (n, 3) that are normals at the apex: no ridge points along them."""
        at_apex: BoolArray = np.all(q @ self.ridges.T <= 0, axis=1)
        return at_apex


def _is_between(offset: FloatArray, pair: FloatArray) -> BoolArray:
    """Return a mask of offsets (n, 3), in the plane of a ``pair`` of unit vectors (2, 3), that are between them."""
    one, other = pair
    cosine = float(one @ other)
    along, beside = offset @ one, offset @ other
    between: BoolArray = (along - cosine * beside > 0) & (beside - cosine * along > 0)
    return between


def _unit(offset: FloatArray) -> FloatArray:
    found: FloatArray = offset / np.maximum(np.linalg.norm(offset, axis=-1, keepdims=True), 1e-300)
    return found
