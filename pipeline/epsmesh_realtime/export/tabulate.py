"""Chebyshev tables of a body's compliance, refined to an accuracy; symmetric places are solved once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_realtime.export.disc import Disc
from epsmesh_realtime.export.region import Region
from epsmesh_realtime.table import Table

Places = Sequence[tuple[float, float]]
# Returns c, h, and the values for blades and bonded tools (places, 9) for a Poisson's ratio; or c and h only.
Compliances = Callable[[Places, float], FloatArray]

# Intervals along one direction, doubled so that nodes are reused. Number of nodes over ν.
_SIZES, _POISSONS = (4, 8, 16), 3
# c_ref minus the least c, in units of 1/thickness.
_ABOVE = 1.0
_DIGITS = 12
# Exchange of x and y: order and signs of c, h, A₁, A_xy, R_xz, R_yz, mean and half difference, R_xy.
_SWAPPED, _SIGNS = [0, 1, 2, 3, 5, 4, 6, 7, 8], np.array([1, 1, -1, 1, 1, 1, 1, -1, 1])
# Of the tables after c and h, the first _BENDS are second derivatives. On a round body, along x, some equal others.
_BENDS, _TWINS = 2, {1: 0, 3: 2, 6: 5}


def tabulate(
    region: Region,
    poissons: tuple[float, float],
    compliances: Compliances,
    tolerance: float,
    sizes: Sequence[int] = _SIZES,
    *,
    sparse: bool = False,
) -> tuple[Table, float]:
    """Return a table, and the error of the next coarser one in c × room, at the table's new nodes.

    The table is the first for which that error is at most ``tolerance``, or the largest. ``sparse``, for expensive
    solves, tries each size but the first with some of its nodes before all are solved: see :func:`_filled`.
    """
    ratios = ratios_of(poissons)
    known: list[dict[tuple[float, float], FloatArray]] = [{} for _ in ratios]
    table, error = None, np.inf
    used: set[tuple[float, float]] = set()
    grids = _grids(sizes, sparse=sparse)
    for number, (size, few) in enumerate(grids):
        places = _places(region, size, few=few)
        # The first table is never the last, so the nodes of the second are solved with its own.
        wanted = _places(region, grids[1][0], few=grids[1][1]) if number == 0 and len(grids) > 1 else places
        unknown = [place for place in dict.fromkeys(_image(region, p) for p in wanted) if place not in known[0]]
        for ratio, found in zip(ratios, known, strict=True):
            if unknown:
                found.update(zip(unknown, compliances(unknown, float(ratio)), strict=True))
        new = [place for place in dict.fromkeys(_image(region, p) for p in places) if place not in used]
        used.update(new)
        if table is not None:
            error = max(
                _error(table, (x, y), float(ratio), found[x, y][0]) * region.room(x, y)
                for ratio, found in zip(ratios, known, strict=True)
                for x, y in new
            )
        values = np.array([[_turned(region, place, found) for place in _places(region, size)] for found in known])
        table = _table(region, poissons, size, values)
        if error <= tolerance:
            break
    assert table is not None
    return table, float(error)


def counts(region: Region, sizes: Sequence[int] = _SIZES, *, sparse: bool = False) -> tuple[int, int]:
    """Return the least and the largest number of places that a table of :func:`tabulate` needs."""
    grids = _grids(sizes, sparse=sparse)
    least, most = (
        len({_image(region, place) for place in _places(region, n, few=few)}) for n, few in (grids[1], grids[-1])
    )
    return least, most


def _grids(sizes: Sequence[int], *, sparse: bool) -> list[tuple[int, bool]]:
    """Return the tables to try, in turn: the number of intervals, and whether only some of the nodes are solved."""
    return [(size, few) for n, size in enumerate(sizes) for few in ((True, False) if sparse and n else (False,))]


def ratios_of(poissons: tuple[float, float], count: int = _POISSONS) -> FloatArray:
    """Return ``count`` nodes of a range of Poisson's ratios; one if its ends are equal."""
    low, high = poissons
    return np.asarray((low + high) / 2 + (high - low) / 2 * (extrema(count - 1) if low < high else np.zeros(1)))


def _error(table: Table, place: tuple[float, float], poisson: float, c: float) -> float:
    """Return the error of a table for c at a place; infinite if the table has a pole there."""
    try:
        return abs(table.at(*place, poisson).c - c)
    except ArithmeticError:
        return np.inf


