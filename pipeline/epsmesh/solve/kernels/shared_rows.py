"""Block rows of a matrix to which the cells of several ranks add.

A rank integrates over its own cells. Rows of ghost points go to the ranks that own them: the positions once, the
values for each matrix. The pattern of the owned rows is the union of what all ranks have.
"""

from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray, Int32Array, IntArray


class SharedRows:
    """Sparse rows of 3 × 3 blocks for the owned points of a space, ``offsets`` and global ``columns``.

    ``owned`` and ``size`` count the points of this rank and of all, ``first`` is the number of this rank's first.
    ``numbering`` maps local points to global ones, for blocks of three.
    """

    def __init__(self, comm: MPI.Comm, index_map: Any, offsets: Int32Array, columns: Int32Array):
        """``offsets`` and ``columns`` are rows of this rank's cells, for local points, ghosts last; collective."""
        self.comm, self.owned, self.size = comm, index_map.size_local, index_map.size_global
        self.offsets, self.columns, self.first = offsets, columns, index_map.local_range[0]
        numbers = np.append(np.arange(*index_map.local_range), index_map.ghosts)
        self.numbering = PETSc.LGMap().create(numbers.astype(PETSc.IntType), bsize=3, comm=comm)
        self._own = int(offsets[self.owned])
        if comm.size == 1:
            return
        starts = np.array(comm.allgather(self.first))
        rows = np.repeat(numbers, np.diff(offsets))
        keys = rows * self.size + numbers[columns]
        # Ranks without points begin where the next one does: the last of these is the owner.
        owner = np.searchsorted(starts, rows[self._own :], side="right") - 1
        self._sent = self._own + np.argsort(owner, kind="stable")
        self._ends = np.cumsum(np.bincount(owner, minlength=comm.size))[:-1]
        received: list[IntArray] = comm.alltoall(np.split(keys[self._sent], self._ends))
        every, places = np.unique(np.concatenate([keys[: self._own], *received]), return_inverse=True)
        self._places = np.split(places.reshape(-1), self._own + np.cumsum([0, *map(len, received[:-1])]))
        self.offsets = np.searchsorted(every, (self.first + np.arange(self.owned + 1)) * self.size).astype(np.int32)
        self.columns = (every % self.size).astype(np.int32)

    def summed(self, blocks: FloatArray) -> FloatArray:
        """Return the blocks (entries, 9) of owned rows, from those of this rank's cells; collective."""
        if self.comm.size == 1:
            return blocks
        own, *shared = self._places
        result = np.zeros((len(self.columns), 9))
        result[own] = blocks[: self._own]
        received = self.comm.alltoall(np.split(blocks[self._sent], self._ends))
        for places, some in zip(shared, received, strict=True):  # a rank sends each entry once
            result[places] += some
        return result
