"""Candidate nodes: the part of a body's surface that may be touched, its facets and nodes, equal on every rank.

What may touch it is the tool, and the surface that the body rests on, if that lets go: each has facets of its own.

The active set is decided for all ranks at once. Candidates are a few thousand at most, and each rank stores them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.scene.model import PROBE
from epsmesh.solve.contact.facets import FACET_CORNERS, FacetNodes, facet_nodes
from epsmesh.solve.physics import of_regions
from epsmesh.solve.spaces import shown_places


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Corners of facets: a mask ``is_corner`` (n), and pairs ``beside`` (k, 2) of a corner and a node next to it.

    A uniform pressure on quadratic facets has nodal forces at their mid nodes only: a corner's reaction means nothing.
    Such corners are ``followers`` (n), active where all nodes beside them are. (On 45 meshes F of balls and cones is
    nearer to the meridian's in this way than with corners that enter and leave by their own gap and reaction, too.)
    """

    is_corner: BoolArray
    beside: IntArray
    followers: BoolArray

    def complete(self, active: BoolArray) -> BoolArray:
        """Return the ``active`` nodes (n) with followers where these belong."""
        return np.where(self.followers, self.enclosed(active), active)

    def enclosed(self, active: BoolArray) -> BoolArray:
        """Return a mask (n) of corners whose neighbours are all active."""
        corner, beside = self.beside.T
        has = np.bincount(corner, minlength=len(active)) > 0
        return np.asarray(has & (np.bincount(corner, ~active[beside], len(active)) == 0))

    def of(self, nodes: IntArray) -> "Neighbours":
        """Return those of some ``nodes`` alone."""
        position = np.full(len(self.is_corner), -1)
        position[nodes] = np.arange(len(nodes))
        pairs = position[self.beside]
        return Neighbours(self.is_corner[nodes], pairs[(pairs >= 0).all(axis=1)], self.followers[nodes])

    def majority(self, chosen: BoolArray, active: BoolArray) -> BoolArray:
        """Return ``chosen`` (n), at corners the choice of most of their ``active`` neighbours, true if it is even."""
        corner, beside = self.beside.T
        votes = np.bincount(corner, np.where(chosen[beside], 1.0, -1.0) * active[beside], len(chosen))
        return np.where(self.is_corner, votes >= 0, chosen)

    def sums(self, vectors: FloatArray, chosen: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return ``vectors`` (n, t) and their sizes (n), at corners the sums of those of the ``chosen`` neighbours."""
        corner, beside = self.beside.T
        own, kept = np.linalg.norm(vectors, axis=1), chosen[beside]
        total, sizes = np.where(self.is_corner[:, None], 0.0, vectors), np.where(self.is_corner, 0.0, own)
        np.add.at(total, corner, np.where(kept[:, None], vectors[beside], 0.0))
        np.add.at(sizes, corner, np.where(kept, own[beside], 0.0))
        return total, sizes


# A point counts as in a plane of symmetry within this distance, in units of the candidates' extent.
_IN_PLANE = 1e-9
# Nodes of two degrees are neighbours within this share of an edge, divided by p; mid nodes are included.
_NEAR = 0.6
# The degree whose facets have no force of a pressure at their corners.
_FOLLOWING = 2


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate nodes of one degree, and the facets between them; equal on every rank.

    ``numbers`` (n) are the nodes' global numbers (blocks) in the space, ``points`` (n, 3), m, are on the shape that the
    study gives. ``facets`` (m, k) index the nodes, in the order of ``shape``; candidates of all degrees on a mesh have
    the same facets. ``is_edge`` (n) marks nodes on the boundary of the candidates, planes of symmetry aside.
    ``regions`` (m) are those of the tissue below the facets, ``factors`` (m) those of its energy. Only
    ``local_facets`` (m) differ by rank: the facets' numbers there, −1 for facets of others. ``contacts`` (m) are the
    numbers of what may touch the facets, 0 of the tool; None if that is the tool alone.
    """

    numbers: IntArray
    points: FloatArray
    facets: IntArray
    shape: FacetNodes
    is_edge: BoolArray
    regions: IntArray
    factors: FloatArray
    local_facets: Int32Array
    contacts: IntArray | None = None

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def is_corner(self) -> BoolArray:
        """Mask of the nodes that are corners of facets (n)."""
        return self._marked(self.facets[:, :FACET_CORNERS])

    @cached_property
    def areas(self) -> FloatArray:
        """The areas of the facets (m², normal to the probe's axis), (m)."""
        x, y = np.moveaxis(self.points[self.facets[:, self.shape.boundary], :2], 2, 0)
        doubled = x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)
        return np.asarray(np.abs(doubled.sum(axis=1)) / 2)

    @cached_property
    def weights(self) -> FloatArray:
        """Nodal forces of a uniform unit pressure, i.e. areas (m²), (n): zero at corners in degree 2."""
        return np.asarray(np.bincount(self.facets.ravel(), np.outer(self.areas, self.shape.weights).ravel(), len(self)))

    @cached_property
    def widths(self) -> FloatArray:
        """Sides (m) of squares with the area of each node, (n); planes of symmetry are accounted for."""
        shares = np.outer(self.areas, self.shape.weights * self.shape.facets_per_node).ravel()
        count = np.bincount(self.facets.ravel(), minlength=len(self))
        # Shares of degree 4 are negative in the middle of edges.
        return np.asarray(np.sqrt(np.maximum(np.bincount(self.facets.ravel(), shares, len(self)), 0.0) / count))

    def size_of(self, forces: FloatArray) -> float:
        """Return the integral (N) of the size of the traction with nodal ``forces`` (n, d); see :func:`size_of`."""
        return size_of(forces, self.facets, self.areas)

    def from_regions(self, values: Sequence[float]) -> FloatArray:
        """Return moduli, ``values`` by region, as values of the nodes (n), from the tissue below their facets."""
        found = np.empty(len(self))
        found[self.facets] = self.of_facets(values)[:, None]
        return found

    def of_facets(self, values: Sequence[float]) -> FloatArray:
        """Return moduli, ``values`` by region, as values of the facets (m), from the tissue below."""
        return self.factors * of_regions(values, self.regions, len(self.facets))

    def bordering(self, active: BoolArray) -> BoolArray:
        """Return a mask (n) of nodes that share a facet with both active and inactive nodes; corners do not count."""
        inner = active[self.facets[:, FACET_CORNERS:]]
        return self._marked(self.facets[inner.any(axis=1) & ~inner.all(axis=1)])

    def closed(self, active: BoolArray) -> BoolArray:
        """Return a mask (m) of facets whose nodes, corners aside, are all active."""
        return np.asarray(active[self.facets[:, FACET_CORNERS:]].all(axis=1))

    def held_facets(self, active: BoolArray) -> Int32Array:
        """Return the local numbers of the closed facets on this rank."""
        return self.local_facets[self.closed(active) & (self.local_facets >= 0)]

    def raised(self, active: BoolArray, higher: "Candidates") -> BoolArray:
        """Return the initial guess in a ``higher`` degree: its nodes near an active node."""
        pairs = self._near(higher)
        return higher._marked(pairs[active[pairs[:, 0]], 1])

    def raised_by(self, active: BoolArray, higher: "Candidates", bounds: FloatArray) -> BoolArray:
        """Return the same with the area of the ``active`` nodes, for a tool at heights ``bounds`` (m) above the nodes.

        Nodes near both active and inactive nodes belong to it where the tool is deepest.
        """
        near, sure = self.raised(active, higher), ~self.raised(~active, higher)
        edge = np.flatnonzero(near & ~sure)
        edge = edge[np.argsort(bounds[edge], kind="stable")]
        area = higher.weights[near & sure].sum() + np.cumsum(higher.weights[edge])
        near[edge[area > self.weights[active].sum()]] = False
        return near

    def lowered(self, active: BoolArray, lower: "Candidates") -> BoolArray:
        """Return the nodes of a ``lower`` degree next to an active node.

        A coarse node that is free among active ones is too soft: its corrections are cut off at them.
        """
        near, this = lower._near(self).T
        return lower._marked(near[active[this]])

    def at(self, place: tuple[float, float], values: FloatArray) -> float:
        """Return the value at a ``place`` (m), x and y, of nodal ``values`` (n), in the facet there or nearest."""
        corners = self.points[self.facets[:, :FACET_CORNERS], :2]
        first, sides = corners[:, 0], np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)
        shares = np.linalg.solve(sides, (np.array(place) - first)[:, :, None])[:, :, 0]
        shares = np.column_stack([1 - shares.sum(axis=1), shares])
        facet = int(shares.min(axis=1).argmax())
        return float((self.shape.values(shares[facet][None]) @ values[self.facets[facet]])[0])

    def _near(self, higher: "Candidates") -> IntArray:
        """Return pairs (k, 2) of a node and a neighbouring node of a ``higher`` degree, each once."""
        near = np.argwhere(self.shape.distances(higher.shape) < _NEAR / self.shape.degree)
        pairs = [np.column_stack([self.facets[:, i], higher.facets[:, j]]) for i, j in near]
        return np.unique(np.concatenate(pairs), axis=0)

    @cached_property
    def neighbours(self) -> Neighbours:
        """The corners, and the nodes beside them."""
        near = np.argwhere(self.shape.distances(self.shape)[:FACET_CORNERS] < 0.5 + 1e-9)
        pairs = [self.facets[:, (i, j)] for i, j in near if i != j]
        beside = np.unique(np.concatenate(pairs), axis=0) if pairs else np.empty((0, 2), dtype=np.int64)
        return Neighbours(self.is_corner, beside, self.is_corner & (self.shape.degree == _FOLLOWING))

    def _marked(self, nodes: IntArray) -> BoolArray:
        found = np.zeros(len(self), dtype=bool)
        found[nodes] = True
        return found


