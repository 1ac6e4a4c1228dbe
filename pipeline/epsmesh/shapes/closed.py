"""Closed surfaces inside a body, which bound its inclusions and regions."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.surface import Surface

# Element size on the surface in units of half of the thickness inside it. With elements of degree 2, F is then within
# .1 % of its value for half these sizes (benchmarks/results/organs.md), and the error bar accounts for the rest.
ON_SURFACE = 0.4
# Far from the contact, element sizes are this share of the distance from it, up to the second in units of half of the
# thickness.
_OF_DISTANCE, _LARGEST = 0.15, 0.8


def size_on(half: FloatArray, away: FloatArray) -> FloatArray:
    """Return the size (n) of elements on a surface by ``half`` of its thickness (n), ``away`` from a contact (n), in m.

    Far from the contact elements are larger: they need only follow the surface.
    """
    return np.clip(_OF_DISTANCE * away, ON_SURFACE * half, _LARGEST * half)


class Closed(Surface):
    """A closed surface. Distances are positive outside.

    ``LEAST`` is :attr:`least` in the words of messages.
    """

    is_curved = True
    LEAST: ClassVar[str]

    @property
    @abstractmethod
    def least(self) -> float:
        """Half of its smallest thickness (m), to which elements and distances are compared."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """Enclosed volume (m³)."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[Vector, Vector]:
        """Lowest and highest coordinates (m)."""

    @property
    @abstractmethod
    def identity(self) -> str:
        """Text that is equal for equal surfaces only."""

    @abstractmethod
    def sample(self, count: int) -> FloatArray:
        """Return at least ``count`` points of the surface (n, 3), in m, which leave no part of it out."""

    @abstractmethod
    def sizes(self, contact: Vector) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a point (n, 3) of each part of the surface, the size (n) of elements there, and its area (n).

        They are in m and m²; a tool touches the body at the point of ``contact``.
        """

    @abstractmethod
    def has_axis(self, within: float) -> bool:
        """Return whether it is axisymmetric about the z axis; its centre is off it by at most ``within`` (m)."""

    @abstractmethod
    def is_mirrored(self, axis: int) -> bool:
        """Return whether it is its own image in the plane where the coordinate ``axis`` is zero."""
