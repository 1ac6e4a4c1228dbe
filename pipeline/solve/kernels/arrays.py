"""The arrays inside PETSc's sparse matrices, which petsc4py does not lend: the one place with ctypes.

On several ranks a matrix has two parts on each: the columns that are the rank's own, and those of others.
Where this build of PETSc does not let us at them, :func:`available` says so, and dolfinx assembles.
"""

import ctypes
import itertools
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import FloatArray, Int32Array, IntArray

_KINDS = {"seqaij": "SeqAIJ", "seqbaij": "SeqBAIJ", "mpiaij": "SeqAIJ", "mpibaij": "SeqBAIJ"}


def sparse_matrix(offsets: np.ndarray, columns: np.ndarray, block: int) -> PETSc.Mat:
    """Return a square matrix of zeros, of this process alone, in sparse rows whose columns ascend.

    Of type seqbaij if rows and columns are of blocks of ``block``, else (1) seqaij, for vectors of three components.

    Raises:
        RuntimeError: if PETSc does not take the pattern.
    """
    size = block * (len(offsets) - 1)
    create, kind = (PETSc.Mat().createBAIJ, "SeqBAIJ") if block > 1 else (PETSc.Mat().createAIJ, "SeqAIJ")
    matrix = create(((size, None), (size, None)), 3, nnz=_counts(offsets), comm=MPI.COMM_SELF)
    _set_columns(kind, matrix.handle, columns)
    matrix.assemble()
    matrix.zeroEntries()
    return matrix


def shared_matrix(
    comm: MPI.Comm, inside: tuple[np.ndarray, np.ndarray], outside: tuple[np.ndarray, np.ndarray], block: int
) -> PETSc.Mat:
    """Return a square matrix of zeros on several ranks, in sparse rows (offsets, columns) whose columns ascend.

    Columns ``inside`` count from this rank's first, those ``outside`` are others', counted from the first of all.
    Of type mpibaij or mpiaij, as :func:`sparse_matrix` has it; collective.

    Raises:
        RuntimeError: if PETSc does not take the pattern.
    """
    size = block * (len(inside[0]) - 1)
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes(((size, None), (size, None)), 3)
    matrix.setType("mpibaij" if block > 1 else "mpiaij")
    matrix.setPreallocationNNZ((_counts(inside[0]), _counts(outside[0])))
    for handle, (_, columns) in zip(_handles(matrix)[:2], (inside, outside), strict=True):
        _set_columns(_KINDS[matrix.getType()], handle, columns)
    matrix.assemble()
    matrix.zeroEntries()
    return matrix


def set_local_numbers(matrix: PETSc.Mat, maps: Sequence[Any], widths: tuple[int, int]) -> None:
    """Let dolfinx add to a matrix by the local numbers of two index maps, of blocks of ``widths``; collective."""
    numbers = [
        PETSc.LGMap().create(np.append(np.arange(*m.local_range), m.ghosts).astype(PETSc.IntType), w, matrix.comm)
        for m, w in zip(maps, widths, strict=True)
    ]
    matrix.setLGMap(*numbers)
    for item in numbers:
        item.destroy()


@contextmanager
def entries(matrix: PETSc.Mat, count: int) -> Iterator[FloatArray]:
    """Lend the ``count`` entries of a matrix of one process, block by block by columns if it has any, to write to.

    Raises:
        RuntimeError: if PETSc does not lend them.
    """
    with entries_of_parts(matrix, count, 0) as (values, _):
        yield values


@contextmanager
def entries_of_parts(matrix: PETSc.Mat, inside: int, outside: int) -> Iterator[list[FloatArray]]:
    """Lend the entries of both parts of a matrix, so many, to write to; collective. On one process none are outside.

    Raises:
        RuntimeError: if PETSc does not lend them.
    """
    with ExitStack() as stack:
        yield [
            np.ctypeslib.as_array(stack.enter_context(_array(matrix, handle)), (count,)) if count else np.empty(0)
            for handle, count in itertools.zip_longest(_handles(matrix)[:2], (inside, outside))
        ]
    matrix.assemble()  # what was made of the values before is void


@dataclass(frozen=True)
class BlockRows:
    """Sparse rows of blocks of 3 × 3 (``offsets``, ``columns``), and their numbers, block by block by columns."""

    offsets: Int32Array
    columns: Int32Array
    values: FloatArray