def size_of(forces: FloatArray, facets: IntArray, areas: FloatArray) -> float:
    """Return the integral (N) of the size of the traction with nodal ``forces`` (n, d) on ``facets`` (m, k).

    Facets share their nodes' forces by their ``areas`` (m). Nodal forces alternate beside an edge where the traction is
    singular: their own sizes add up to as much as three times the integral.
    """
    around = np.bincount(facets.ravel(), np.repeat(areas, facets.shape[1]), len(forces))
    shares = areas[:, None] / around[facets]
    return float(np.linalg.norm(np.einsum("mk,mkd->md", shares, forces[facets]), axis=1).sum())


def find_candidates(
    body: BodyMesh, space: Any, factors: FloatArray | None = None, groups: Sequence[str] = (PROBE,)
) -> Candidates:
    """Return the nodes of ``space`` on ``groups`` of facets of ``body``, one for each contact; collective.

    ``factors`` are those of local cells.
    """
    topology, tdim = body.mesh.topology, body.mesh.topology.dim
    facets = np.concatenate([body.facets[group] for group in groups])
    contact = np.repeat(np.arange(len(groups)), [len(body.facets[group]) for group in groups])
    topology.create_connectivity(tdim, tdim - 1)
    topology.create_connectivity(tdim - 1, tdim)
    of_facet, of_cell = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    cell = of_facet.array[of_facet.offsets[facets]]
    here = cell < body.owned_cells
    facets, contact, cell = facets[here], contact[here], cell[here]
    side = np.argmax(of_cell.array.reshape(-1, tdim + 1)[cell] == facets[:, None], axis=1)
    shape = facet_nodes(compat.degree(space))
    dofs = np.take_along_axis(compat.cell_dofs(space)[cell], shape.places[side], axis=1)
    x = shown_places(body, space)[dofs]
    regions = np.zeros(len(cell), dtype=np.int64) if body.regions is None else body.regions[cell]
    own = np.ones(len(cell)) if factors is None else factors[cell]
    parts = _global(space, dofs), x, regions, own, contact
    numbers, points, regions, own, contact = (np.concatenate(body.comm.allgather(part)) for part in parts)
    local = np.full(len(numbers), -1, dtype=np.int32)
    first = body.mesh.comm.scan(len(facets)) - len(facets)
    local[first : first + len(facets)] = facets
    found = _assembled(body, numbers, points, shape, (regions, own), local)
    return found if len(groups) == 1 else replace(found, contacts=contact)


