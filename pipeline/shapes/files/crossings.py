"""Facets of a surface that cross or lie upon each other."""

from pipeline.shapes.arrays import FloatArray, IntArray, np


def crossings(points: FloatArray, facets: IntArray) -> IntArray:
    """Return the pairs (n, 2) of facets that have more in common than the corners and edges they share.

    Decided exactly, in whatever floating point leaves open: facets that touch count.
    """
    from igl.predicates import find_self_intersections  # noqa: PLC0415 (studies without files do without)

    _, pairs, _ = find_self_intersections(np.ascontiguousarray(points), np.ascontiguousarray(facets))
    return pairs.reshape(-1, 2)