def blocks_to_read(matrix: PETSc.Mat) -> tuple[BlockRows, BlockRows, IntArray]:
    """Return the rows of this rank of a matrix in blocks, to read for as long as it lives: its two parts.

    Columns of the first are this rank's, those of the second number the points of other ranks that come third,
    ascending.

    Raises:
        RuntimeError: if PETSc does not lend them.
    """
    inside, outside, others = (*_handles(matrix), None, None)[:3]
    first = _block_rows(matrix, inside)
    if outside is None:
        nothing = BlockRows(np.zeros_like(first.offsets), first.columns[:0], first.values[:0])
        return first, nothing, np.empty(0, np.int64)
    second = _block_rows(matrix, outside)
    count = int(second.columns.max(initial=-1)) + 1
    numbers = np.ctypeslib.as_array(others, (count,)).astype(np.int64) if count else np.empty(0, np.int64)
    return first, second, numbers


def _block_rows(matrix: PETSc.Mat, handle: int) -> BlockRows:
    count, done = _Int(), ctypes.c_int()
    starts, columns = ctypes.POINTER(_Int)(), ctypes.POINTER(_Int)()
    arguments = [ctypes.byref(item) for item in (count, starts, columns, done)]
    _call("MatGetRowIJ", handle, _Int(0), 0, 1, *arguments)
    try:
        offsets = np.ctypeslib.as_array(starts, (count.value + 1,)).astype(np.int32)
        found = np.ctypeslib.as_array(columns, (int(offsets[-1]),)).astype(np.int32) if offsets[-1] else _NONE
    finally:
        _call("MatRestoreRowIJ", handle, _Int(0), 0, 1, *arguments)
    if not len(found):
        return BlockRows(offsets, found, np.empty(0))
    with _array(matrix, handle) as values:
        return BlockRows(offsets, found, np.ctypeslib.as_array(values, (9 * len(found),)))


@contextmanager
def _array(matrix: PETSc.Mat, handle: int) -> Iterator[Any]:
    kind, values = _KINDS[matrix.getType()], ctypes.POINTER(ctypes.c_double)()
    _call(f"Mat{kind}GetArray", handle, ctypes.byref(values))
    try:
        yield values
    finally:
        _call(f"Mat{kind}RestoreArray", handle, ctypes.byref(values))


def _handles(matrix: PETSc.Mat) -> tuple[Any, ...]:
    """Return the handles of a matrix's parts on this rank, and, of two, the points that columns of the other number."""
    kind = matrix.getType()
    if kind.startswith("seq"):
        return (matrix.handle,)
    inside, outside, others = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.POINTER(_Int)()
    name = "MatMPIBAIJGetSeqBAIJ" if kind == "mpibaij" else "MatMPIAIJGetSeqAIJ"
    _call(name, matrix.handle, *(ctypes.byref(item) for item in (inside, outside, others)))
    return inside.value, outside.value, others


def _set_columns(kind: str, handle: int, columns: np.ndarray) -> None:
    indices = np.ascontiguousarray(columns, dtype=PETSc.IntType)
    _call(f"Mat{kind}SetColumnIndices", handle, ctypes.c_void_p(indices.ctypes.data))


def _counts(offsets: np.ndarray) -> np.ndarray:
    return np.diff(offsets).astype(PETSc.IntType)


@cache
def available() -> bool:
    """Tell whether it works here: what is written into small matrices is read from them."""
    if PETSc.ScalarType != np.float64:
        return False
    # Of three points: petsc4py takes two numbers of entries a row for those of two kinds of rows.
    offsets, columns = np.array([0, 1, 3, 5], dtype=np.int32), np.array([0, 0, 1, 0, 2], dtype=np.int32)
    try:
        return all(_holds(offsets, columns, block, shared=shared) for block in (1, 3) for shared in (False, True))
    except (AttributeError, OSError, RuntimeError, PETSc.Error):
        return False


def _holds(offsets: np.ndarray, columns: np.ndarray, block: int, *, shared: bool) -> bool:
    """Tell whether the entries are where they were put; without blocks, those of a diagonal."""
    if block == 1:
        offsets, columns = np.arange(10, dtype=np.int32), np.arange(9, dtype=np.int32)
    if shared:  # a matrix of several ranks may have one
        matrix = shared_matrix(MPI.COMM_SELF, (offsets, columns), (np.zeros_like(offsets), columns[:0]), block)
    else:
        matrix = sparse_matrix(offsets, columns, block)
    try:
        count = block**2 * len(columns)
        with entries_of_parts(matrix, count, 0) as (values, _):
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


_Int = ctypes.c_int32 if np.dtype(PETSc.IntType).itemsize == 4 else ctypes.c_int64
_NONE = np.empty(0, dtype=np.int32)


@cache
def _petsc() -> ctypes.CDLL:
    return ctypes.CDLL(PETSc.__file__)


def _call(name: str, handle: int, *arguments: object) -> None:
    if getattr(_petsc(), name)(ctypes.c_void_p(handle), *arguments):
        raise RuntimeError(f"PETSc failed in {name}")
