"""The nodes of a facet: where they are, their shape functions, and the shares of a uniform pressure."""

from dataclasses import dataclass
from functools import cache, cached_property

import basix
import numpy as np

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray

FACET_CORNERS = 3
# Corners of the facet opposite to each corner of the reference tetrahedron, and an equilateral facet.
_OPPOSITE = [[j for j in range(4) if j != i] for i in range(4)]
_EQUILATERAL = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.75**0.5]])


@dataclass(frozen=True, eq=False)
class FacetNodes:
    """The k nodes of a facet, corners first.

    ``places`` (4, k) are their numbers within a cell, for each of its facets, ``corners`` (k, 3) their barycentric
    coordinates. ``boundary`` are the nodes along the edges, in order; ``edges`` (3, ·) those of each edge, its two ends
    first. ``weights`` (k) are the nodal shares of a uniform pressure.
    """

    degree: int
    places: IntArray
    corners: FloatArray
    boundary: IntArray
    edges: IntArray
    weights: FloatArray

    @property
    def facets_per_node(self) -> FloatArray:
        """Number of facets that share each node (k): one inside, two on an edge, about six at a corner."""
        found = np.ones(len(self.corners))
        found[self.boundary] = 2.0
        found[:FACET_CORNERS] = 6.0
        return found

    def distances(self, other: "FacetNodes") -> FloatArray:
        """Return the distances (k, l) to the nodes of another degree, in edge lengths of an equilateral facet."""
        own, others = self.corners @ _EQUILATERAL, other.corners @ _EQUILATERAL
        return np.asarray(np.linalg.norm(own[:, None] - others[None], axis=2))

    def values(self, points: FloatArray) -> FloatArray:
        """Return the shape functions at points (q, 3) in barycentric coordinates, (q, k)."""
        return np.asarray(_monomials(self.degree, points) @ self._coefficients)

    def slopes(self, points: FloatArray) -> FloatArray:
        """Return the derivatives (2, q, k) of the shape functions at points (q, 3), along the two sides at the first
        corner."""
        powers, coefficients = _powers(self.degree), self._coefficients
        along = [
            _monomials(self.degree, points, powers - one) * powers[:, i] for i, one in enumerate(np.eye(3, dtype=int))
        ]
        return np.array([(side - along[0]) @ coefficients for side in along[1:]])

    def normals(self, x: FloatArray) -> FloatArray:
        """Return the cross products (m, k, 3) of the sides of m facets with nodes ``x`` (m, k, 3), at their nodes."""
        first, second = (np.einsum("qk,mkx->mqx", slopes, x) for slopes in self._slopes)
        return np.cross(first, second)

    @cached_property
    def _slopes(self) -> FloatArray:
        """The derivatives (2, k, k) at the nodes."""
        return self.slopes(self.corners)

    @cached_property
    def _coefficients(self) -> FloatArray:
        """The shape functions as sums of monomials."""
        return np.asarray(np.linalg.inv(_monomials(self.degree, self.corners)))


def _powers(degree: int) -> IntArray:
    return np.array([(i, j, degree - i - j) for i in range(degree + 1) for j in range(degree + 1 - i)])


def _monomials(degree: int, points: FloatArray, powers: IntArray | None = None) -> FloatArray:
    """Return all monomials of ``degree``, or those with given ``powers``, in barycentric coordinates (q, 3)."""
    powers = _powers(degree) if powers is None else np.maximum(powers, 0)
    return np.prod(points[:, None, :] ** powers[None], axis=2)


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
