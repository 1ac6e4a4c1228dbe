"""Where lines enter and leave what bounds convex bodies."""

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.shapes.frame import Vector


def slab(origins: FloatArray, direction: Vector, normal: Vector, low: float, high: float) -> tuple[FloatArray, ...]:
    """Return where lines enter and leave what lies between two planes: ``low`` <= x · ``normal`` <= ``high`` (m).

    Lines start at ``origins`` (n, 3); both results are (n), in m along the unit vector ``direction``, infinite where a
    line never does, not a number where it lies outside altogether.
    """
    height, slope = origins @ np.array(normal), float(np.dot(direction, normal))
    if slope == 0:
        inside = (low <= height) & (height <= high)
        return np.where(inside, -np.inf, np.nan), np.where(inside, np.inf, np.nan)
    ends = (low - height) / slope, (high - height) / slope
    return np.minimum(*ends), np.maximum(*ends)


def ball(origins: FloatArray, direction: FloatArray) -> tuple[FloatArray, ...]:
    """Return where lines enter and leave the unit ball, or in the plane the unit disc.

    Lines start at ``origins`` (n, d); both results are (n), in units of ``direction`` (d), of any length but nought,
    not a number where a line misses.
    """
    square, along = float(direction @ direction), origins @ direction
    with np.errstate(invalid="ignore"):
        root = np.sqrt(along**2 - square * (np.sum(origins**2, axis=1) - 1))
    return (-along - root) / square, (-along + root) / square
