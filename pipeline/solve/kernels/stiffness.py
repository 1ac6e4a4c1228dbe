"""The stiffness λ A_λ + μ A_μ of straight cells, in 3 × 3 blocks."""

from functools import cache, cached_property
from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.kernels.arrays import entries_of_parts, set_local_numbers, shared_matrix, sparse_matrix
from pipeline.solve.kernels.native import address, call, point_at
from pipeline.solve.kernels.pattern import corners, owned_cells, reference, straight_cells
from pipeline.solve.kernels.rows import Part, rows
from pipeline.solve.physics import MaterialLaw


class StraightStiffness:
    """The straight cells of a space of displacements, and the pattern of the operator on all of its cells.

    ``curved`` tells for each local cell whether it is left to others, None if none is; ``prescribed`` are the local
    dofs (unrolled) whose rows and columns the operator does not have; ``regions`` number what cells are made of.
    """

    def __init__(self, space: Any, curved: BoolArray | None, prescribed: Int32Array, regions: Int32Array | None = None):
        """Collective."""
        self._dofs, self._comm = owned_cells(space), space.mesh.comm
        self._which = straight_cells(curved, len(self._dofs))
        self._regions = np.zeros(len(self._dofs), dtype=np.int32) if regions is None else regions
        self._corners = corners(space.mesh)
        self._tensors = _reference_tensors(compat.degree(space))
        self._rows, index_map = rows(space, space), space.dofmap.index_map
        self._free = np.ones(3 * (index_map.size_local + index_map.num_ghosts))
        self._free[prescribed] = 0.0
        owned = prescribed[prescribed < 3 * index_map.size_local]
        self._diagonal = _diagonal(self._rows.inside)[owned // 3], 4 * (owned % 3)
        self._index_map = index_map

    def matrix(self, mat_type: str) -> PETSc.Mat:
        """Return a matrix of zeros, "baij" or "aij", for the operator on all cells; the caller destroys it.

        Collective.
        """
        (inside, outside), block = self._rows.parts, 3
        outside = Part(outside.offsets, self._rows.others[outside.columns].astype(np.int32))
        if mat_type == "aij":
            (inside, outside), block = map(_unrolled, (inside, outside), self._places), 1
        if self._comm.size == 1:
            return sparse_matrix(inside.offsets, inside.columns, block)
        here, beyond = ((part.offsets, part.columns) for part in (inside, outside))
        matrix = shared_matrix(self._comm, here, beyond, block)
        set_local_numbers(matrix, [self._index_map] * 2, (3, 3))
        return matrix

    def add(self, matrix: PETSc.Mat, law: MaterialLaw, diagonal: float) -> None:
        """Add the straight cells to ``matrix``, which has this pattern; set the diagonal of prescribed dofs.

        Collective.
        """
        counts = 9 * self._rows.inside.count, 9 * self._rows.outside.count
        with entries_of_parts(matrix, *counts) as (inside, outside):
            if matrix.getType().endswith("baij"):
                outside[:] += self._add(inside.reshape(-1, 9), law, diagonal).reshape(-1)
                return
            here, beyond = self._places
            blocks = inside[here]
            outside[beyond] += self._add(blocks, law, diagonal)
            inside[here] = blocks

    def _add(self, blocks: FloatArray, law: MaterialLaw, diagonal: float) -> FloatArray:
        """Add the straight cells of all ranks to the ``blocks`` inside; return those outside; collective."""
        # A law of one material holds for every region.
        regions = self._regions if len(law.lame_mu) > 1 else np.zeros_like(self._regions)
        rest = np.zeros((self._rows.rest, 9))
        call(
            "add_stiffness", len(self._which), self._which, self._dofs.shape[1], self._corners, self._dofs,
            self._rows.places, self._tensors, self._free, regions, np.array(law.lame_lambda, dtype=float),
            np.array(law.lame_mu, dtype=float), self._rows.inside.count, blocks, rest,
        )  # fmt: skip
        outside = self._rows.gather(rest, blocks)
        blocks[self._diagonal] = diagonal
        return outside

    @cached_property
    def _places(self) -> tuple[Int32Array, Int32Array]:
        """Where the entries of each block are in sparse rows without blocks, (blocks, 9), inside and outside."""
        return _unblocked(self._rows.inside.offsets), _unblocked(self._rows.outside.offsets)


def _diagonal(part: Part) -> Int32Array:
    """Return where in its rows the diagonal is."""
    row = np.repeat(np.arange(len(part.offsets) - 1, dtype=np.int32), np.diff(part.offsets))
    return np.flatnonzero(part.columns == row).astype(np.int32)


def _unrolled(part: Part, places: Int32Array) -> Part:
    """Return sparse rows of numbers, each block being at ``places``."""
    rows = np.repeat(3 * np.diff(part.offsets), 3)
    columns = np.empty(9 * part.count, dtype=np.int32)
    columns[places] = np.repeat(3 * part.columns[:, None] + np.arange(3, dtype=np.int32), 3, axis=1)
    return Part(np.concatenate([[0], np.cumsum(rows)]).astype(np.int32), columns)


def _unblocked(offsets: Int32Array) -> Int32Array:
    """Return where the entries of each block, by columns, are in sparse rows without blocks, shape (blocks, 9)."""
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
    point_at(f"tensors_{degree}", _reference_tensors(degree))
    return address(f"regions_{degree}" if of_regions else f"kernel_{degree}")


@cache
def _reference_tensors(degree: int) -> FloatArray:
    """Return ∫ ∂_a φ_i ∂_b φ_j on the reference cell, shape (3, 3, pairs i <= j)."""
    weights, _, gradients = reference(degree, 2 * degree - 2)
    tensors = np.einsum("q,aqi,bqj->abij", weights, gradients, gradients)
    i, j = np.triu_indices(tensors.shape[-1])
    return np.ascontiguousarray(tensors[:, :, i, j])
