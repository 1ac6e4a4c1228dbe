"""The rows of an operator that each rank holds, and where in them entries of its cells belong.

A matrix of PETSc on several ranks keeps two parts of a rank's rows: ``inside``, whose columns are the rank's own, and
``outside``, whose columns are others'. Cells at the border add to rows of other ranks, too: what they add is sent
there, once an assembly.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from pipeline.arrays import FloatArray, Int32Array, IntArray
from pipeline.solve.kernels.pattern import Pattern, pattern
from pipeline.solve.parcels import Parcels, owners


@dataclass(frozen=True)
class Part:
    """Sparse rows of points, whose columns ascend."""

    offsets: Int32Array
    columns: Int32Array

    @property
    def count(self) -> int:
        """The number of its entries."""
        return len(self.columns)


@dataclass(frozen=True)
class Rows:
    """The rows of this rank, and ``places``, the entry of each pair of points of each of its cells.

    Entries are counted through: those ``inside``, those ``outside``, those for other ranks. ``others`` are the points,
    ascending, that the columns of ``outside`` number; ``first`` is the first point of the columns inside.
    """

    inside: Part
    outside: Part
    others: IntArray
    places: Int32Array
    first: int = 0
    _parcels: Parcels | None = None
    _came_inside: tuple[IntArray, IntArray] | None = None
    _came_outside: tuple[IntArray, IntArray] | None = None

    @property
    def parts(self) -> tuple[Part, Part]:
        """Inside and outside."""
        return self.inside, self.outside

    @property
    def rest(self) -> int:
        """The number of entries of this rank's cells that are not inside."""
        return self.outside.count + (0 if self._parcels is None else self._parcels.going)

    def gather(self, rest: FloatArray, inside: FloatArray) -> FloatArray:
        """Add what other ranks' cells have for these rows to ``inside`` (entries, n); return those outside; collective.

        ``rest`` (entries that are not inside, n) is what this rank's cells have.
        """
        outside = rest[: self.outside.count]
        if self._parcels is None or self._came_inside is None or self._came_outside is None:
            return outside
        came = self._parcels.send(rest[self.outside.count :])
        for (which, entries), blocks in ((self._came_inside, inside), (self._came_outside, outside)):
            ends = np.searchsorted(which, [part.stop for part in self._parcels.sources])
            for start, end in zip([0, *ends[:-1]], ends, strict=True):  # no rank has an entry twice
                blocks[entries[start:end]] += came[which[start:end]]
        return outside


def rows(space: Any, columns: Any) -> Rows:
    """Return the rows of an operator between two spaces; collective."""
    local, comm = pattern(space, columns), space.mesh.comm
    if comm.size > 1:
        return _shared_rows(comm, local, space.dofmap.index_map, columns.dofmap.index_map)
    nothing = np.empty(0, dtype=np.int32)
    empty = Part(np.zeros_like(local.offsets), nothing)
    return Rows(Part(local.offsets, local.columns), empty, nothing.astype(np.int64), local.places)


def _shared_rows(comm: Any, local: Pattern, row_map: Any, column_map: Any) -> Rows:
    count, width, (first, end) = row_map.size_local, column_map.size_local, column_map.local_range
    row_number, number = _numbers(row_map), _numbers(column_map)
    row = np.repeat(np.arange(len(row_number), dtype=np.int32), np.diff(local.offsets))
    mine, own = row < count, local.columns < width
    here, beside, away = np.flatnonzero(mine & own), np.flatnonzero(mine & ~own), np.flatnonzero(~mine)

    parcels = Parcels(comm, owners(comm, row_map.local_range, row_number[count:])[row[away] - count])
    came_row = parcels.send(row_number[row[away]]) - row_map.local_range[0]
    came_column = parcels.send(number[local.columns[away]])
    is_inside = (came_column >= first) & (came_column < end)
    came_here, came_beside = np.flatnonzero(is_inside), np.flatnonzero(~is_inside)

    own_offsets = np.concatenate([[0], np.cumsum(np.bincount(row[here], minlength=count))]).astype(np.int32)
    inside, of_mine, of_others = _united(
        Part(own_offsets, local.columns[here]), width, came_row[came_here], came_column[came_here] - first
    )
    beyond_row = np.concatenate([row[beside], came_row[came_beside]])
    beyond = np.concatenate([number[local.columns[beside]], came_column[came_beside]])
    others, column = np.unique(beyond, return_inverse=True)
    outside, place = _sorted(count, len(others), beyond_row, column)

    entry = np.empty(len(row), dtype=np.int32)
    entry[here] = of_mine
    entry[beside] = inside.count + place[: len(beside)]
    entry[away] = inside.count + outside.count + np.arange(len(away))
    return Rows(
        inside, outside, others, entry[local.places], first, parcels, (came_here, of_others),
        (came_beside, place[len(beside) :]),
    )  # fmt: skip


def _numbers(index_map: Any) -> IntArray:
    """Return the numbers, in all, of the local points: owned ones, then ghosts."""
    return np.concatenate([np.arange(*index_map.local_range), np.asarray(index_map.ghosts, dtype=np.int64)])


def _united(mine: Part, width: int, row: IntArray, column: IntArray) -> tuple[Part, IntArray, IntArray]:
    """Return ``mine``, rows of a ``width``, and more entries, in any order, together; and where each of both is."""
    count = len(mine.offsets) - 1
    more, which = _sorted(count, width, row, column)
    marked = [
        sp.csr_matrix((np.full(part.count, mark, dtype=np.int8), part.columns, part.offsets), shape=(count, width))
        for part, mark in ((mine, 1), (more, 2))
    ]
    both = marked[0] + marked[1]  # entries in both are marked 3
    part = Part(both.indptr.astype(np.int32, copy=False), both.indices.astype(np.int32, copy=False))
    of_mine, of_more = (np.flatnonzero(both.data & mark) for mark in (1, 2))
    return part, of_mine, of_more[which]


def _sorted(count: int, width: int, row: IntArray, column: IntArray) -> tuple[Part, IntArray]:
    """Return ``count`` sparse rows of the entries that there are, and where in them each is."""
    keys, which = np.unique(row * np.int64(max(width, 1)) + column, return_inverse=True)
    row, column = np.divmod(keys, max(width, 1))
    offsets = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=count))])
    return Part(offsets.astype(np.int32), column.astype(np.int32)), which
