"""Half planes (r, z) of axisymmetric bodies."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray


@dataclass(frozen=True)
class Rectangle:
    """Half plane of a cylinder: r up to ``radius``, z from -``height`` to 0 (m).

    ``interfaces`` are the heights z (m), from the top down, of the interfaces between layers. ``is_filled`` says that
    the part below all of them is a layer, too.
    """

    is_curved: ClassVar[bool] = False

    radius: float
    height: float
    interfaces: tuple[float, ...] = ()
    is_filled: bool = False

    def fall(self, radii: FloatArray) -> FloatArray:
        """Return the depth (m) of the surface at ``radii`` (m) below its highest point: zero."""
        return np.zeros_like(radii)


@dataclass(frozen=True)
class HalfEllipse:
    """Half plane of an ellipsoid about the origin: semi-axes ``radius`` and ``semi_height`` along z (m)."""

    is_curved: ClassVar[bool] = True

    radius: float
    semi_height: float

    def fall(self, radii: FloatArray) -> FloatArray:
        """Return the depth (m) of the surface at ``radii`` (m) below its highest point."""
        square = np.minimum(radii / self.radius, 1.0) ** 2
        fall: FloatArray = self.semi_height * square / (1 + np.sqrt(1 - square))
        return fall


HalfPlane = Rectangle | HalfEllipse
