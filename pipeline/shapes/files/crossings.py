"""Facets of a surface that cross or lie upon each other."""

from functools import cache

from pipeline.shapes.arrays import FloatArray, IntArray, np


def crossings(points: FloatArray, facets: IntArray) -> IntArray:
    """Return the pairs (n, 2) of facets that have more in common than the corners and edges they share.

    Decided exactly, in whatever floating point leaves open: facets that touch count.
    """
    _make_exact()
    return _search(points, facets)


@cache
def _make_exact() -> None:
    """Set the constants of the exact predicates, which threads that search for the first time may find unset."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.25, 0.25, -1], [0.25, 0.25, 1], [2, 2, 0]], dtype=float)
    assert len(_search(corners, np.array([[0, 1, 2], [3, 4, 5]]))) == 1


def _search(points: FloatArray, facets: IntArray) -> IntArray:
    from igl.predicates import find_self_intersections  # noqa: PLC0415 (studies without files do without)

    _, pairs, _ = find_self_intersections(np.ascontiguousarray(points), np.ascontiguousarray(facets))
    pairs = pairs.reshape(-1, 2)
    return pairs[np.lexsort(pairs.T[::-1])]  # threads find them in any order
