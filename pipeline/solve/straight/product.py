"""The stiffness of a space of displacements as a product, cell by cell: no pattern, no matrix, nothing assembled.

A blocked matrix of degree 3 takes 15 kB a tetrahedron, and a product with it the time to read them; here a cell takes
200 bytes and 2,000 vectorised multiplications (``product.c``). Cells with curved edges, which are few, keep a matrix
of their own.
"""

import itertools
from copy import copy
from dataclasses import dataclass
from functools import cache
from math import factorial, prod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve.material import MaterialLaw
from pipeline.solve.parcels import ghosts_of
from pipeline.solve.straight import arrays, native
from pipeline.solve.straight.native import Library
from pipeline.solve.straight.pattern import corners, owned_cells, reference, straight_cells

Single = npt.NDArray[np.float32]

# Cells that are taken side by side, as product.c has it.
_LANES = 16
DEGREES = (2, 3, 4)
# What takes points to coefficients is sparse but for rounding.
_NOTHING = 1e-12

_PRODUCT = """
void {name}(int degree, int batches, const int* dofs, const {type}* maps, const {type}* lame, const int* first,
            const int* column, const {type}* weight, const int* first_back, const int* column_back,
            const {type}* weight_back, const int* raised, const {type}* mass, const {type}* x, {type}* y);
"""
_BLOCKS = """
void {name}(int count, const int* rows, const int* offsets, const int* columns, const {type}* blocks, const {type}* x,
            {type}* y);
"""
_DECLARATIONS = """
void map_cells(int count, const int* which, const double* corners, double* maps);
void add_diagonal(int count, int points, const int* dofs, const double* maps, const double* lame, const double* S,
                  float* diagonal);
""" + "".join(
    text.format(name=name + end, type=kind)
    for name, text in (("add_product", _PRODUCT), ("add_blocks", _BLOCKS))
    for end, kind in (("", "float"), ("_double", "double"))
)


@cache
def library() -> Library:
    """Return the functions of ``product.c``, compiled if they are not yet."""
    return Library(Path(__file__).with_name("product.c"), _DECLARATIONS)


@cache
def compiles() -> bool:
    """Tell whether C with vectors can be compiled here."""
    return native.compiles(library)


@dataclass(frozen=True)
class Transform:
    """A sparse matrix and its transpose, by rows: offsets, columns, weights, and again."""

    first: Int32Array
    column: Int32Array
    weight: np.ndarray
    first_back: Int32Array
    column_back: Int32Array
    weight_back: np.ndarray


@dataclass(frozen=True)
class Bernstein:
    """What a degree has on the reference cell: values at points to coefficients, places of b + e_a, mass times p²."""

    transform: Transform
    raised: Int32Array
    mass: np.ndarray


@cache
def bernstein(degree: int, kind: str) -> Bernstein:
    """Return the tables of Bernstein's polynomials of ``degree``, in numbers of a ``kind`` (of numpy)."""
    high, low = _indices(degree), _indices(degree - 1)
    points = compat.reference_element(degree).points
    barycentric = np.hstack([1 - points.sum(axis=1, keepdims=True), points])
    values = np.array([_multinomial(b) * (barycentric ** np.array(b)).prod(axis=1) for b in high]).T
    matrix = np.linalg.inv(values)
    matrix[np.abs(matrix) < _NOTHING] = 0.0
    place = {b: number for number, b in enumerate(high)}
    raised = [[place[tuple(np.add(b, unit))] for unit in np.eye(4, dtype=int)] for b in low]
    # The integral of a monomial of barycentric coordinates: b! / (|b| + 3)!.
    mass = [[_multinomial(b) * _multinomial(c) * _factorials(tuple(np.add(b, c))) for c in low] for b in low]
    scale = degree**2 / factorial(2 * degree + 1)
    return Bernstein(
        Transform(*_rows(matrix, kind), *_rows(matrix.T, kind)), np.array(raised, dtype=np.int32),
        (scale * np.array(mass)).astype(kind),
    )  # fmt: skip


