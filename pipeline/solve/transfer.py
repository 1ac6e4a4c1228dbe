"""Interpolation between displacement spaces of different degrees on one mesh, as a matrix for multigrid.

dolfinx's own matrix takes as long as half the multigrid solve, since it goes through the cells one by one.
"""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array, IntArray
from pipeline.stages import stage

# What interpolates to less than this does so by rounding.
_NOTHING = 1e-12


class Side(Protocol):
    """A space of vectors and its local dofs (unrolled) that are prescribed."""

    @property
    def space(self) -> Any: ...  # noqa: D102

    @property
    def prescribed(self) -> npt.NDArray[Any]: ...  # noqa: D102


@stage("interpolation")
def transfer(coarse: Side, fine: Side) -> PETSc.Mat:
    """Return the interpolation from ``coarse`` to ``fine``, which neither reads nor writes prescribed dofs; collective.

    The caller destroys the matrix.
    """
    width = fine.space.dofmap.index_map_bs
    offsets, points, weights = point_weights(coarse.space, fine.space)
    count = np.diff(offsets)
    row = np.repeat(np.arange(len(count), dtype=np.int32), count)
    first = width * coarse.space.dofmap.index_map.local_to_global(points)
    columns, values = np.empty(width * len(row), dtype=PETSc.IntType), np.empty(width * len(row))
    free_row, free_column = (free(side) for side in (fine, coarse))
    # A point has ``width`` rows with the same weights, each for its own component.
    place = np.arange(len(row)) + (width - 1) * offsets[row]
    for component in range(width):
        columns[place] = first + component
        values[place] = weights * free_row[width * row + component] * free_column[width * points + component]
        place += count[row]
    start = np.concatenate([[0], np.cumsum(np.repeat(count, width))]).astype(PETSc.IntType)
    sizes = [width * side.space.dofmap.index_map.size_local for side in (fine, coarse)]
    matrix = PETSc.Mat().createAIJ(
        ((sizes[0], None), (sizes[1], None)), bsize=width, comm=fine.space.mesh.comm,
        csr=(start, columns, values),
    )  # fmt: skip
    matrix.assemble()
    return matrix


def point_weights(coarse: Any, fine: Any) -> tuple[IntArray, Int32Array, FloatArray]:
    """Return the interpolation of scalars as sparse rows, one for each point of ``fine`` that this rank owns.

    A point's row is that of any cell it belongs to.
    """
    local = _on_one_cell(compat.degree(coarse), compat.degree(fine))
    few = [np.flatnonzero(np.abs(row) > _NOTHING) for row in local]
    coarse_cells, fine_cells = (compat.cell_dofs(space) for space in (coarse, fine))
    owned = fine.dofmap.index_map.size_local
    place = np.zeros(owned, dtype=np.int64)
    flat = fine_cells.reshape(-1)
    mine = np.flatnonzero(flat < owned)
    place[flat[mine]] = mine
    cell, position = np.divmod(place, fine_cells.shape[1])
    count = np.array([len(columns) for columns in few])[position]
    offsets = np.concatenate([[0], np.cumsum(count)])
    first = np.cumsum([0, *(len(columns) for columns in few)])[position]
    entry = np.repeat(first - offsets[:-1], count) + np.arange(offsets[-1])
    columns = np.concatenate(few)[entry]
    weights = np.concatenate([row[columns] for row, columns in zip(local, few, strict=True)])[entry]
    return offsets, coarse_cells[np.repeat(cell, count), columns], weights


def _on_one_cell(coarse: int, fine: int) -> FloatArray:
    """Return the values of the functions of degree ``coarse`` at the points of ``fine`` on the reference cell."""
    low, high = (compat.reference_element(degree) for degree in (coarse, fine))
    return np.asarray(low.tabulate(0, high.points)[0, :, :, 0])


def free(side: Side) -> FloatArray:
    """Return 0 for each number of a side that is prescribed, else 1; owned ones and ghosts."""
    dofmap = side.space.dofmap
    mask = np.ones(dofmap.index_map_bs * (dofmap.index_map.size_local + dofmap.index_map.num_ghosts))
    mask[side.prescribed] = 0.0
    return mask
