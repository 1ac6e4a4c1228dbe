"""Facets of a surface that cross or overlap."""

from fractions import Fraction
from functools import cache
from typing import TypeVar

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray

Number = TypeVar("Number", float, Fraction)
_Exact = tuple[Fraction, Fraction, Fraction]

# Most pairs that are tested exactly, 1 ms each: a surface with more has real crossings.
_MOST = 2000
# The sign of a volume is certain in floating point above this share of the cube of a facet's extent.
_SURE = 1e-9


def crossings(points: FloatArray, facets: IntArray) -> IntArray:
    """Return the pairs (n, 2) of facets that share more than their common corners and edges.

    Facets that touch count. Rational arithmetic confirms each pair that libigl finds. Facets with a common edge cross
    if they are folded onto each other, within floating point.
    """
    _make_exact()
    pairs = _search(points, facets)
    # libigl's predicates rely on constants and on a rounding mode set at the start of a process. After other libraries
    # had changed these, facets of a good surface were reported as crossing.
    doubtful = np.array([len({*facets[i]} & {*facets[j]}) < 2 for i, j in pairs], dtype=bool)
    doubtful[doubtful] = ~_surely_cross(points[facets[pairs[doubtful]]])
    again = np.flatnonzero(doubtful)[:_MOST]
    wrong = [number for number in again if not _do_cross(*points[facets[pairs[number]]])]
    return np.delete(pairs, wrong, axis=0)


@cache
def _make_exact() -> None:
    """Set the constants of the exact predicates, which may be unset in threads that search for the first time."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.25, 0.25, -1], [0.25, 0.25, 1], [2, 2, 0]], dtype=float)
    assert len(_search(corners, np.array([[0, 1, 2], [3, 4, 5]]))) == 1


def _search(points: FloatArray, facets: IntArray) -> IntArray:
    from igl.predicates import find_self_intersections  # noqa: PLC0415 (only for studies with files)

    _, pairs, _ = find_self_intersections(np.ascontiguousarray(points), np.ascontiguousarray(facets))
    pairs = pairs.reshape(-1, 2)
    return pairs[np.lexsort(pairs.T[::-1])]  # threads return them in arbitrary order


def _surely_cross(corners: FloatArray) -> BoolArray:
    """Return a mask of pairs of triangles (n, 2, 3, 3) that cross by more than rounding: an edge pierces the other."""
    found = np.zeros(len(corners), dtype=bool)
    least = _SURE * np.ptp(corners, axis=(1, 2)).max(axis=1, initial=0.0) ** 3
    for one, other in ((0, 1), (1, 0)):
        a, b, c = np.moveaxis(corners[:, one], 1, 0)
        for k in range(3):
            p, q = corners[:, other, k], corners[:, other, (k + 1) % 3]
            sides = np.stack([_volume(p, a, b, c), -_volume(q, a, b, c)])
            turns = np.stack([_volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)])
            found |= _same_sign(sides, least) & _same_sign(turns, least)
    return found


def _volume(p: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    volumes: FloatArray = np.einsum("ij,ij->i", a - p, np.cross(b - p, c - p))
    return volumes


def _same_sign(values: FloatArray, least: FloatArray) -> BoolArray:
    return np.asarray((values > least).all(axis=0) | (values < -least).all(axis=0))


def _do_cross(one: FloatArray, other: FloatArray) -> bool:
    """Return, in rational arithmetic, whether two triangles (3, 3) share anything but equal corners."""
    corners, polygon = ([(Fraction(x), Fraction(y), Fraction(z)) for x, y, z in part.tolist()] for part in (one, other))
    shared = {*corners} & {*polygon}
    a, b, c = corners
    normal = cross(less(b, a), less(c, a))
    polygon = _clipped(polygon, normal, a)
    polygon = _clipped(polygon, less((Fraction(),) * 3, normal), a)
    for start, end in ((a, b), (b, c), (c, a)):
        polygon = _clipped(polygon, cross(normal, less(end, start)), start)
    return not {*polygon} <= shared


def _clipped(polygon: list[_Exact], inward: _Exact, place: _Exact) -> list[_Exact]:
    """Return the part of a convex ``polygon`` on the ``inward`` side of the plane through ``place``."""
    heights = [dot(inward, less(point, place)) for point in polygon]
    kept = []
    for i, (point, height) in enumerate(zip(polygon, heights, strict=True)):
        before, lower = polygon[i - 1], heights[i - 1]
        if height * lower < 0:
            share = lower / (lower - height)
            x, y, z = (p + share * (q - p) for p, q in zip(before, point, strict=True))
            kept.append((x, y, z))
        if height >= 0:
            kept.append(point)
    return kept


def less(a: tuple[Number, Number, Number], b: tuple[Number, Number, Number]) -> tuple[Number, Number, Number]:
    """Return a - b; numpy would be slower for single vectors, and has no fractions."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: tuple[Number, Number, Number], b: tuple[Number, Number, Number]) -> Number:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: tuple[Number, Number, Number], b: tuple[Number, Number, Number]) -> tuple[Number, Number, Number]:
    """Return a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
