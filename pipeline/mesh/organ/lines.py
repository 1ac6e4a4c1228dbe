"""Lines in a plane: whether any of them cross."""

import numpy as np

from pipeline.arrays import BoolArray, FloatArray


def cross(start: FloatArray, end: FloatArray) -> bool:
    """Tell whether any two of the segments from ``start`` (n, 2) to ``end`` (n, 2) that share no end meet."""
    sides = _sign(start[:, None], end[:, None], start[None]) * _sign(start[:, None], end[:, None], end[None])
    # Pieces of one straight line are on no side of each other: they meet if they overlap along it.
    low, high = np.minimum(start, end), np.maximum(start, end)
    apart = ((low[:, None] > high[None]) | (high[:, None] < low[None])).any(axis=-1)
    joined = _same(start, start) | _same(start, end) | _same(end, start) | _same(end, end)
    return bool(((sides <= 0) & (sides.T <= 0) & ~joined & ~apart).any())


def _sign(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Tell on which side of the lines from ``a`` to ``b`` the points ``c`` are."""
    ab, ac = b - a, c - a
    return np.asarray(np.sign(ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]))


def _same(one: FloatArray, other: FloatArray) -> BoolArray:
    return np.asarray((one[:, None] == other[None]).all(axis=-1))
