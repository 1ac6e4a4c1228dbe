"""The part of a body's surface that a probe may touch: its facets and their nodes, the same on every rank.

Contact is decided node by node for all ranks at once: they are a few thousand at most, and each rank holds them all.
"""

from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.scene.model import PROBE
from pipeline.solve.compiled import global_sum
from pipeline.solve.contact.facet import FACET_CORNERS, FacetNodes, facet_nodes
from pipeline.solve.elements import elements_of
from pipeline.solve.elements.base import Elements
from pipeline.solve.spaces import Conditions, Spaces

# What is held is the contact set's alone; of the footprint as such nothing is.
CONDITIONS = Conditions(bonded=False, unilateral=True)
# A point nearer to a plane of symmetry than this, in units of the candidates' extent, is in it.
_IN_PLANE = 1e-9
# Nodes of another degree are near those of degree p within this share of an edge, divided by p: its mid nodes, too.
_NEAR = 0.6


@dataclass(frozen=True, eq=False)
class Candidates:
    """Nodes of one degree that may touch, and the facets between them; equal on every rank.

    ``numbers`` (n) are the nodes' global numbers (blocks) in the space, ``points`` (n, 3) are in m. ``facets`` (m, k)
    index the nodes, in the order of ``shape``; candidates of another degree on the same mesh have the same facets.
    ``is_edge`` (n) tells which nodes bound the candidates, planes of symmetry aside. ``regions`` (m) are those of the
    tissue below the facets. ``local_facets`` (m) alone differ: the numbers of facets on this rank, −1 of those of
    others.
    """

    numbers: IntArray
    points: FloatArray
    facets: IntArray
    shape: FacetNodes
    is_edge: BoolArray
    regions: IntArray
    local_facets: Int32Array

    def __len__(self) -> int:
        return len(self.numbers)

    @cached_property
    def is_corner(self) -> BoolArray:
        """Which nodes are corners of facets (n)."""
        return self._marked(self.facets[:, :FACET_CORNERS])

    @cached_property
    def areas(self) -> FloatArray:
        """The areas of the facets (m², normal to the probe's axis), (m)."""
        x, y = np.moveaxis(self.points[self.facets[:, self.shape.boundary], :2], 2, 0)
        doubled = x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)
        return np.asarray(np.abs(doubled.sum(axis=1)) / 2)

    @cached_property
    def weights(self) -> FloatArray:
        """The areas (m²) of which an even pressure acts on each node, (n): on corners of degree 2 it does not."""
        return np.asarray(np.bincount(self.facets.ravel(), np.outer(self.areas, self.shape.weights).ravel(), len(self)))

    @cached_property
    def widths(self) -> FloatArray:
        """The sides of squares as large as the area of each node (m), in a plane of symmetry, too; (n)."""
        shares = np.outer(self.areas, self.shape.weights * self.shape.facets_per_node).ravel()
        count = np.bincount(self.facets.ravel(), minlength=len(self))
        return np.asarray(np.sqrt(np.bincount(self.facets.ravel(), shares, len(self)) / count))

    def enclosed(self, active: BoolArray) -> BoolArray:
        """Tell of each corner whether all nodes next to it on its edges are active; (n)."""
        if self.shape.degree == 1:
            return np.zeros(len(self), dtype=bool)
        corner, beside = self._beside_corners.T
        return np.asarray((np.bincount(corner, ~active[beside], len(self)) == 0) & self.is_corner)

    def bordering(self, active: BoolArray) -> BoolArray:
        """Tell which nodes share a facet with active and with other nodes, corners not counted; (n)."""
        inner = active[self.facets[:, FACET_CORNERS:]]
        return self._marked(self.facets[inner.any(axis=1) & ~inner.all(axis=1)])

    def closed(self, active: BoolArray) -> BoolArray:
        """Tell of which facets all nodes but the corners are active; (m)."""
        return np.asarray(active[self.facets[:, FACET_CORNERS:]].all(axis=1))

    def held_facets(self, active: BoolArray) -> Int32Array:
        """Return the local numbers of the facets on this rank that are closed."""
        return self.local_facets[self.closed(active) & (self.local_facets >= 0)]

    def raised(self, active: BoolArray, higher: "Candidates") -> BoolArray:
        """Return the nodes of a ``higher`` degree that active ones suggest: those near one of them."""
        pairs = self._near(higher)
        return higher._marked(pairs[active[pairs[:, 0]], 1])

    def lowered(self, active: BoolArray, lower: "Candidates") -> BoolArray:
        """Return the nodes of a ``lower`` degree round which most nodes are active."""
        near, this = lower._near(self).T
        return np.asarray(np.bincount(near, np.where(active[this], 1.0, -1.0), len(lower)) > 0)

    def _near(self, higher: "Candidates") -> IntArray:
        """Return nodes and those of a ``higher`` degree that are near them, (k, 2), each pair once."""
        near = np.argwhere(self.shape.distances(higher.shape) < _NEAR / self.shape.degree)
        pairs = [np.column_stack([self.facets[:, i], higher.facets[:, j]]) for i, j in near]
        return np.unique(np.concatenate(pairs), axis=0)

    @cached_property
    def _beside_corners(self) -> IntArray:
        near = np.argwhere(self.shape.distances(self.shape)[:FACET_CORNERS] < 0.5 + 1e-9)
        pairs = [self.facets[:, (i, j)] for i, j in near if i != j]
        return np.unique(np.concatenate(pairs), axis=0)

    def _marked(self, nodes: IntArray) -> BoolArray:
        found = np.zeros(len(self), dtype=bool)
        found[nodes] = True
        return found


