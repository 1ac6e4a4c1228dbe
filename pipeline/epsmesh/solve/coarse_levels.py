"""Levels of multigrid below degree 1: on the tetrahedra from which those of a mesh were cut, with straight edges.

A vertex of the finer mesh is one of the coarser, or halves one of its edges. The prolongation is therefore that from
degree 1 to degree 2, whatever the place to which curved sides and smoothing have moved the vertex.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import FloatArray, Int32Array, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.generate import determinants
from epsmesh.solve.compiled import vector_space
from epsmesh.solve.kernels.assembly import StraightStiffness
from epsmesh.solve.kernels.cells import Ghosts, owned_cells
from epsmesh.solve.kernels.product import CellStiffness
from epsmesh.solve.krylov import keep
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.variation import Factors
from epsmesh.stages import stage

# A cell whose volume is below this share of that of its parts is too distorted: there is no such level then.
_LEAST_VOLUME = 0.2


@dataclass(frozen=True, eq=False)
class CoarseSpace:
    """Displacements of degree 1 on the cells from which those of a finer mesh were cut.

    ``children`` (cells, 10) are the local points of the finer space, of degree 1, at the corners of each owned cell and
    in the middle of its edges. ``prescribed`` are local dofs (unrolled). ``regions`` and ``factors`` are those of owned
    cells, or None; for ``beyond`` see :func:`coarse_space`.
    """

    space: Any
    prescribed: Int32Array
    children: Int32Array
    beyond: Int32Array
    regions: Int32Array | None
    factors: Factors | None

    @contextmanager
    def lend(self, law: MaterialLaw, *, entries: bool = False) -> Iterator[PETSc.Mat]:
        """Lend the stiffness, assembled or matrix-free: see :meth:`.ElasticSpace.lend`; collective."""
        with ExitStack() as stack:
            yield keep(stack, self._assembled(law) if entries else self._product(law))

    @cached_property
    def _cells(self) -> CellStiffness:
        return CellStiffness(self.space, None, self.prescribed, self.regions, factors=self.factors)

    @stage("assembly")
    def _product(self, law: MaterialLaw) -> PETSc.Mat:
        return self._cells.operator(law).matrix()

    @stage("assembly")
    def _assembled(self, law: MaterialLaw) -> PETSc.Mat:
        layout = StraightStiffness(self.space, None, self.regions, self.factors)
        matrix = layout.matrix(law, self.prescribed, law.lame_mu[0])
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix


@stage("coarse levels")
def coarse_space(
    space: Any, prescribed: Int32Array, beyond: Int32Array, regions: Int32Array | None, factors: Factors | None
) -> CoarseSpace | None:
    """Return the coarser space of a ``space`` of degree 1 whose cells were made in eights, see :class:`.BodyMesh`.

    ``prescribed`` are its local dofs without rows and columns, ``regions`` and ``factors`` those of its cells.
    ``beyond`` (cells, k) are the ranks that have cells next to each of this rank, -1 for none, in the order in which
    the cells were passed to dolfinx. None if a coarse cell is too distorted. Collective.
    """
    comm, families, ghosts = space.mesh.comm, _families(space.mesh), Ghosts(space)
    dofs, places = compat.cell_dofs(space)[families], np.asarray(space.tabulate_dof_coordinates())
    nodes = np.concatenate([dofs[:, :4, 0], _middles(dofs[:, :4, 1:])], axis=1)
    distorted = _volumes(places[nodes[:, :4]]) < _LEAST_VOLUME * _volumes(places[dofs]).sum(axis=1)
    if comm.allreduce(bool(distorted.any()), op=MPI.LOR):
        return None
    # The corners are numbered rank by rank, by the owners of the finer points.
    is_corner = np.zeros(ghosts.local, dtype=bool)
    is_corner[nodes[:, :4]] = True
    chosen = np.flatnonzero(is_corner[: ghosts.owned])
    numbers = np.zeros(ghosts.owned)
    numbers[chosen] = comm.scan(len(chosen)) - len(chosen) + np.arange(len(chosen))
    corners = ghosts.extended(numbers, 1)[nodes[:, :4]].astype(np.int64)
    beyond = beyond.reshape(len(corners), -1)
    mesh = compat.create_mesh(comm, corners, places[chosen], order=1, beyond=beyond)
    order, coarse = _own_cells(mesh), vector_space(mesh, 1)
    nodes, families = nodes[order], families[order]
    own, held = Ghosts(coarse), np.zeros((ghosts.local, 3))
    held.reshape(-1)[prescribed] = 1.0
    values = np.zeros((own.local, 3))
    values[owned_cells(coarse)] = held[nodes[:, :4]]
    return CoarseSpace(
        space=coarse,
        prescribed=np.flatnonzero(own.extended(values[: own.owned].reshape(-1), 3)).astype(np.int32),
        children=np.ascontiguousarray(nodes, dtype=np.int32),
        beyond=beyond,
        regions=None if regions is None else regions[families[:, 0]],
        factors=None if factors is None else Factors.constant(factors.means[families].mean(axis=1)),
    )


def _own_cells(mesh: Any) -> IntArray:
    """Return the number of each owned cell among those that this rank passed to dolfinx; collective."""
    count = mesh.topology.index_map(mesh.topology.dim).size_local
    first = mesh.comm.scan(count) - count
    return np.asarray(compat.original_cells(mesh)[:count] - first)


def _families(mesh: Any) -> IntArray:
    """Return the owned cells in eights, (n, 8), in the order in which they were passed to dolfinx; collective."""
    return np.argsort(_own_cells(mesh)).reshape(-1, 8)


def _middles(others: Int32Array) -> Int32Array:
    """Return the points (n, 6) that halve the edges of cells: what two children at corners, (n, 4, 3), share."""
    found = []
    for i, j in EDGES:
        shared = (others[:, i, :, None] == others[:, j, None, :]).any(axis=2)
        found.append(np.take_along_axis(others[:, i], shared.argmax(axis=1)[:, None], axis=1))
    return np.concatenate(found, axis=1)


def _volumes(corners: FloatArray) -> FloatArray:
    """Return six times the volume of tetrahedra, (..., 4, 3), mirror images included."""
    edges = (corners[..., 1:, :] - corners[..., :1, :]).reshape(-1, 3, 3)
    return np.asarray(np.abs(determinants(edges.swapaxes(0, 1))).reshape(corners.shape[:-2]))
