"""The stiffness λ A_λ + μ A_μ of straight cells, in 3 × 3 blocks."""

from functools import cache, cached_property
from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.material import MaterialLaw
from pipeline.solve.straight.arrays import entries, sparse_matrix
from pipeline.solve.straight.pattern import corners, library, pattern, reference, straight_cells


class StraightStiffness:
    """The straight cells of a space of displacements, and the pattern of the operator on all of its cells.

    ``curved`` tells for each cell whether it is left to others, None if none is; ``prescribed`` are the dofs
    (unrolled) whose rows and columns the operator does not have; ``regions`` number what cells are made of.
    """

    def __init__(self, space: Any, curved: BoolArray | None, prescribed: Int32Array, regions: Int32Array | None = None):
        self._dofs = np.ascontiguousarray(compat.cell_dofs(space))
        self._which = straight_cells(curved, len(self._dofs))
        self._regions = np.zeros(len(self._dofs), dtype=np.int32) if regions is None else regions
        self._corners = corners(space.mesh)
        self._tensors = _reference_tensors(compat.degree(space))
        self._pattern = pattern(space, space)
        points = space.dofmap.index_map.size_local
        self._free = np.ones(3 * points)
        self._free[prescribed] = 0.0
        diagonal = np.empty(points, dtype=np.int32)
        diagonal[self._dofs] = self._pattern.places.diagonal(axis1=1, axis2=2)
        self._diagonal = diagonal[prescribed // 3], 4 * (prescribed % 3)

    def matrix(self, mat_type: str) -> PETSc.Mat:
        """Return a matrix of zeros, "baij" or "aij", for the operator on all cells; the caller destroys it."""
        offsets, columns = self._pattern.offsets, self._pattern.columns
        if mat_type == "baij":
            return sparse_matrix(offsets, columns, 3)
        rows = np.repeat(3 * np.diff(offsets), 3)
        unrolled = np.empty(9 * len(columns), dtype=np.int32)
        unrolled[self._unblocked] = np.repeat(3 * columns[:, None] + np.arange(3, dtype=np.int32), 3, axis=1)
        return sparse_matrix(np.concatenate([[0], np.cumsum(rows)]), unrolled, 1)

    def add(self, matrix: PETSc.Mat, law: MaterialLaw, diagonal: float) -> None:
        """Add the straight cells to ``matrix``, which has this pattern; set the diagonal of prescribed dofs."""
        count = 9 * len(self._pattern.columns)
        with entries(matrix, count) as values:
            if matrix.getType() == "seqbaij":
                self._add(values.reshape(-1, 9), law, diagonal)
                return
            blocks = values[self._unblocked]
            self._add(blocks, law, diagonal)
            values[self._unblocked] = blocks

    def _add(self, blocks: FloatArray, law: MaterialLaw, diagonal: float) -> None:
        # A law of one material holds for every region.
        regions = self._regions if len(law.lame_mu) > 1 else np.zeros_like(self._regions)
        library()(
            "add_stiffness", len(self._which), self._which, self._dofs.shape[1], self._corners, self._dofs,
            self._pattern.places, self._tensors, self._free, regions, np.array(law.lame_lambda, dtype=float),
            np.array(law.lame_mu, dtype=float), blocks,
        )  # fmt: skip
        blocks[self._diagonal] = diagonal

    @cached_property
    def _unblocked(self) -> Int32Array:
        """Where the entries of each block are in sparse rows without blocks, shape (blocks, 9), by columns."""
        offsets = self._pattern.offsets
        width = np.diff(offsets)
        row = np.repeat(np.arange(len(width), dtype=np.int32), width)
        first = (6 * offsets[:-1])[row] + 3 * np.arange(len(row), dtype=np.int32)
        column, line = np.divmod(np.arange(9, dtype=np.int32), 3)
        return np.asarray(first[:, None] + line * (3 * width)[row][:, None] + column)


@cache
def cell_kernel(degree: int, *, of_regions: bool) -> int:
    """Return the address of a kernel for the stiffness of a straight cell, for dolfinx.

    λ and μ are constants of the form, or, ``of_regions``, functions that are constant on each cell.
    """
    library().set(f"tensors_{degree}", _reference_tensors(degree))
    return library().address(f"regions_{degree}" if of_regions else f"kernel_{degree}")


@cache
def _reference_tensors(degree: int) -> FloatArray:
    """Return ∫ ∂_a φ_i ∂_b φ_j on the reference cell, shape (3, 3, pairs i <= j)."""
    weights, _, gradients = reference(degree, 2 * degree - 2)
    tensors = np.einsum("q,aqi,bqj->abij", weights, gradients, gradients)
    i, j = np.triu_indices(tensors.shape[-1])
    return np.ascontiguousarray(tensors[:, :, i, j])