def _table(region: Region, poissons: tuple[float, float], size: int, values: FloatArray) -> Table:
    """Return the table through ``values`` (ν, places, 2 or 9)."""
    c, h, *others = np.moveaxis(values, -1, 0)
    c_ref = max(0.0, -float(np.nanmin(c))) + _ABOVE / region.thickness
    t = 1 / (c + c_ref)
    places = _places(region, size)
    plain = Table.none(region.reach, is_round=region.is_axial, even=region.even)
    factors = np.array([plain.factors(x, y) for x, y in places])

    def through(values: FloatArray, factor: FloatArray | None = None) -> FloatArray:
        if region.is_round and not region.is_axial:
            return _over_ratios(Disc(region.reach[0], region.even, size).through(places, values, factor))
        shape = (len(values), -1, size + 1)
        grid = values.reshape(shape)
        grid = _filled(grid)
        return _coefficients(grid) if factor is None else _divided(grid, factor.reshape(shape[1:]))

    tensors: list[FloatArray] = []
    for number, f in enumerate(others):
        power = 3 if number < _BENDS else 1
        twin = _TWINS.get(number) if region.is_axial else None
        tensors.append(through(f * t**power, factors[:, number]) if twin is None else tensors[twin])
    table = Table(through(t), through(h * t**3), c_ref, region.reach, region.is_round, poissons, region.even)
    return replace(table, tensors=np.array(tensors)) if tensors else table


def _divided(values: FloatArray, factor: FloatArray) -> FloatArray:
    """Return the coefficients of ``values`` (ν, v, u) over a ``factor``, which may be 0 at the last nodes."""
    kept = tuple(slice(None) if len(line) == 1 or line[-1] != 0 else slice(-1) for line in (factor[:, 0], factor[0]))
    smooth = values[:, kept[0], kept[1]] / factor[kept]
    found = np.zeros(values.shape)
    found[:, kept[0], kept[1]] = _coefficients(smooth, values.shape)
    return found


def _filled(values: FloatArray) -> FloatArray:
    """Return ``values`` (ν, v, u) with NaN replaced by sparse-grid interpolation (S. A. Smolyak, 1963).

    It uses the middle lines at full degree, and all nodes of half as many intervals at half the degree.
    """
    if not np.isnan(values).any():
        return values
    size = values.shape[-1] - 1
    middle = size // 2
    of_few = np.polynomial.chebyshev.chebvander(extrema(size), middle) @ _inverse(middle)
    few = values[:, ::2, ::2]
    few_u, few_v = few[:, middle // 2] @ of_few.T, few[:, :, middle // 2] @ of_few.T
    both = of_few @ few @ of_few.T - few_u[:, None, :] - few_v[:, :, None]
    return np.asarray(values[:, middle, None, :] + values[:, :, middle, None] + both)


def _places(region: Region, size: int, *, few: bool = False) -> Places:
    """Return the places of the nodes, x fastest; with ``few``, those of the sparse grid of :func:`_filled`."""
    if region.is_round and not region.is_axial:
        return Disc(region.reach[0], region.even, size).places
    x, y = (reach * shares(size, even) for reach, even in zip(region.reach, region.even, strict=True))
    ys = [0.0] if region.is_round else y.tolist()
    return [
        (round(a, _DIGITS), round(b, _DIGITS))
        for j, b in enumerate(ys)
        for i, a in enumerate(x.tolist())
        if not few or size // 2 in (i, j) or i % 2 == j % 2 == 0
    ]


def _image(region: Region, place: tuple[float, float]) -> tuple[float, float]:
    """Return the place that represents ``place`` and its image on a square face."""
    x, y = place
    return (max(x, y), min(x, y)) if region.is_square and not region.is_round else place


def _turned(region: Region, place: tuple[float, float], found: Mapping[tuple[float, float], FloatArray]) -> FloatArray:
    """Return the values at a place, or those of its image on a square face, exchanged."""
    image = _image(region, place)
    values = found.get(image)
    if values is None:
        return np.full(len(next(iter(found.values()))), np.nan)
    if image == place or len(values) < len(_SWAPPED):
        return values
    return values[_SWAPPED] * _SIGNS


def shares(size: int, even: bool) -> FloatArray:
    """Return the nodes along a direction, in units of the reach."""
    return np.asarray(np.sqrt((extrema(size) + 1) / 2)) if even else extrema(size)


def extrema(size: int) -> FloatArray:
    """Return the extrema of T_size, from 1 to -1."""
    return np.asarray(np.cos(np.pi * np.arange(size + 1) / size))


def _coefficients(values: FloatArray, nodes: tuple[int, ...] | None = None) -> FloatArray:
    """Return the Chebyshev coefficients of values at the first of ``nodes`` along each direction, or at all nodes."""
    for axis, (count, of) in enumerate(zip(values.shape, nodes or values.shape, strict=True)):
        if count > 1:
            values = np.moveaxis(np.tensordot(_inverse(of - 1, count), values, (1, axis)), 0, axis)
    return values


def _over_ratios(values: FloatArray) -> FloatArray:
    """Return the Chebyshev coefficients over ν of ``values`` (ν, ...) at the ratios."""
    return np.tensordot(_inverse(len(values) - 1), values, 1) if len(values) > 1 else values


def _inverse(size: int, count: int | None = None) -> FloatArray:
    """Return the matrix from values at the first ``count`` nodes, or at all, to coefficients."""
    count = size + 1 if count is None else count
    return np.asarray(np.linalg.inv(np.polynomial.chebyshev.chebvander(extrema(size)[:count], count - 1)))
