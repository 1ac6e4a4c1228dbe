"""Symmetric operators that PETSc has assembled, of which the blocks from the diagonal on are read."""

from functools import partial
from typing import Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import Int32Array
from pipeline.solve.kernels.arrays import blocks_to_read
from pipeline.solve.kernels.beyond import beyond
from pipeline.solve.kernels.native import Single, call


class SymmetricOperator(Protocol):
    """A positive definite operator in single precision, of ``rows`` points.

    ``prescribed`` are dofs (unrolled) of which it knows nothing: what multiplies is nought there, the product anything.
    On several ranks points are those that a rank owns, and products and diagonals are collective.
    """

    @property
    def comm(self) -> MPI.Comm: ...  # noqa: D102

    @property
    def rows(self) -> int: ...  # noqa: D102

    @property
    def prescribed(self) -> Int32Array: ...  # noqa: D102

    def multiply(self, x: Single, y: Single) -> None: ...  # noqa: D102

    def diagonal(self) -> Single: ...  # noqa: D102


class UpperBlocks:
    """The operator of a matrix: its blocks from the diagonal on, and those beyond the columns of this rank."""

    prescribed: Int32Array = np.empty(0, dtype=np.int32)

    def __init__(self, matrix: PETSc.Mat):
        """Take the entries of a matrix, in blocks and symmetric; collective."""
        self.comm = matrix.comm.tompi4py()
        inside, _, _ = blocks_to_read(matrix)
        offsets, columns = inside.offsets, inside.columns
        self.rows = len(offsets) - 1
        row = np.repeat(np.arange(self.rows, dtype=np.int32), np.diff(offsets))
        upper = np.add.reduceat(columns >= row, offsets[:-1])
        self._offsets = np.concatenate([[0], np.cumsum(upper)]).astype(np.int32)
        self._columns = np.empty(self._offsets[-1], dtype=np.int32)
        self._values = np.empty((self._offsets[-1], 9), dtype=np.float32)
        call("take_upper", self.rows, offsets, columns, inside.values, self._offsets, self._columns, self._values)
        self._beyond = beyond(matrix, np.float32, partial(call, "multiply_beyond"))

    def multiply(self, x: Single, y: Single) -> None:
        """Write A x into ``y``; collective."""
        begun = self._beyond and self._beyond.begin(x)
        call("multiply", self.rows, self._offsets, self._offsets, self._columns, self._values, x, y)
        if self._beyond and begun:
            self._beyond.add(begun, y)

    def diagonal(self) -> Single:
        """Return the blocks on the diagonal, shape (rows, 9)."""
        return self._values[self._offsets[:-1]]


class SymmetricProduct:
    """A symmetric operator in double, of which the blocks from the diagonal on are read: a context for PETSc.

    Its own product reads all of them, and no faster.
    """

    def __init__(self, matrix: PETSc.Mat):
        """Refer to the entries of a matrix, in blocks, which must live as long; collective."""
        inside, _, _ = blocks_to_read(matrix)
        self._offsets, self._columns, self._blocks = inside.offsets, inside.columns, inside.values
        self._beyond = beyond(matrix, np.float64, partial(call, "multiply_beyond_double"))
        rows = np.repeat(np.arange(len(self._offsets) - 1, dtype=np.int32), np.diff(self._offsets))
        self._diagonal = np.flatnonzero(self._columns == rows).astype(np.int32)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write A x into ``y``."""
        given, result = x.array_r, y.array_w
        begun = self._beyond and self._beyond.begin(given)
        call("multiply_double", len(self._diagonal), self._diagonal, self._offsets, self._columns, self._blocks,
                  given, result)  # fmt: skip
        if self._beyond and begun:
            self._beyond.add(begun, result)
