"""Half planes (r, z) of bodies that are the same all round the z axis."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pipeline.arrays import FloatArray


@dataclass(frozen=True)
class Rectangle:
    """Of a cylinder: r up to ``radius``, z from -``height`` to 0 (m).

    ``interfaces`` are the heights z (m), from the top down, at which one layer ends and another material begins;
    ``is_filled`` tells whether what lies below them all is a layer, too.
    """

    is_curved: ClassVar[bool] = False

    radius: float
    height: float
    interfaces: tuple[float, ...] = ()
    is_filled: bool = False

    def fall(self, radii: FloatArray) -> FloatArray:
        """Return how far (m) the surface at ``radii`` (m) lies below its highest point: not at all."""
        return np.zeros_like(radii)


@dataclass(frozen=True)
class HalfEllipse:
    """Of an ellipsoid about the origin: semi-axes ``radius`` across the z axis and ``semi_height`` along it (m)."""

    is_curved: ClassVar[bool] = True

    radius: float
    semi_height: float

    def fall(self, radii: FloatArray) -> FloatArray:
        """Return how far (m) the surface at ``radii`` (m) lies below its highest point."""
        square = np.minimum(radii / self.radius, 1.0) ** 2
        fall: FloatArray = self.semi_height * square / (1 + np.sqrt(1 - square))
        return fall


HalfPlane = Rectangle | HalfEllipse
