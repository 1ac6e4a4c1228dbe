"""An ellipse in its own plane, of which a disc is one: what round footprints share. ``axes`` are its semi-axes (m)."""

from math import pi
from typing import Any

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.shapes.frame import Frame, Units


def draw_ellipse(kernel: Any, axes: tuple[float, float], frame: Frame, units: Units) -> int:
    """Add an ellipse, at its place, to a CAD ``kernel``; return the tag of the face."""
    a, b = map(units, axes)
    x, y, z = map(units, frame.point)
    # The kernel wants the longer axis first.
    tag = int(kernel.addDisk(x, y, z, max(a, b), min(a, b)))
    if a < b:
        kernel.rotate([(2, tag)], x, y, z, 0, 0, 1, pi / 2)
    frame.place(kernel, [(2, tag)], units)
    return tag


def points_of_ellipse(axes: tuple[float, float], angle: FloatArray) -> FloatArray:
    """Return the points (n, 2) of an ellipse at eccentric angles (n,)."""
    return np.column_stack([axes[0] * np.cos(angle), axes[1] * np.sin(angle)])


def closed_ellipse(axes: tuple[float, float], edges: int) -> FloatArray:
    """Return the points of an ellipse at equal steps of its eccentric angle, the first one once more at the end."""
    return points_of_ellipse(axes, np.linspace(0.0, 2 * pi, edges + 1))
