"""Contour of a tool in the half plane of its axis: a flat face, a rounding, a flank, and a shaft."""

from dataclasses import dataclass
from math import cos, inf, pi, sin

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.rounded import Rounded


@dataclass(frozen=True)
class ToContour:
    """Signed distance of n points of the half plane to a contour.

    ``gap`` (n,), in m, is > 0 outside. ``normal`` (n, 2) is its gradient, away from the axis and along it.
    ``curvature`` (n,), in 1/m, is its second derivative along the contour.
    """

    gap: FloatArray
    normal: FloatArray
    curvature: FloatArray


@dataclass(frozen=True)
class Contour:
    """The ``section`` of a tool up to the distance ``limit`` (m) from the axis, where its shaft begins."""

    section: Rounded
    limit: float = inf

    def distance(self, beside: FloatArray, height: FloatArray) -> ToContour:
        """Return the distance of points at distances ``beside`` (n,) from the axis and at heights (n,), in m.

        It is the largest of those to all lines that touch the contour: the face, the flank, the shaft, and those
        around the rounding and around the corner between flank and shaft.
        """
        tip, turn = self.section.tip, pi / 2 - self.section.angle
        from_centre = np.column_stack([beside - self.section.flat, height - tip])
        rounding = np.hypot(*from_centre.T)
        flank = np.array([sin(turn), -cos(turn)])
        gaps = [-height, from_centre @ flank - tip, np.where(_is_between(from_centre, 0.0, turn), rounding - tip, -inf)]
        normals = [np.array([0.0, -1.0]), flank, _unit(from_centre)]
        if self.section.angle and self.limit < inf:
            from_corner = np.column_stack([beside, height]) - self._corner
            around = np.where(_is_between(from_corner, turn, pi / 2), np.hypot(*from_corner.T), -inf)
            gaps += [from_corner[:, 0], around]
            normals += [np.array([1.0, 0.0]), _unit(from_corner)]
        largest, at = np.argmax(gaps, axis=0), np.arange(len(beside))
        normal = np.stack([normal + np.zeros_like(from_centre) for normal in normals])[largest, at]
        curvature = np.where(largest == 2, self._of_rounding(rounding), 0.0)
        return ToContour(np.array(gaps)[largest, at], normal, curvature)

    def curvature_at_axis(self, height: FloatArray) -> FloatArray:
        """Return the curvature (n,), in 1/m, at heights (n,), in m, on the axis; zero off a rounding."""
        tip = self.section.tip
        is_round = (self.section.flat == 0) & (height < tip)
        return np.where(is_round, self._of_rounding(np.abs(height - tip)), 0.0)

    @property
    def _corner(self) -> FloatArray:
        """Where the shaft begins (m)."""
        return np.array([self.limit, float(self.section.height(np.array([self.limit]))[0])])

    def _of_rounding(self, radius: FloatArray) -> FloatArray:
        """Return the curvature (n,) at distances (n,) from the centre of the rounding; zero if it is sharp."""
        tip = self.section.tip
        return 1 / np.maximum(radius, tip / 2) if tip else np.zeros_like(radius)


def _is_between(offset: FloatArray, least: float, most: float) -> BoolArray:
    """Return a mask: whether offsets (n, 2) point between two angles (rad) from straight down, neither included."""
    angle = np.arctan2(offset[:, 0], -offset[:, 1])
    between: BoolArray = (least < angle) & (angle < most)
    return between


def _unit(offset: FloatArray) -> FloatArray:
    unit: FloatArray = offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-300)
    return unit