def _assembled(
    body: BodyMesh,
    of_facets: IntArray,
    x: FloatArray,
    shape: FacetNodes,
    below: tuple[IntArray, FloatArray],
    local: Int32Array,
) -> Candidates:
    """Number the nodes of the facets of all ranks, in an order independent of the number of ranks.

    ``below`` are regions and factors of the tissue below the facets.
    """
    _, first = np.unique(of_facets, return_index=True)
    points = x.reshape(-1, 3)[first]
    order = np.lexsort(points.T)
    numbers, points = of_facets.ravel()[first[order]], points[order]
    rank = np.argsort(numbers)
    facets = rank[np.searchsorted(numbers[rank], of_facets)]
    is_edge = _edge(body, points, facets, shape)
    return Candidates(numbers, points, facets, shape, is_edge, *below, local)


def _edge(body: BodyMesh, points: FloatArray, facets: IntArray, shape: FacetNodes) -> BoolArray:
    """Return a mask of nodes on the boundary of the facets, planes of symmetry aside."""
    is_edge = np.zeros(len(points), dtype=bool)
    edges = np.concatenate([facets[:, edge] for edge in shape.edges])
    _, which, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True)
    single = edges[count[which.ravel()] == 1]
    extent = np.abs(points[:, :2]).max()
    for axis in body.mirrored:
        single = single[np.abs(points[single, axis]).max(axis=1) > _IN_PLANE * extent]
    is_edge[single] = True
    return is_edge


def _global(space: Any, dofs: IntArray) -> IntArray:
    numbers = space.dofmap.index_map.local_to_global(dofs.ravel().astype(np.int32))
    return np.asarray(numbers, dtype=np.int64).reshape(dofs.shape)
