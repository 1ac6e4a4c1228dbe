"""Half planes (r, z) of bodies that are the same all round the z axis."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rectangle:
    """Of a cylinder: r up to ``radius``, z from -``height`` to 0 (m).

    ``interfaces`` are the heights z (m), from the top down, at which one layer ends and another material begins;
    ``is_filled`` tells whether what lies below them all is a layer, too.
    """

    radius: float
    height: float
    interfaces: tuple[float, ...] = ()
    is_filled: bool = False


@dataclass(frozen=True)
class HalfEllipse:
    """Of an ellipsoid about the origin: semi-axes ``radius`` across the z axis and ``semi_height`` along it (m)."""

    radius: float
    semi_height: float


HalfPlane = Rectangle | HalfEllipse
