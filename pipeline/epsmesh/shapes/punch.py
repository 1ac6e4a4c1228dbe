"""Punches, tools with a flat face: what they have in common."""

from abc import abstractmethod
from math import inf
from typing import ClassVar

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.probe import Probe

# A line is an axis of the footprint within this tolerance on unit vectors.
_ALIGNED = 1e-12


class Punch(Probe):
    """A tool with a flat face; contact ends at its edge, unless the tool lifts off."""

    is_flat: ClassVar[bool] = True
    has_singular_edge: ClassVar[bool] = True
    ends_sharply: ClassVar[bool] = True
    # Zero (m): contact is expected to end at the edge of the face.
    rim_offset: ClassVar[float] = 0.0

    NOT_DRAWN = ("action", "depth", "contact", "friction", "slice", "motion", "toughness", "insertion", "crack_shape")

    @property
    def force_exponent(self) -> float | None:
        """1: F is proportional to the depth, except in a slit."""
        return None if self.slit else 1.0

    def is_mirrored(self, along: float, across: float) -> bool:
        """Return true for its two axes, and for any line if it is round."""
        return self.is_round or min(abs(along), abs(across)) < _ALIGNED

    def gap(self, body: Body, frame: Frame) -> float:
        """Return the distance (m) from the nearest point of the outline to the edge of the convex face."""
        return min(body.gap(frame.at(float(x), float(y))) for x, y in self.outline())

    @abstractmethod
    def covers(self, points: FloatArray) -> BoolArray:
        """Return a mask of ``points`` (n, 2) of its own coordinates (m) below its face, edge included."""

    def profile(self, points: FloatArray) -> FloatArray:
        """Return zero below the face, infinity elsewhere."""
        return np.where(self.covers(points), 0.0, inf)

    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return true: the tool ends wherever the footprint does."""
        return np.ones(len(points), dtype=bool)

    @property
    def rim_size(self) -> tuple[float, float]:
        """Length (m) of the edge, and zero area."""
        return self.perimeter, 0.0

    def rim_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the edge of the face as text."""
        return self.edge_distance(along, across, height, unit)


class Straight(Punch):
    """A punch that moves along its axis only."""

    PROPORTIONAL_TO = ("depth",)