def find_candidates(body: BodyMesh, space: Any) -> Candidates:
    """Return the nodes of ``space`` in the footprint of ``body``; collective."""
    topology, tdim = body.mesh.topology, body.mesh.topology.dim
    facets = body.facets[PROBE]
    topology.create_connectivity(tdim, tdim - 1)
    topology.create_connectivity(tdim - 1, tdim)
    of_facet, of_cell = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    cell = of_facet.array[of_facet.offsets[facets]]
    facets, cell = facets[cell < body.owned_cells], cell[cell < body.owned_cells]
    side = np.argmax(of_cell.array.reshape(-1, tdim + 1)[cell] == facets[:, None], axis=1)
    shape = facet_nodes(compat.degree(space))
    dofs = np.take_along_axis(compat.cell_dofs(space)[cell], shape.places[side], axis=1)
    x = np.asarray(space.tabulate_dof_coordinates())[dofs]
    regions = np.zeros(len(cell), dtype=np.int64) if body.regions is None else body.regions[cell]
    numbers, points, regions = (
        np.concatenate(body.comm.allgather(part)) for part in (_global(space, dofs), x, regions)
    )  # fmt: skip
    local = np.full(len(numbers), -1, dtype=np.int32)
    first = body.mesh.comm.scan(len(facets)) - len(facets)
    local[first : first + len(facets)] = facets
    return _assembled(body, numbers, points, shape, regions, local)


def _assembled(
    body: BodyMesh, of_facets: IntArray, x: FloatArray, shape: FacetNodes, regions: IntArray, local: Int32Array
) -> Candidates:
    """Number the nodes of facets of all ranks, in an order that does not depend on how many there are."""
    _, first = np.unique(of_facets, return_index=True)
    points = x.reshape(-1, 3)[first]
    order = np.lexsort(points.T)
    numbers, points = of_facets.ravel()[first[order]], points[order]
    rank = np.argsort(numbers)
    facets = rank[np.searchsorted(numbers[rank], of_facets)]
    is_edge = _edge(body, points, facets, shape)
    return Candidates(numbers, points, facets, shape, is_edge, regions, local)


def _edge(body: BodyMesh, points: FloatArray, facets: IntArray, shape: FacetNodes) -> BoolArray:
    """Tell which nodes bound the facets, planes of symmetry aside."""
    is_edge = np.zeros(len(points), dtype=bool)
    edges = np.concatenate([facets[:, edge] for edge in shape.edges])
    _, which, count = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True)
    single = edges[count[which.ravel()] == 1]
    extent = np.abs(points[:, :2]).max()
    for axis in body.mirrored:
        single = single[np.abs(points[single, axis]).max(axis=1) > _IN_PLANE * extent]
    is_edge[single] = True
    return is_edge


class Surface:
    """The elements of a mesh, of which nodes may touch, and the candidates by their degree, found when first asked for.

    ``spaces`` are those of the mesh.
    """

    def __init__(self, spaces: Spaces):
        self.spaces = spaces
        self._found: dict[int, Candidates] = {}

    def of(self, degree: int) -> Candidates:
        """Return the candidates of a ``degree``; collective."""
        if degree not in self._found:
            space = self.spaces.get(degree, CONDITIONS).space
            self._found[degree] = find_candidates(self.spaces.body, space)
        return self._found[degree]

    def elements(self, degree: int, element: str, stack: ExitStack) -> Elements:
        """Return elements of a ``degree`` and a kind, which the ``stack`` closes; collective."""
        found = elements_of(self.spaces, degree, CONDITIONS, element)
        stack.callback(found.close)
        return found


class Numbering:
    """Where candidates are among the local dofs of a space; takes values from there to all ranks.

    ``local`` (n) are the blocks of this rank, −1 where it has none.
    """

    def __init__(self, space: Any, numbers: IntArray):
        """Find nodes with global ``numbers`` (n) in ``space``."""
        index_map = space.dofmap.index_map
        self._comm: MPI.Comm = space.mesh.comm
        local = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        known = np.asarray(index_map.local_to_global(local), dtype=np.int64)
        order = np.argsort(known)
        place = np.searchsorted(known, numbers, sorter=order)
        at = np.append(order, -1)[place]
        self.local = np.where(np.append(known, -2)[at] == numbers, at, -1)
        self._is_owned = (self.local >= 0) & (self.local < index_map.size_local)

    def normal_dofs(self, chosen: BoolArray, *, owned: bool = False) -> Int32Array:
        """Return the local dofs (unrolled) along z of the ``chosen`` (n) that are on this rank, or only its own."""
        here = chosen & self._is_owned if owned else chosen & (self.local >= 0)
        return np.sort(3 * self.local[here] + 2).astype(np.int32)

    def put(self, into: FloatArray, values: FloatArray, chosen: BoolArray) -> None:
        """Write ``values`` (n) of the ``chosen`` (n) along z into an array of owned dofs (unrolled)."""
        here = chosen & self._is_owned
        into[3 * self.local[here] + 2] = values[here]

    def gather(self, values: FloatArray) -> FloatArray:
        """Return the entries along z, (n), of ``values`` on owned dofs (unrolled), on every rank; collective."""
        found = np.zeros(len(self.local))
        found[self._is_owned] = values[3 * self.local[self._is_owned] + 2]
        return global_sum(self._comm, found)


def _global(space: Any, dofs: IntArray) -> IntArray:
    numbers = space.dofmap.index_map.local_to_global(dofs.ravel().astype(np.int32))
    return np.asarray(numbers, dtype=np.int64).reshape(dofs.shape)
