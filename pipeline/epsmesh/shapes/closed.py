"""Closed surfaces inside a body, which bound its inclusions and regions."""

from abc import abstractmethod
from dataclasses import dataclass
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
# On coarse meshes the largest size is larger by this factor, where the distance is so many radii of the footprint more:
# a part of the body counts there by the fourth power of the distance.
_COARSER, _RADII = 2.0, 4.0
# Growth of sizes for an error bar of 2 %, of a prescribed displacement and of contact that is found.
_GROWTH_OF_COARSE, _GROWTH_OF_FOUND = 0.6, 0.38
# The growth around regions on coarse meshes: no pressure and no edge needs elements there.
_GROWTH_OF_REGIONS = 0.9


@dataclass(frozen=True)
class FarSizes:
    """Element sizes far from a tool of a ``radius`` that touches a body at ``contact``, both in m.

    ``growth`` is that of sizes around the tool, at whose edge the pressure may be singular (``is_singular``).
    ``coarseness``, from 0 to 1, says how much larger elements on and around regions may be than on fine meshes.
    """

    contact: Vector
    radius: float
    growth: float
    coarseness: float
    is_singular: bool

    @property
    def relative(self) -> float:
        """The growth, in units of that for an error bar of 2 %."""
        return self.growth / (_GROWTH_OF_COARSE if self.is_singular else _GROWTH_OF_FOUND)

    @property
    def of_regions(self) -> float:
        """The growth of sizes around regions."""
        return self.growth + self.coarseness * max(_GROWTH_OF_REGIONS * min(self.relative, 1.0) - self.growth, 0.0)

    def size_on(self, half: FloatArray, away: FloatArray) -> FloatArray:
        """Return the size (n) of elements on a surface by ``half`` of its thickness (n), ``away`` (n) from it, in m.

        Far from the contact elements are larger: they need only follow the surface.
        """
        near = np.clip(_OF_DISTANCE * away, ON_SURFACE * half, _LARGEST * half)
        farther = _OF_DISTANCE * (away - _RADII * self.radius)
        largest = _LARGEST * (1 + (_COARSER - 1) * self.coarseness)
        return np.asarray(np.maximum(near, np.minimum(farther, largest * half)))


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
    def sizes(self, far: FarSizes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a point (n, 3) of each part of the surface, the size (n) of elements there, and its area (n).

        They are in m and m², ``far`` from a tool.
        """

    @abstractmethod
    def has_axis(self, within: float) -> bool:
        """Return whether it is axisymmetric about the z axis; its centre is off it by at most ``within`` (m)."""

    @abstractmethod
    def is_mirrored(self, axis: int) -> bool:
        """Return whether it is its own image in the plane where the coordinate ``axis`` is zero."""
