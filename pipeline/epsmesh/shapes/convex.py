"""Intersections of lines with half spaces and balls, the faces of convex bodies."""

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Vector


def slab(origins: FloatArray, direction: Vector, normal: Vector, low: float, high: float) -> tuple[FloatArray, ...]:
    """Return where lines enter and leave the slab between two planes: ``low`` <= x · ``normal`` <= ``high`` (m).

    Lines start at ``origins`` (n, 3). Both results are (n), in m along the unit vector ``direction``; infinite for a
    line parallel to the planes, NaN if that line is outside.
    """
    height, slope = origins @ np.array(normal), float(np.dot(direction, normal))
    if slope == 0:
        inside = (low <= height) & (height <= high)
        return np.where(inside, -np.inf, np.nan), np.where(inside, np.inf, np.nan)
    ends = (low - height) / slope, (high - height) / slope
    return np.minimum(*ends), np.maximum(*ends)


def ball(origins: FloatArray, direction: FloatArray) -> tuple[FloatArray, ...]:
    """Return where lines enter and leave the unit ball, or in the plane the unit disc.

    Lines start at ``origins`` (n, d). Both results are (n), in units of ``direction`` (d), of any non-zero length; NaN
    for a line that misses.
    """
    square, along = float(direction @ direction), origins @ direction
    with np.errstate(invalid="ignore"):
        root = np.sqrt(along**2 - square * (np.sum(origins**2, axis=1) - 1))
    return (-along - root) / square, (-along + root) / square
