"""The part of a body's surface that a probe may touch: its facets and nodes of degree 2, the same on every rank.

Contact is decided node by node for all ranks at once: they are a few thousand at most, and each rank holds them all.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array, IntArray
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import BodyMesh
from pipeline.scene.model import PROBE
from pipeline.solve.vectors import global_sum

_CORNERS = 3
# The corners of the facet of a tetrahedron that is opposite to each of its own, and the edges between them, after its
# own four corners: the edge of a facet's corners 1 and 2 first, then 0 and 2, then 0 and 1.
_OPPOSITE = np.array([[j for j in range(4) if j != i] for i in range(4)])
_EDGE = {tuple(sorted(pair)): number for number, pair in enumerate(EDGES.tolist())}
_BETWEEN = np.array([[4 + _EDGE[b, c], 4 + _EDGE[a, c], 4 + _EDGE[a, b]] for a, b, c in _OPPOSITE.tolist()])
# A facet's six nodes make four triangles.
_QUARTERS = np.array([(0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)])


@dataclass(frozen=True, eq=False)
class Candidates:
    """Nodes that may touch, and the facets between them; equal on every rank.

    ``nodes`` (n) are their numbers in the space of degree 2, global and in blocks, ``corners`` (n) those in the space
    of degree 1, −1 at the middle of an edge; ``points`` (n, 3) are in m. ``facets`` (m, 6) index the nodes, three
    corners and the mid nodes opposite to them; ``is_edge`` (n) tells which nodes bound the candidates, planes of
    symmetry aside. ``local_facets`` (m) alone differ: they are the numbers of facets on this rank, −1 of
    those of others.
    """

    nodes: IntArray
    corners: IntArray
    points: FloatArray
    facets: IntArray
    is_edge: BoolArray
    local_facets: Int32Array

    def __len__(self) -> int:
        return len(self.nodes)

    def numbers(self, degree: int) -> IntArray:
        """Return the global numbers of the nodes in the space of ``degree``, −1 where they are none of it; (n)."""
        return {1: self.corners, 2: self.nodes}.get(degree, np.full(len(self), -1, dtype=np.int64))

    @cached_property
    def quarters(self) -> IntArray:
        """The triangles (4 m, 3) between the nodes, four to a facet."""
        return self.facets[:, _QUARTERS].reshape(-1, _CORNERS)

    @cached_property
    def quarter_areas(self) -> FloatArray:
        """Their areas (m², normal to the probe's axis), (4 m)."""
        first, second, third = np.moveaxis(self.points[self.quarters][..., :2], 1, 0)
        (a, b), (c, d) = (second - first).T, (third - first).T
        return np.asarray(np.abs(a * d - b * c) / 2)

    @property
    def areas(self) -> FloatArray:
        """The areas of the facets (m², normal to the probe's axis), (m)."""
        return self.quarter_areas.reshape(-1, 4).sum(axis=1)

    @cached_property
    def _beside(self) -> IntArray:
        """Corners, and the mid nodes of their edges, (k, 2), each pair once."""
        pairs = [self.facets[:, (c, _CORNERS + m)] for c in range(_CORNERS) for m in range(_CORNERS) if m != c]
        return np.unique(np.concatenate(pairs), axis=0)

    def majority(self, active: BoolArray) -> BoolArray:
        """Tell of each corner whether it and the mid nodes of its edges are active for the most part; (n)."""
        corner, middle = self._beside.T
        share = np.where(active, 1.0, -1.0)
        votes = share + np.bincount(corner, share[middle], len(self))
        return np.asarray((votes > 0) & (self.corners >= 0))

    def enclosed(self, active: BoolArray) -> BoolArray:
        """Tell of each corner whether the mid nodes of all its edges are active; (n)."""
        corner, middle = self._beside.T
        open_ones = np.bincount(corner, ~active[middle], len(self))
        return np.asarray((open_ones == 0) & (self.corners >= 0))

    def spread(self, corners: BoolArray) -> BoolArray:
        """Return the nodes that ``corners`` (n) suggest: they themselves, and mid nodes with one of them at an end."""
        active = corners.copy()
        for middle in range(3):
            ends = self.facets[:, [c for c in range(3) if c != middle]]
            active[self.facets[corners[ends].any(axis=1), 3 + middle]] = True
        return active

    def closed_facets(self, active: BoolArray) -> Int32Array:
        """Return the local numbers of the facets on this rank whose three mid nodes are active."""
        closed = active[self.facets[:, _CORNERS:]].all(axis=1) & (self.local_facets >= 0)
        return self.local_facets[closed]


def find_candidates(body: BodyMesh, quadratic: Any, linear: Any) -> Candidates:
    """Return the nodes in the footprint of ``body``, for its spaces of degrees 2 and 1; collective."""
    topology, tdim = body.mesh.topology, body.mesh.topology.dim
    facets = body.facets[PROBE]
    topology.create_connectivity(tdim, tdim - 1)
    of_facet, of_cell = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    cell = of_facet.array[of_facet.offsets[facets]]
    facets, cell = facets[cell < body.owned_cells], cell[cell < body.owned_cells]
    side = np.argmax(of_cell.array.reshape(-1, tdim + 1)[cell] == facets[:, None], axis=1)
    places = np.hstack([_OPPOSITE[side], _BETWEEN[side]])
    fine = np.take_along_axis(compat.cell_dofs(quadratic)[cell], places, axis=1)
    coarse = np.take_along_axis(compat.cell_dofs(linear)[cell], _OPPOSITE[side], axis=1)
    x = np.asarray(quadratic.tabulate_dof_coordinates())[fine]
    nodes, corners, points = (
        np.concatenate(body.comm.allgather(part)) for part in (_global(quadratic, fine), _global(linear, coarse), x)
    )
    local = np.full(len(nodes), -1, dtype=np.int32)
    first = body.mesh.comm.scan(len(facets)) - len(facets)
    local[first : first + len(facets)] = facets
    return _assembled(body, nodes, corners, points, local)


def _assembled(body: BodyMesh, fine: IntArray, coarse: IntArray, x: FloatArray, local: Int32Array) -> Candidates:
    """Number the nodes of facets of all ranks, in an order that does not depend on how many there are."""
    _, first = np.unique(fine, return_index=True)
    points = x.reshape(-1, 3)[first]
    order = np.lexsort(points.T)
    nodes, points = fine.ravel()[first[order]], points[order]
    rank = np.argsort(nodes)
    facets = rank[np.searchsorted(nodes[rank], fine)]
    corners = np.full(len(nodes), -1, dtype=np.int64)
    corners[rank[np.searchsorted(nodes[rank], fine[:, :_CORNERS])]] = coarse
    return Candidates(nodes, corners, points, facets, _edge(body, points, facets), local)


def _edge(body: BodyMesh, points: FloatArray, facets: IntArray) -> BoolArray:
    """Tell which nodes bound the facets, planes of symmetry aside."""
    middle, count = np.unique(facets[:, _CORNERS:], return_counts=True)
    is_edge = np.zeros(len(points), dtype=bool)
    single = middle[count == 1]
    extent = np.abs(points[:, :2]).max()
    for axis in body.mirrored:
        single = single[np.abs(points[single, axis]) > _IN_PLANE * extent]
    is_edge[single] = True
    for corner in range(_CORNERS):
        for beside in range(_CORNERS):
            if beside != corner:
                is_edge[facets[is_edge[facets[:, 3 + beside]], corner]] = True
    return is_edge


# A point nearer to a plane of symmetry than this, in units of the candidates' extent, is in it.
_IN_PLANE = 1e-9


class Numbering:
    """Where candidates are among the local dofs of a space; takes values from there to all ranks.

    ``local`` (n) are the blocks of this rank, −1 where it has none.
    """

    def __init__(self, space: Any, numbers: IntArray):
        """Find nodes with global ``numbers`` (n, −1: not in this space) in ``space``."""
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
