"""Interpolation between displacement spaces of two degrees on one mesh, and back, in single precision."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array, IntArray
from pipeline.solve.kernels.ghosts import Ghosts
from pipeline.solve.kernels.native import Single, call
from pipeline.stages import stage

# What interpolates to less than this does so by rounding.
_NOTHING = 1e-12


class Side(Protocol):
    """A space of vectors and its local dofs (unrolled) that are prescribed."""

    @property
    def space(self) -> Any: ...  # noqa: D102

    @property
    def prescribed(self) -> npt.NDArray[Any]: ...  # noqa: D102


@dataclass(frozen=True)
class Interpolation:
    """From the points of a coarse space to those of a fine one: sparse rows with the same weight for all components.

    ``coarse_free`` and ``fine_free`` are 0 for numbers that are prescribed, else 1. Rows are of the points that this
    rank owns; ``ghosts`` are those of the coarse space. Both maps are collective.
    """

    offsets: Int32Array
    points: Int32Array
    weights: Single
    coarse_free: Single
    fine_free: Single
    ghosts: Ghosts

    def prolong(self, coarse: Single, fine: Single) -> None:
        """Add the interpolation of ``coarse`` to ``fine``."""
        rows = len(self.offsets) - 1, self.offsets, self.points, self.weights
        call("prolong", *rows, self.coarse_free, self.fine_free, self.ghosts.extended(coarse, 3), fine)

    def restrict(self, fine: Single, coarse: Single) -> None:
        """Write the transposed interpolation of ``fine`` into ``coarse``."""
        rows = len(self.offsets) - 1, self.offsets, self.points, self.weights
        found = np.empty(len(self.coarse_free), dtype=np.float32)
        call("restrict_to", *rows, len(found), self.coarse_free, self.fine_free, fine, found)
        coarse[:] = self.ghosts.folded(found, 3)


@stage("interpolation")
def interpolation(coarse: Side, fine: Side) -> Interpolation:
    """Return the interpolation between two spaces; collective."""
    offsets, points, weights = _point_weights(coarse.space, fine.space)
    return Interpolation(
        offsets=offsets.astype(np.int32),
        points=points,
        weights=weights.astype(np.float32),
        coarse_free=free(coarse),
        fine_free=free(fine),
        ghosts=Ghosts(coarse.space),
    )


def free(side: Side) -> Single:
    """Return 0 for each number of a side that is prescribed, else 1; owned ones and ghosts."""
    dofmap = side.space.dofmap
    mask = np.ones(3 * (dofmap.index_map.size_local + dofmap.index_map.num_ghosts), dtype=np.float32)
    mask[side.prescribed] = 0.0
    return mask


def _point_weights(coarse: Any, fine: Any) -> tuple[IntArray, Int32Array, FloatArray]:
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