class CellStiffness:
    """The cells of this rank, laid out for products: the straight ones, and the others.

    ``curved`` tells for each local cell whether it is, None if none is; ``prescribed`` are the local dofs (unrolled)
    whose rows and columns the operator does not have; ``regions`` number what cells are made of. Of its ``local``
    points a rank owns the first ``points``; others own those that are ``shared``, None on one process.
    """

    def __init__(self, space: Any, curved: BoolArray | None, prescribed: Int32Array, regions: Int32Array | None = None):
        """Collective."""
        index_map, self.comm, self.degree = space.dofmap.index_map, space.mesh.comm, compat.degree(space)
        self.points, self.local = index_map.size_local, index_map.size_local + index_map.num_ghosts
        self.prescribed, self.shared = prescribed[prescribed < 3 * self.points], ghosts_of(space)
        dofs = owned_cells(space)
        self._which = straight_cells(curved, len(dofs))
        self._regions = np.zeros(len(dofs), dtype=np.int32) if regions is None else regions
        self.batches = -(-len(self._which) // _LANES)
        # What fills up the last batch adds nought to any point, say the first.
        filled = np.zeros((self.batches * _LANES, dofs.shape[1]), dtype=np.int32)
        filled[: len(self._which)] = dofs[self._which]
        self.dofs = np.ascontiguousarray(filled.reshape(self.batches, _LANES, -1).transpose(0, 2, 1))
        maps = np.zeros((self.batches, 9, _LANES))
        library()("map_cells", len(self._which), self._which, corners(space.mesh), maps)
        self.maps: dict[str, np.ndarray] = {"float64": maps, "float32": maps.astype(np.float32)}
        bent = np.empty(0, dtype=np.int64) if curved is None else np.flatnonzero(curved[: len(dofs)])
        self._bent = dofs[bent] if len(bent) else None

    def curved_matrix(self) -> PETSc.Mat | None:
        """Return a matrix of zeros for the curved cells, of type seqbaij, None if there are none; to be destroyed."""
        if self._bent is None:
            return None
        offsets = np.arange(0, self._bent.size + 1, self._bent.shape[1], dtype=np.int32)
        shape = len(self._bent), self.local
        visited = sp.csr_matrix((np.ones(self._bent.size, dtype=np.bool_), self._bent.reshape(-1), offsets), shape)
        graph = (visited.T @ visited).tocsr()
        graph.sort_indices()
        return arrays.sparse_matrix(graph.indptr, graph.indices, 3)

    def lame(self, law: MaterialLaw) -> FloatArray:
        """Return λ and μ (Pa) of the straight cells, shape (batches, 2, lanes)."""
        # A law of one material holds for every region.
        region = self._regions[self._which] if len(law.lame_mu) > 1 else np.zeros(len(self._which), dtype=np.int32)
        values = np.zeros((2, self.batches * _LANES))
        values[:, : len(region)] = np.array([law.lame_lambda, law.lame_mu], dtype=np.float64)[:, region]
        return np.ascontiguousarray(values.reshape(2, self.batches, _LANES).transpose(1, 0, 2))

    def add_diagonal(self, lame: FloatArray, blocks: Single) -> None:
        """Add the blocks on the diagonal, of the straight cells, to ``blocks`` (local, 9)."""
        weights, _, gradients = reference(self.degree, 2 * self.degree - 2)
        tensors = np.einsum("q,aqi,bqi->abi", weights, gradients, gradients)
        library()("add_diagonal", len(self._which), self.dofs.shape[1], self.dofs, self.maps["float64"], lame,
                  np.ascontiguousarray(tensors), blocks)  # fmt: skip


class CellOperator:
    """The stiffness of a material as a product: a context for PETSc, without entries.

    Prescribed dofs are left as they are. In double precision, or, by :meth:`multiply`, in single precision. On several
    ranks each multiplies with its own cells, what others' points have is read first, and what they get added last:
    products and diagonals are collective.
    """

    def __init__(self, cells: CellStiffness, law: MaterialLaw, curved: PETSc.Mat | None):
        """Take the entries of the matrix of the ``curved`` cells, without conditions, if there are any."""
        self._cells, self.rows, self.prescribed, self.comm = cells, cells.points, cells.prescribed, cells.comm
        lame = cells.lame(law)
        self._lame: dict[str, np.ndarray] = {"float64": lame, "float32": lame.astype(np.float32)}
        self._few = {kind: None if curved is None else Blocks.of(curved, kind) for kind in self._lame}

    def holding(self, dofs: Int32Array) -> "CellOperator":
        """Return the operator in which ``dofs`` (unrolled) are prescribed, too; it shares everything else."""
        other = copy(self)
        other.prescribed = np.union1d(self.prescribed, dofs[dofs < 3 * self.rows]).astype(np.int32)
        return other

    def matrix(self) -> PETSc.Mat:
        """Return it as a matrix of PETSc; the caller destroys it."""
        size = 3 * self.rows, None
        matrix = PETSc.Mat().createPython((size, size), self, comm=self.comm)
        matrix.setUp()
        return matrix

    def multiply(self, x: Single, y: Single) -> None:
        """Write A x into ``y``; what is prescribed must be nought in ``x``, and is anything in ``y``."""
        y[:] = 0
        self._add(x, y, "float32")

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write A x into ``y``; PETSc calls this."""
        given, result = x.array_r, y.array_w
        values = given[self.prescribed]
        if values.any():
            given = given.copy()
            given[self.prescribed] = 0.0
        result[:] = 0.0
        self._add(given, result, "float64")
        result[self.prescribed] = values

    @property
    def nbytes(self) -> int:
        """Bytes of all that it reads."""
        few = [
            part for kind in self._few.values() if kind is not None for part in (kind.rows, kind.columns, kind.blocks)
        ]
        return sum(part.nbytes for part in (self._cells.dofs, *self._cells.maps.values(), *self._lame.values(), *few))

    def diagonal(self) -> Single:
        """Return the blocks on the diagonal, shape (points, 9), as if nothing was prescribed."""
        blocks = np.zeros((self._cells.local, 9), dtype=np.float32)
        self._cells.add_diagonal(self._lame["float64"], blocks)
        if (few := self._few["float32"]) is not None:
            blocks[few.rows] += few.blocks[few.offsets[:-1]]
        if self._cells.shared is not None:
            self._cells.shared.add(blocks[self.rows :], blocks[: self.rows])
        return blocks[: self.rows]

    def _add(self, x: np.ndarray, y: np.ndarray, kind: str) -> None:
        if (shared := self._cells.shared) is None:
            self._add_cells(x, y, kind)
            return
        given = shared.extend(x)
        found = np.zeros_like(given)
        self._add_cells(given, found, kind)
        shared.fold(found, y)

    def _add_cells(self, x: np.ndarray, y: np.ndarray, kind: str) -> None:
        end, cells, table = "" if kind == "float32" else "_double", self._cells, bernstein(self._cells.degree, kind)
        by = table.transform
        library()(
            f"add_product{end}", cells.degree, cells.batches, cells.dofs, cells.maps[kind], self._lame[kind], by.first,
            by.column, by.weight, by.first_back, by.column_back, by.weight_back, table.raised, table.mass, x, y,
        )  # fmt: skip
        if (few := self._few[kind]) is not None:
            library()(f"add_blocks{end}", len(few.rows), few.rows, few.offsets, few.columns, few.blocks, x, y)


def is_product(matrix: PETSc.Mat) -> bool:
    """Tell whether a matrix is an operator of cells, without entries."""
    return matrix.getType() == "python" and isinstance(matrix.getPythonContext(), CellOperator)


@dataclass(frozen=True)
class Blocks:
    """Those rows of a symmetric matrix that have any, from the diagonal on: blocks (n, 9), by rows."""

    rows: Int32Array
    offsets: Int32Array
    columns: Int32Array
    blocks: np.ndarray

    @classmethod
    def of(cls, matrix: PETSc.Mat, kind: str) -> "Blocks":
        """Take them from a matrix of type seqbaij, with numbers of a ``kind``."""
        offsets, columns = (index.astype(np.int32, copy=False) for index in matrix.getRowIJ(compressed=True)[:2])
        row = np.repeat(np.arange(len(offsets) - 1, dtype=np.int32), np.diff(offsets))
        upper = np.flatnonzero(columns >= row)
        # PETSc has them by columns.
        values = arrays.entries_to_read(matrix, 9 * len(columns)).reshape(-1, 3, 3)[upper].transpose(0, 2, 1)
        rows, count = np.unique(row[upper], return_counts=True)
        return cls(
            rows, np.concatenate([[0], np.cumsum(count)]).astype(np.int32), columns[upper],
            np.ascontiguousarray(values, dtype=kind).reshape(-1, 9),
        )  # fmt: skip


def _indices(degree: int) -> list[tuple[int, ...]]:
    return [b for b in itertools.product(range(degree + 1), repeat=4) if sum(b) == degree]


def _factorials(b: tuple[int, ...]) -> int:
    return prod(factorial(int(part)) for part in b)


def _multinomial(b: tuple[int, ...]) -> float:
    return factorial(sum(b)) / _factorials(b)


def _rows(matrix: FloatArray, kind: str) -> tuple[Int32Array, Int32Array, np.ndarray]:
    sparse = sp.csr_matrix(matrix)
    return sparse.indptr.astype(np.int32), sparse.indices.astype(np.int32), sparse.data.astype(kind)
