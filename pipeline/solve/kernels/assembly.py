"""Assembled stiffness λ A_λ + μ A_μ of straight cells, in 3 × 3 blocks: ``assembly.c``.

Straight cells need no quadrature, and the position of every entry is known. On one process the matrix is assembled
here, in a third of dolfinx's time. On several processes dolfinx assembles, with the cell kernel from here.
"""

from functools import cache, cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.kernels.cells import corners, owned_cells, reference, straight_cells
from pipeline.solve.kernels.native import address, call, point_at
from pipeline.solve.physics import MaterialLaw


class StraightStiffness:
    """Straight cells of a space of displacements on one process, and the sparsity pattern of all cells.

    ``curved`` is a mask of the cells that others assemble, or None; ``regions`` are the numbers of the cells' regions.
    """

    def __init__(self, space: Any, curved: BoolArray | None, regions: Int32Array | None = None):
        self._dofs = owned_cells(space)
        self._which = straight_cells(curved, len(self._dofs))
        self._regions = np.zeros(len(self._dofs), dtype=np.int32) if regions is None else regions
        self._corners, self._tensors = corners(space.mesh), _reference_tensors(compat.degree(space))
        self._offsets, self._columns, self._places = _pattern(self._dofs, space.dofmap.index_map.size_local)

    def matrix(self, law: MaterialLaw, prescribed: Int32Array, diagonal: float) -> PETSc.Mat:
        """Return the matrix of the straight cells, with the pattern of all; the caller destroys it.

        Rows and columns of ``prescribed`` dofs (unrolled) are zero but for the ``diagonal``.
        """
        free = np.ones(3 * (len(self._offsets) - 1))
        free[prescribed] = 0.0
        regions = np.zeros_like(self._regions) if law.is_uniform else self._regions
        blocks = np.zeros((len(self._columns), 9))
        cells = len(self._which), self._which, self._dofs.shape[1], self._corners, self._dofs, self._places
        lame = (np.array(values, dtype=float) for values in (law.lame_lambda, law.lame_mu))
        call("add_stiffness", *cells, self._tensors, free, regions, *lame, blocks)
        row = np.repeat(np.arange(len(self._offsets) - 1, dtype=np.int32), np.diff(self._offsets))
        on_diagonal = np.flatnonzero(self._columns == row)
        blocks[on_diagonal[prescribed // 3], 4 * (prescribed % 3)] = diagonal
        offsets, columns, places = self._unrolled
        values = np.empty(blocks.size)
        values[places] = blocks
        size = 3 * (len(self._offsets) - 1)
        csr = offsets, columns, values
        matrix = PETSc.Mat().createAIJWithArrays((size, size), csr, comm=PETSc.COMM_SELF)
        matrix.setBlockSizes(3, 3)  # this halves BoomerAMG's iterations
        return matrix

    @property
    def nbytes(self) -> int:
        """Bytes of the layout, which all laws share."""
        return sum(each.nbytes for each in (self._corners, self._columns, self._places, *self._unrolled))

    @cached_property
    def _unrolled(self) -> tuple[np.ndarray, np.ndarray, Int32Array]:
        """Unblocked sparse rows: offsets, columns, and positions of the entries of each block, (blocks, 9)."""
        places = _unblocked(self._offsets)
        columns = np.empty(9 * len(self._columns), dtype=PETSc.IntType)
        columns[places] = np.repeat(3 * self._columns[:, None] + np.arange(3, dtype=np.int32), 3, axis=1)
        rows = np.repeat(3 * np.diff(self._offsets), 3)
        return np.concatenate([[0], np.cumsum(rows)]).astype(PETSc.IntType), columns, places


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
