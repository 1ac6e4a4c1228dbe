"""What pressures take part in, ∫ p q and ∫ q div u: straight cells from tensors of the reference cell.

The few curved cells come from a form that is marked on them alone.
"""

from functools import cache
from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, IntArray
from pipeline.solve.kernels.arrays import set_local_numbers
from pipeline.solve.kernels.native import call
from pipeline.solve.kernels.pattern import corners, reference, straight_cells
from pipeline.solve.kernels.rows import Rows, rows


def mass(pressures: Any, curved: BoolArray | None) -> PETSc.Mat:
    """Return ∫ p q over the straight cells, with room for the others; the caller destroys it. Collective."""
    volumes = np.abs(np.linalg.det(_edges(pressures.mesh)))
    return _matrix(volumes[:, None, None], _mass(compat.degree(pressures)), curved, pressures, pressures)


def coupling(pressures: Any, displacements: Any, curved: BoolArray | None) -> PETSc.Mat:
    """Return ∫ q div u over the straight cells, with room for the others; the caller destroys it. Collective."""
    edges = _edges(pressures.mesh)
    # ∂_s = Σ_a (∂x/∂X)⁻¹_sa ∂_a, with the rows of `edges` the derivatives of x.
    factors = np.abs(np.linalg.det(edges))[:, None, None] * np.linalg.inv(edges).transpose(0, 2, 1)
    tensors = _coupling(compat.degree(pressures), compat.degree(displacements))
    return _matrix(factors, tensors, curved, pressures, displacements)


def _matrix(
    factors: FloatArray, tensors: FloatArray, curved: BoolArray | None, row_space: Any, column_space: Any
) -> PETSc.Mat:
    """Return Σ_t factors(cell, t, s) tensors(t, i, j) in the row of i and the s-th column of j."""
    found = rows(row_space, column_space)
    _, terms, size = factors.shape
    which = straight_cells(curved, len(found.places))
    values = np.zeros((found.inside.count + found.rest, size))
    call(
        "add_products", len(which), which, tensors[0].size, terms, size, np.ascontiguousarray(factors), tensors,
        found.places, values,
    )  # fmt: skip
    inside = values[: found.inside.count]
    outside = found.gather(values[found.inside.count :], inside)
    offsets, columns, order = _merged(found)
    values = inside if order is None else np.concatenate([inside, outside])[order]
    unrolled = (size * columns[:, None] + np.arange(size)).astype(PETSc.IntType).reshape(-1)
    maps = [space.dofmap.index_map for space in (row_space, column_space)]
    sizes = [(width * index_map.size_local, None) for width, index_map in zip((1, size), maps, strict=True)]
    csr = (size * offsets).astype(PETSc.IntType), unrolled, values.reshape(-1)
    matrix = PETSc.Mat().createAIJ(sizes, (1, size), csr=csr, comm=row_space.mesh.comm)
    if row_space.mesh.comm.size > 1:
        set_local_numbers(matrix, maps, (1, size))
    return matrix


def _merged(found: Rows) -> tuple[IntArray, IntArray, IntArray | None]:
    """Return offsets and columns, in all, of rows, and the order of entries inside and outside, None if as they are."""
    columns: IntArray = found.inside.columns.astype(np.int64) + found.first
    if not found.outside.count:
        return found.inside.offsets.astype(np.int64), columns, None
    columns = np.concatenate([columns, found.others[found.outside.columns]])
    row = np.concatenate([np.repeat(np.arange(len(p.offsets) - 1), np.diff(p.offsets)) for p in found.parts])
    order = np.argsort(row * (columns.max() + 1) + columns, kind="stable")
    return (found.inside.offsets + found.outside.offsets).astype(np.int64), columns[order], order


def _edges(mesh: Any) -> FloatArray:
    """Return the three edges from the first corner of each cell, as rows."""
    points = corners(mesh)
    return points[:, 1:] - points[:, :1]


@cache
def _mass(degree: int) -> FloatArray:
    weights, values, _ = reference(degree, 2 * degree)
    return np.ascontiguousarray(np.einsum("q,qi,qj->ij", weights, values, values)[None])


@cache
def _coupling(degree: int, higher: int) -> FloatArray:
    quadrature = degree + higher - 1
    weights, values, _ = reference(degree, quadrature)
    _, _, gradients = reference(higher, quadrature)
    return np.ascontiguousarray(np.einsum("q,qi,aqj->aij", weights, values, gradients))
