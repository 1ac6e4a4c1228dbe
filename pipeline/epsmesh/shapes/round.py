"""Flat footprints bounded by an ellipse, such as a disc."""

from abc import abstractmethod
from math import pi
from typing import Any, ClassVar

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.frame import Frame, Units
from epsmesh.shapes.probe import ON_EDGE
from epsmesh.shapes.punch import Straight
from epsmesh.shapes.revolved import Revolved, flat_face


class RoundPunch(Straight):
    """A flat punch whose edge is an ellipse."""

    is_curved: ClassVar[bool] = True
    # Points of the edge in pictures.
    OUTLINE: ClassVar[int] = 200

    @property
    @abstractmethod
    def semi_axes(self) -> tuple[float, float]:
        """Its semi-axes (m), along and across."""

    @property
    def is_round(self) -> bool:
        """Whether the semi-axes are equal."""
        return self.semi_axes[0] == self.semi_axes[1]

    @property
    def revolved(self) -> Revolved | None:
        """A flat face if the semi-axes are equal."""
        return flat_face(self.semi_axes[0]) if self.is_round else None

    @property
    def circumradius(self) -> float:
        """The longer semi-axis (m)."""
        return max(self.semi_axes)

    @property
    def half_width(self) -> float:
        """The shorter semi-axis (m)."""
        return min(self.semi_axes)

    @property
    def mean_square(self) -> float:
        """A third of the sum of the squares of the semi-axes (m²)."""
        return (self.semi_axes[0] ** 2 + self.semi_axes[1] ** 2) / 3

    def draw(self, kernel: Any, frame: Frame, units: Units) -> int:
        """Add the ellipse."""
        a, b = map(units, self.semi_axes)
        x, y, z = map(units, frame.point)
        # The kernel expects the longer axis first.
        tag = int(kernel.addDisk(x, y, z, max(a, b), min(a, b)))
        if a < b:
            kernel.rotate([(2, tag)], x, y, z, 0, 0, 1, pi / 2)
        frame.place(kernel, [(2, tag)], units)
        return tag

    def points_at(self, angle: FloatArray) -> FloatArray:
        """Return the points (n, 2) of the edge at eccentric angles (n,), in m."""
        a, b = self.semi_axes
        return np.column_stack([a * np.cos(angle), b * np.sin(angle)])

    def outline(self) -> FloatArray:
        """Return the ellipse at equal steps of its eccentric angle."""
        return self.points_at(np.linspace(0.0, 2 * pi, self.OUTLINE + 1))

    def covers(self, points: FloatArray) -> BoolArray:
        """Return a mask of points within the ellipse."""
        within: BoolArray = np.linalg.norm(points / np.array(self.semi_axes), axis=1) <= 1 + ON_EDGE
        return within
