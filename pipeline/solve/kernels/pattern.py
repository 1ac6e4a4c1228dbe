"""Which entries an operator has, and which of them each cell adds to."""

from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
import scipy.sparse as sp

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.kernels.native import call


@dataclass(frozen=True)
class Pattern:
    """Sparse rows of points (``offsets``, ``columns``), and ``places``, the entry of each pair of each cell's points.

    Points are the local ones, owned and ghosts, and cells those of this rank. ``places`` has the shape (cells, points
    of the rows' space, points of the columns' space).
    """

    offsets: Int32Array
    columns: Int32Array
    places: Int32Array


def pattern(rows: Any, columns: Any) -> Pattern:
    """Return the pattern of an operator between two spaces on the cells of this rank: points couple that share one."""
    (row_dofs, visited), (column_dofs, touched) = (_cells_and_points(space) for space in (rows, columns))
    # A product's columns come in no order; those of a transposed matrix do, for less than they take to sort.
    graph = (touched.T.tocsr() @ visited).T.tocsr()
    (count, height), width = row_dofs.shape, column_dofs.shape[1]
    visited.data = np.arange(row_dofs.size, dtype=np.int32)
    visits = visited.T.tocsr()
    places = np.empty((count, height, width), dtype=np.int32)
    call(
        "find_entries", graph.shape[0], height, width, column_dofs, graph.indptr, graph.indices, visits.indptr,
        visits.data, np.empty(graph.shape[1], dtype=np.int32), places,
    )  # fmt: skip
    return Pattern(graph.indptr, graph.indices, places)


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


def _cells_and_points(space: Any) -> tuple[Int32Array, Any]:
    """Return the points of each cell, as an array and as a sparse matrix of cells × points."""
    dofs, index_map = owned_cells(space), space.dofmap.index_map
    count, width = dofs.shape
    offsets = np.arange(0, dofs.size + 1, width, dtype=np.int32)
    shape = count, index_map.size_local + index_map.num_ghosts
    return dofs, sp.csr_matrix((np.ones(dofs.size, dtype=np.bool_), dofs.reshape(-1), offsets), shape=shape)
