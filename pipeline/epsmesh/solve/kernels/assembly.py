"""Assembled stiffness λ A_λ + μ A_μ of straight cells, in 3 × 3 blocks: ``assembly.c``.

Straight cells need no quadrature, and the position of every entry is known: assembly takes a third of dolfinx's time.
On several ranks, each adds up its own cells, and sends rows of other ranks' points to them (:mod:`shared_rows`).
"""

from functools import cache, cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve.kernels.cells import corners, owned_cells, reference, straight_cells
from epsmesh.solve.kernels.native import address, call, point_at
from epsmesh.solve.kernels.shared_rows import SharedRows
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.variation import Factors


class StraightStiffness:
    """Straight cells of a space of displacements, and the sparsity pattern of all cells.

    ``curved`` is a mask of the local cells that others assemble, or None; ``regions`` are the numbers of the cells'
    regions, ``factors`` those of the energy.
    """

    def __init__(
        self,
        space: Any,
        curved: BoolArray | None,
        regions: Int32Array | None = None,
        factors: Factors | None = None,
    ):
        """Find the pattern; collective."""
        index_map = space.dofmap.index_map
        self._points = index_map.size_local + index_map.num_ghosts
        self._dofs = owned_cells(space)
        self._which = straight_cells(curved, len(self._dofs))
        self._regions = np.zeros(len(self._dofs), dtype=np.int32) if regions is None else regions
        self._factors = factors
        self._corners, self._tensors = corners(space.mesh), _reference_tensors(compat.degree(space))
        offsets, columns, self._places = _pattern(self._dofs, self._points)
        self._entries, self._rows = len(columns), SharedRows(space.mesh.comm, index_map, offsets, columns)

    def matrix(self, law: MaterialLaw, prescribed: Int32Array, diagonal: float) -> PETSc.Mat:
        """Return the matrix of the straight cells, with the pattern of all; the caller destroys it; collective.

        Rows and columns of ``prescribed`` dofs (local, unrolled) are zero but for the ``diagonal``.
        """
        free = np.ones(3 * self._points)
        free[prescribed] = 0.0
        blocks = np.zeros((self._entries, 9))
        cells = len(self._which), self._which, self._dofs.shape[1], self._corners, self._dofs, self._places
        call("add_stiffness", *cells, self._tensors, free, *self._moduli(law), blocks)
        rows = self._rows
        blocks = rows.summed(blocks)
        row = np.repeat(np.arange(rows.owned, dtype=np.int32), np.diff(rows.offsets))
        on_diagonal = np.flatnonzero(rows.columns == rows.first + row)
        own = prescribed[prescribed < 3 * rows.owned]
        blocks[on_diagonal[own // 3], 4 * (own % 3)] = diagonal
        offsets, columns, places = self._unrolled
        values = np.empty(blocks.size)
        values[places] = blocks
        size = 3 * rows.owned, 3 * rows.size
        matrix = PETSc.Mat().createAIJWithArrays((size, size), (offsets, columns, values), comm=rows.comm)
        matrix.setBlockSizes(3, 3)  # this halves BoomerAMG's iterations
        matrix.setLGMap(rows.numbering, rows.numbering)
        return matrix

    def _moduli(self, law: MaterialLaw) -> tuple[Int32Array, FloatArray, FloatArray]:
        """Return the number of each cell among different materials, and λ and μ (Pa) of these."""
        regions = np.zeros_like(self._regions) if law.is_uniform else self._regions
        lame_lambda, lame_mu = (np.array(values, dtype=float) for values in (law.lame_lambda, law.lame_mu))
        if self._factors is None:
            return regions, lame_lambda, lame_mu
        count = len(self._dofs)
        factors, own = self._factors.means[:count], regions[:count]
        return np.arange(count, dtype=np.int32), factors * lame_lambda[own], factors * lame_mu[own]

    @property
    def nbytes(self) -> int:
        """Bytes of the layout, which all laws share."""
        return sum(each.nbytes for each in (self._corners, self._rows.columns, self._places, *self._unrolled))

    @cached_property
    def _unrolled(self) -> tuple[np.ndarray, np.ndarray, Int32Array]:
        """Unblocked sparse rows: offsets, columns, and positions of the entries of each block, (blocks, 9)."""
        rows = self._rows
        places = _unblocked(rows.offsets)
        columns = np.empty(9 * len(rows.columns), dtype=PETSc.IntType)
        columns[places] = np.repeat(3 * rows.columns[:, None] + np.arange(3, dtype=np.int32), 3, axis=1)
        lengths = np.repeat(3 * np.diff(rows.offsets), 3)
        return np.concatenate([[0], np.cumsum(lengths)]).astype(PETSc.IntType), columns, places


def _pattern(dofs: Int32Array, points: int) -> tuple[Int32Array, Int32Array, Int32Array]:
    """Return sparse rows of points that share a cell, and the position of each pair of a cell, (cells, n, n)."""
    count, width = dofs.shape
    offsets = np.arange(0, dofs.size + 1, width, dtype=np.int32)
    visited = sp.csr_matrix((np.ones(dofs.size, dtype=np.bool_), dofs.reshape(-1), offsets), shape=(count, points))
    # A product's columns are unsorted. Transposition sorts them, and is faster than sorting.
    graph = (visited.T.tocsr() @ visited).T.tocsr()
    visited.data = np.arange(dofs.size, dtype=np.int32)
    visits = visited.T.tocsr()
    places = np.empty((count, width, width), dtype=np.int32)
    rows = graph.indptr, graph.indices, visits.indptr, visits.data
    call("find_entries", points, width, dofs, *rows, np.empty(points, dtype=np.int32), places)
    return graph.indptr, graph.indices, places


def _unblocked(offsets: Int32Array) -> Int32Array:
    """Return the positions of the entries of each block, by columns, in unblocked sparse rows, (blocks, 9)."""
    width = np.diff(offsets)
    row = np.repeat(np.arange(len(width), dtype=np.int32), width)
    first = (6 * offsets[:-1])[row] + 3 * np.arange(len(row), dtype=np.int32)
    column, line = np.divmod(np.arange(9, dtype=np.int32), 3)
    return np.asarray(first[:, None] + line * (3 * width)[row][:, None] + column)


@cache
def cell_kernel(degree: int, *, of_regions: bool) -> int:
    """Return the address of a stiffness kernel of a straight cell, for dolfinx.

    λ and μ are constants of the form, or with ``of_regions`` functions that are constant on each cell.
    """
    point_at(f"tensors_{degree}", _reference_tensors(degree))
    return address(f"regions_{degree}" if of_regions else f"kernel_{degree}")


@cache
def _reference_tensors(degree: int) -> FloatArray:
    """Return ∫ ∂_a φ_i ∂_b φ_j on the reference cell, shape (3, 3, pairs i <= j)."""
    weights, _, gradients = reference(degree, 2 * degree - 2)
    tensors = np.einsum("q,aqi,bqj->abij", weights, gradients, gradients)
    i, j = np.triu_indices(tensors.shape[-1])
    return np.ascontiguousarray(tensors[:, :, i, j])
