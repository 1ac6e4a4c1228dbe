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
