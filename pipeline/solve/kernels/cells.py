"""The cells of a rank, their reference cell, and cells side by side, one in each lane of the vectors of the C code."""

from typing import Any

import basix
import numpy as np

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.physics import MaterialLaw

# Cells that are taken side by side, as product.c has it.
LANES = 16


class Lanes:
    """Some cells of a rank, ``LANES`` at a time; what fills up the last batch is nought.

    ``which`` numbers the cells, ``dofs`` (batches, points, lanes) has their points: fillers have the first.
    """

    def __init__(self, which: Int32Array, dofs: Int32Array):
        """``dofs`` (cells, points) are those of all cells of the rank."""
        self.which, self.batches = which, -(-len(which) // LANES)
        self.dofs = self.spread(dofs[which])

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return ``values`` (cells, n) of these cells as (batches, n, lanes)."""
        filled = np.zeros((self.batches * LANES, values.shape[1]), dtype=values.dtype)
        filled[: len(values)] = values
        return np.ascontiguousarray(filled.reshape(self.batches, LANES, -1).transpose(0, 2, 1))

    def lame(self, law: MaterialLaw, regions: Int32Array | None) -> FloatArray:
        """Return λ and μ (Pa), shape (batches, 2, lanes); ``regions`` number what all cells of the rank are made of."""
        # A law of one material holds for every region.
        region = np.zeros(len(self.which), dtype=np.int32)
        if regions is not None and len(law.lame_mu) > 1:
            region = regions[self.which]
        return self.spread(np.array([law.lame_lambda, law.lame_mu], dtype=np.float64).T[region])


def straight_cells(curved: BoolArray | None, count: int) -> Int32Array:
    """Return the numbers of those of the first ``count`` cells that are not ``curved``, None if none is."""
    every = np.arange(count, dtype=np.int32)
    return every if curved is None else every[~curved[:count]]


def owned_cells(space: Any) -> Int32Array:
    """Return the points of each cell that this rank owns, shape (cells, points of a cell)."""
    topology = space.mesh.topology
    return np.ascontiguousarray(compat.cell_dofs(space)[: topology.index_map(topology.dim).size_local])


def corners(mesh: Any) -> FloatArray:
    """Return the corners of each cell, shape (cells, 4, 3)."""
    return np.ascontiguousarray(mesh.geometry.x[compat.geometry_dofs(mesh)[:, :4]])


def reference(degree: int, quadrature: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights, values (q, i) and gradients (a, q, i) of the functions of ``degree`` on the reference cell.

    The points integrate polynomials of degree ``quadrature``.
    """
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, quadrature)
    table = compat.reference_element(degree).tabulate(1, points)[:, :, :, 0]
    return weights, table[0], table[1:4]
