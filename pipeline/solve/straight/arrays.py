"""The arrays inside PETSc's sparse matrices, which petsc4py does not lend: the one place with ctypes.

Where this build of PETSc does not let us at them, :func:`available` says so, and dolfinx assembles.
"""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

_KINDS = {"seqaij": "SeqAIJ", "seqbaij": "SeqBAIJ"}


def sparse_matrix(offsets: np.ndarray, columns: np.ndarray, block: int) -> PETSc.Mat:
    """Return a square matrix of zeros, of this process alone, in sparse rows whose columns ascend.

    Of type seqbaij if rows and columns are of blocks of ``block``, else (1) seqaij, for vectors of three components.

    Raises:
        RuntimeError: if PETSc does not take the pattern.
    """
    count, size, indices = np.diff(offsets), block * (len(offsets) - 1), columns.astype(PETSc.IntType, copy=False)
    create, kind = (PETSc.Mat().createBAIJ, "SeqBAIJ") if block > 1 else (PETSc.Mat().createAIJ, "SeqAIJ")
    matrix = create(((size, None), (size, None)), 3, nnz=count.astype(PETSc.IntType), comm=MPI.COMM_SELF)
    _call(f"Mat{kind}SetColumnIndices", matrix, ctypes.c_void_p(indices.ctypes.data))
    matrix.assemble()
    matrix.zeroEntries()
    return matrix


@contextmanager
def entries(matrix: PETSc.Mat, count: int) -> Iterator[np.ndarray]:
    """Lend the ``count`` entries of a matrix, seqaij or seqbaij, there block by block by columns, to write to.

    Raises:
        RuntimeError: if PETSc does not lend them.
    """
    with _array(matrix) as values:
        yield np.ctypeslib.as_array(values, (count,))
    matrix.assemble()  # what was made of the values before is void


def entries_to_read(matrix: PETSc.Mat, count: int) -> np.ndarray:
    """Return the ``count`` entries of a matrix, as :func:`entries` does, to read for as long as the matrix lives.

    Raises:
        RuntimeError: if PETSc does not lend them.
    """
    with _array(matrix) as values:
        return np.ctypeslib.as_array(values, (count,))


@contextmanager
def _array(matrix: PETSc.Mat) -> Iterator[Any]:
    kind, values = _KINDS[matrix.getType()], ctypes.POINTER(ctypes.c_double)()
    _call(f"Mat{kind}GetArray", matrix, ctypes.byref(values))
    try:
        yield values
    finally:
        _call(f"Mat{kind}RestoreArray", matrix, ctypes.byref(values))


@cache
def available() -> bool:
    """Tell whether it works here: what is written into two small matrices is read from them."""
    if PETSc.ScalarType != np.float64:
        return False
    # Of three points: petsc4py takes two numbers of entries a row for those of two kinds of rows.
    offsets, columns = np.array([0, 1, 3, 5], dtype=np.int32), np.array([0, 0, 1, 0, 2], dtype=np.int32)
    try:
        return all(_holds(offsets, columns, block) for block in (1, 3))
    except (AttributeError, OSError, RuntimeError, PETSc.Error):
        return False


def _holds(offsets: np.ndarray, columns: np.ndarray, block: int) -> bool:
    """Tell whether the entries are where they were put; without blocks, those of a diagonal."""
    if block == 1:
        offsets, columns = np.arange(10, dtype=np.int32), np.arange(9, dtype=np.int32)
    matrix = sparse_matrix(offsets, columns, block)
    try:
        count = block**2 * len(columns)
        with entries(matrix, count) as values:
            values[:] = np.arange(count)
        size = matrix.getSize()[0]
        found = matrix.getValues(range(size), range(size))
        expected = np.zeros((size, size))
        rows = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
        for number, (row, column) in enumerate(zip(rows, columns, strict=True)):
            first = block**2 * number
            part = np.arange(first, first + block**2).reshape(block, block).T
            expected[block * row : block * (row + 1), block * column : block * (column + 1)] = part
        return bool(np.array_equal(found, expected))
    finally:
        matrix.destroy()


@cache
def _petsc() -> ctypes.CDLL:
    return ctypes.CDLL(PETSc.__file__)


def _call(name: str, matrix: PETSc.Mat, argument: object) -> None:
    if getattr(_petsc(), name)(ctypes.c_void_p(matrix.handle), argument):
        raise RuntimeError(f"PETSc failed in {name}")
