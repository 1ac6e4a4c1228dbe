"""The nodes of a tetrahedron's facet, by degree: where they are, and how much of an even pressure each carries."""

from dataclasses import dataclass
from functools import cache

import basix
import numpy as np

from pipeline import compat
from pipeline.arrays import FloatArray, IntArray

FACET_CORNERS = 3
# The corners of a reference tetrahedron's facet that is opposite to each of its own, and an equilateral facet.
_OPPOSITE = [[j for j in range(4) if j != i] for i in range(4)]
_EQUILATERAL = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75**0.5]])


@dataclass(frozen=True, eq=False)
class FacetNodes:
    """The k nodes of a facet, corners first.

    ``places`` (4, k) are their numbers in a cell, for each of its facets, ``corners`` (k, 3) their barycentric
    coordinates. ``boundary`` are the nodes on the edges, once round; ``edges`` (3, ·) those of each edge, its two ends
    first. ``weights`` (k) are the shares of an even pressure.
    """

    degree: int
    places: IntArray
    corners: FloatArray
    boundary: IntArray
    edges: IntArray
    weights: FloatArray

    @property
    def facets_per_node(self) -> FloatArray:
        """How many facets have each node (k): inside one, two beside an edge, and six round a corner or so."""
        found = np.ones(len(self.corners))
        found[self.boundary] = 2.0
        found[:FACET_CORNERS] = 6.0
        return found

    def distances(self, other: "FacetNodes") -> FloatArray:
        """Return the distances (k, l) to the nodes of another degree, in lengths of an edge of an even facet."""
        here, there = self.corners @ _EQUILATERAL, other.corners @ _EQUILATERAL
        return np.asarray(np.linalg.norm(here[:, None] - there[None], axis=2))

    def values(self, points: FloatArray) -> FloatArray:
        """Return the nodes' functions at points (q, 3) in barycentric coordinates, (q, k)."""
        return np.asarray(np.linalg.solve(_monomials(self.degree, self.corners).T, _monomials(self.degree, points).T).T)


def _monomials(degree: int, points: FloatArray) -> FloatArray:
    """Return all monomials of ``degree`` in barycentric coordinates at points (q, 3)."""
    powers = [(i, j, degree - i - j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.prod(points[:, None, :] ** np.array(powers)[None], axis=2)


@cache
def facet_nodes(degree: int) -> FacetNodes:
    """Return the nodes of ``degree``."""
    element = compat.reference_element(degree)
    points = np.column_stack([1 - element.points.sum(axis=1), element.points])  # barycentric
    found = [np.array(element.entity_closure_dofs[2][side]) for side in range(4)]
    first = points[found[0]][:, _OPPOSITE[0]]
    first = first[np.lexsort([*first.T, -first.max(axis=1)])]
    first[:FACET_CORNERS] = np.eye(FACET_CORNERS)
    places = np.empty((4, len(first)), dtype=np.int64)
    for side, (dofs, corners) in enumerate(zip(found, _OPPOSITE, strict=True)):
        away = np.abs(points[dofs][:, corners][:, None] - first[None]).max(axis=2)
        places[side] = dofs[away.argmin(axis=0)]
    angle = np.arctan2(*((first - 1 / 3) @ _EQUILATERAL).T[::-1])
    on_edge = np.flatnonzero(first.min(axis=1) < 1e-9)
    edges = [np.flatnonzero(first[:, opposite] < 1e-9) for opposite in range(FACET_CORNERS)]
    rule, shares = basix.make_quadrature(basix.CellType.triangle, 2 * degree)
    inside = np.column_stack([rule, np.zeros(len(rule))])  # the facet opposite to the last corner
    values = np.asarray(element.tabulate(0, inside)[0, :, :, 0])
    weights = 2 * shares @ values[:, places[3]]
    weights[np.abs(weights) < 1e-12] = 0.0
    return FacetNodes(degree, places, first, on_edge[np.argsort(angle[on_edge])], np.array(edges), weights)
