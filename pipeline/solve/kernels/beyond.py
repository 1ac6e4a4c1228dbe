"""What the rows of one rank take from points that other ranks own: a part of every product with an operator."""

from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.solve.kernels.arrays import blocks_to_read
from pipeline.solve.parcels import Shared


class Beyond:
    """The blocks of a matrix, of type mpibaij, whose columns are other ranks', of numbers of a ``kind``."""

    def __init__(self, matrix: PETSc.Mat, kind: npt.DTypeLike, multiply: Any):
        """``multiply(rows, offsets, columns, blocks, z, y)`` adds products with blocks by columns; collective.

        In double precision the entries are the matrix's, which must live as long.
        """
        _, outside, others = blocks_to_read(matrix)
        first, end = matrix.getOwnershipRange()
        self._shared = Shared(matrix.comm.tompi4py(), (first // 3, end // 3), others)
        count = np.diff(outside.offsets)
        self._rows = np.flatnonzero(count).astype(np.int32)  # those at the border: a few
        self._offsets = outside.offsets[np.append(self._rows, len(count))]
        self._columns, self._blocks = outside.columns, outside.values.astype(kind, copy=False)
        self._multiply = multiply

    def begin(self, x: np.ndarray) -> tuple[Any, ...]:
        """Begin to give ``x`` to those who multiply with it; collective."""
        return self._shared.begin_read(x.reshape(-1, 3))

    def add(self, begun: tuple[Any, ...], y: np.ndarray) -> None:
        """Add the product with what other ranks gave to ``y``; collective."""
        z = self._shared.end_read(begun)
        self._multiply(len(self._rows), self._rows, self._offsets, self._columns, self._blocks, z.reshape(-1), y)


def beyond(matrix: PETSc.Mat, kind: npt.DTypeLike, multiply: Any) -> Beyond | None:
    """Return what is beyond the rows' own columns, None on one process; collective."""
    return None if matrix.comm.size == 1 else Beyond(matrix, kind, multiply)


def summed(comm: MPI.Comm, value: float, how: MPI.Op = MPI.SUM) -> float:
    """Return the sum of all ranks' values, or what ``how`` makes of them; collective."""
    if comm.size == 1:
        return value
    result = np.empty(1)
    comm.Allreduce(np.array([value], dtype=np.float64), result, op=how)  # numbers alone: allreduce sends objects
    return float(result[0])
