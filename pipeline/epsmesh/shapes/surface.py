"""Surfaces of bodies: distances of points, and projection onto them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Vector


class Surface(ABC):
    """One smooth surface. ``is_curved`` says that elements must be curved to fit it."""

    is_curved: bool

    @abstractmethod
    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m), of either sign, of each of the points (n, 3)."""

    @abstractmethod
    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points (n, 3) of the surface."""


@dataclass(frozen=True)
class Plane(Surface):
    """The plane through ``point`` (m) with the unit ``normal``."""

    point: Vector
    normal: Vector
    is_curved = False

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point, positive on the side of the normal."""
        return (points - np.array(self.point)) @ np.array(self.normal)

    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the plane."""
        return points - self.distance(points)[:, None] * np.array(self.normal)


@dataclass(frozen=True)
class Tube(Surface):
    """The side of a cylinder of ``radius`` (m) about the ``axis``, a unit vector, through ``point``."""

    point: Vector
    axis: Vector
    radius: float
    is_curved = True

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point, positive outside."""
        return np.linalg.norm(self._radial(points), axis=1) - self.radius

    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the side."""
        radial = self._radial(points)
        along = points - np.array(self.point) - radial
        return np.array(self.point) + along + self.radius * radial / np.linalg.norm(radial, axis=1, keepdims=True)

    def _radial(self, points: FloatArray) -> FloatArray:
        offset, axis = points - np.array(self.point), np.array(self.axis)
        return offset - (offset @ axis)[:, None] * axis
