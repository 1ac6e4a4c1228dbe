"""Chebyshev tables of a body's compliance, as large as the asked accuracy takes, each place and its images once."""

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.export.compliance import Region
from pipeline.realtime.table import Table

Places = Sequence[tuple[float, float]]
# c and h (places, 2) at places, for a Poisson's ratio.
Compliances = Callable[[Places, float], FloatArray]

# Intervals between the nodes along one direction, each twice the last: what is known is used again. Nodes over ν.
_SIZES, _POISSONS = (4, 8, 16), 3
# c_ref in units of 1/thickness, above the least c.
_ABOVE = 1.0
_DIGITS = 12


def tabulate(
    region: Region, poissons: tuple[float, float], compliances: Compliances, tolerance: float
) -> tuple[Table, float]:
    """Return a table, and by how much the last but one missed c × room at the new nodes of the last.

    It is the first whose forerunner missed less than ``tolerance``, or the largest.
    """
    low, high = poissons
    ratios = (low + high) / 2 + (high - low) / 2 * _nodes(_POISSONS - 1)
    known: list[dict[tuple[float, float], FloatArray]] = [{} for _ in ratios]
    table, missed = None, np.inf
    for size in _SIZES:
        places = _places(region, size)
        new = [place for place in dict.fromkeys(_image(region, p) for p in places) if place not in known[0]]
        for ratio, found in zip(ratios, known, strict=True):
            found.update(zip(new, compliances(new, float(ratio)), strict=True))
        if table is not None:
            missed = max(
                _missed(table, (x, y), float(ratio), found[x, y][0]) * region.room(x, y)
                for ratio, found in zip(ratios, known, strict=True)
                for x, y in new
            )
        values = np.array([[found[_image(region, place)] for place in places] for found in known])
        table = _table(region, poissons, size, values)
        if missed <= tolerance:
            break
    assert table is not None
    return table, float(missed)


def _missed(table: Table, place: tuple[float, float], poisson: float, c: float) -> float:
    """Return by how much a table misses c at a place, infinitely if it makes no sense of it."""
    try:
        return abs(table.at(*place, poisson).c - c)
    except ArithmeticError:
        return np.inf


def _table(region: Region, poissons: tuple[float, float], size: int, values: FloatArray) -> Table:
    """Return the table through ``values`` (ν, places, 2)."""
    c, h = np.moveaxis(values.reshape(_POISSONS, -1, size + 1, 2), -1, 0)
    c_ref = max(0.0, -float(c.min())) + _ABOVE / region.thickness
    t = 1 / (c + c_ref)
    return Table(_coefficients(t), _coefficients(h * t**3), c_ref, region.reach, region.is_round, poissons)


def _places(region: Region, size: int) -> Places:
    """Return the places of the nodes, x fastest."""
    x, y = (reach * np.sqrt((_nodes(size) + 1) / 2) for reach in region.reach)
    ys = [0.0] if region.is_round else y.tolist()
    return [(round(a, _DIGITS), round(b, _DIGITS)) for b in ys for a in x.tolist()]


def _image(region: Region, place: tuple[float, float]) -> tuple[float, float]:
    """Return the place of which another is the image on a square face, or the same."""
    x, y = place
    is_square = not region.is_round and region.sides[0] == region.sides[1]
    return (max(x, y), min(x, y)) if is_square else place


def _nodes(size: int) -> FloatArray:
    """Return the extrema of T_size, from 1 to -1."""
    return np.asarray(np.cos(np.pi * np.arange(size + 1) / size))


def _coefficients(values: FloatArray) -> FloatArray:
    """Return the Chebyshev coefficients of values at the nodes along each direction."""
    for axis, count in enumerate(values.shape):
        if count > 1:
            matrix = np.polynomial.chebyshev.chebvander(_nodes(count - 1), count - 1)
            values = np.moveaxis(np.tensordot(np.linalg.inv(matrix), values, (1, axis)), 0, axis)
    return values
