"""What pressures take part in, ∫ p q and ∫ q div u: straight cells from tensors of the reference cell.

The few curved cells come from a form that is marked on them alone.
"""

from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.straight.pattern import Pattern, corners, library, pattern, reference, straight_cells


def mass(pressures: Any, curved: BoolArray | None) -> PETSc.Mat:
    """Return ∫ p q over the straight cells, with room for the others; the caller destroys it."""
    volumes = np.abs(np.linalg.det(_edges(pressures.mesh)))
    return _matrix(
        pattern(pressures, pressures), volumes[:, None, None], _mass(compat.degree(pressures)), curved,
        pressures, pressures,
    )  # fmt: skip


def coupling(pressures: Any, displacements: Any, curved: BoolArray | None) -> PETSc.Mat:
    """Return ∫ q div u over the straight cells, with room for the others; the caller destroys it."""
    edges = _edges(pressures.mesh)
    # ∂_s = Σ_a (∂x/∂X)⁻¹_sa ∂_a, with the rows of `edges` the derivatives of x.
    factors = np.abs(np.linalg.det(edges))[:, None, None] * np.linalg.inv(edges).transpose(0, 2, 1)
    tensors = _coupling(compat.degree(pressures), compat.degree(displacements))
    return _matrix(pattern(pressures, displacements), factors, tensors, curved, pressures, displacements)


def _matrix(
    found: Pattern, factors: FloatArray, tensors: FloatArray, curved: BoolArray | None, rows: Any, columns: Any
) -> PETSc.Mat:
    """Return Σ_t factors(cell, t, s) tensors(t, i, j) in the row of i and the s-th column of j."""
    cells, terms, size = factors.shape
    which = straight_cells(curved, cells)
    values = np.zeros((len(found.columns), size))
    library()(
        "add_products", len(which), which, tensors[0].size, terms, size, np.ascontiguousarray(factors), tensors,
        found.places, values,
    )  # fmt: skip
    unrolled = (size * found.columns[:, None] + np.arange(size)).astype(PETSc.IntType).reshape(-1)
    sizes = [space.dofmap.index_map.size_local * space.dofmap.index_map_bs for space in (rows, columns)]
    offsets = (size * found.offsets).astype(PETSc.IntType)
    return PETSc.Mat().createAIJ(sizes, (1, size), csr=(offsets, unrolled, values.reshape(-1)), comm=MPI.COMM_SELF)


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
