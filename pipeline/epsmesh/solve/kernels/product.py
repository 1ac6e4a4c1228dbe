"""Matrix-free stiffness of a space of displacements, cell by cell.

A blocked matrix of degree 3 takes 15 kB per tetrahedron, and a product with it the time to read them. The matrix-free
product takes 200 bytes and 2,000 vectorised multiplications per cell (``product.c``). Curved cells use quadrature.
"""

import itertools
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property
from math import factorial, prod
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve.kernels.cells import (
    CurvedCells,
    Ghosts,
    Lanes,
    StraightMaps,
    corners,
    owned_cells,
    reference,
    roots,
    straight_cells,
)
from epsmesh.solve.kernels.native import Single, call, precision
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.variation import Factors

DEGREES = (2, 3, 4)
# The map from values to coefficients is sparse up to rounding of this size.
_NOTHING = 1e-12


class Rows(NamedTuple):
    """A sparse matrix in compressed rows."""

    offsets: Int32Array
    columns: Int32Array
    weights: np.ndarray


@dataclass(frozen=True)
class Bernstein:
    """Tables of a degree on the reference cell.

    ``forward`` maps values at points to coefficients, ``back`` is its transpose. ``raised`` are the positions of
    b + e_a, ``mass`` is the mass matrix times p².
    """

    forward: Rows
    back: Rows
    raised: Int32Array
    mass: np.ndarray


@cache
def bernstein(degree: int, kind: str) -> Bernstein:
    """Return the tables of Bernstein polynomials of ``degree``, in numpy's type ``kind``."""
    high, low = _indices(degree), _indices(degree - 1)
    points = compat.reference_element(degree).points
    barycentric = np.hstack([1 - points.sum(axis=1, keepdims=True), points])
    values = np.array([_multinomial(b) * (barycentric ** np.array(b)).prod(axis=1) for b in high]).T
    matrix = np.linalg.inv(values)
    matrix[np.abs(matrix) < _NOTHING] = 0.0
    place = {b: number for number, b in enumerate(high)}
    raised = [[place[tuple(np.add(b, unit))] for unit in np.eye(4, dtype=int)] for b in low]
    # Integral of a monomial in barycentric coordinates: b! / (|b| + 3)!.
    mass = [[_multinomial(b) * _multinomial(c) * _factorials(tuple(np.add(b, c))) for c in low] for b in low]
    scale = degree**2 / factorial(2 * degree + 1)
    return Bernstein(
        forward=_rows(matrix, kind),
        back=_rows(matrix.T, kind),
        raised=np.array(raised, dtype=np.int32),
        mass=(scale * np.array(mass)).astype(kind),
    )


class SparsePart:
    """A sparse ``matrix``, without conditions, that is added to a matrix-free operator."""

    def __init__(self, matrix: PETSc.Mat):
        self.matrix = matrix
        self._given, self._found = matrix.createVecs()

    def add_product(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with ``x`` to ``y``, owned dofs; collective."""
        self._given.array[:] = x
        self.matrix.mult(self._given, self._found)
        y += self._found.array

    def diagonal(self) -> FloatArray:
        """Return the diagonal blocks (points, 9)."""
        offsets, columns, values = self.matrix.getValuesCSR()
        first, last = self.matrix.getOwnershipRange()
        blocks = np.zeros((last - first) * 3)
        rows = np.repeat(np.arange(first, last), np.diff(offsets))
        own = rows // 3 == columns // 3
        blocks[3 * (rows[own] - first) + columns[own] % 3] = values[own]
        return blocks.reshape(-1, 9)


class CellStiffness:
    """The cells of this rank, laid out for products: straight ones and curved ones.

    ``curved`` is a mask of local cells, or None if none is curved. ``prescribed`` are the local dofs (unrolled) without
    rows and columns in the operator. ``regions`` are the numbers of the cells' regions. ``straight`` are the maps that
    spaces of one mesh share. ``factors`` are those of the energy of local cells: they count as volume.
    """

    def __init__(
        self,
        space: Any,
        curved: BoolArray | None,
        prescribed: Int32Array,
        regions: Int32Array | None = None,
        straight: StraightMaps | None = None,
        factors: Factors | None = None,
    ):
        """Lay out the cells; collective."""
        self._mesh, self._factors = space.mesh, factors
        self.comm, self.degree, self.ghosts = space.mesh.comm, compat.degree(space), Ghosts(space)
        self.prescribed = prescribed[prescribed < 3 * self.ghosts.owned]
        dofs, self.regions = owned_cells(space), regions
        self.lanes = Lanes(straight_cells(curved, len(dofs)), dofs)
        self.maps = (straight or StraightMaps(space.mesh, curved, factors)).both
        bent = np.empty(0) if curved is None else np.flatnonzero(curved[: len(dofs)])
        self.curved = CurvedCells(space, bent.astype(np.int32), dofs, factors) if len(bent) else None

    @cached_property
    def roots(self) -> FloatArray:
        """The roots that the maps of straight cells have as a factor, (batches, 1, lanes)."""
        which = self.lanes.which
        found = roots(corners(self._mesh)[which])
        return self.lanes.spread(
            (found if self._factors is None else found * np.sqrt(self._factors.means[which]))[:, None]
        )

    def operator(self, law: MaterialLaw, further: Sequence[SparsePart] = ()) -> "CellOperator":
        """Return the stiffness of a material, with ``further`` parts."""
        lanes = [self.lanes] if self.curved is None else [self.lanes, self.curved.lanes]
        lame = [each.lame(law, self.regions) for each in lanes]
        return CellOperator(self, {"float64": lame, "float32": [each.astype(np.float32) for each in lame]}, further)

    @property
    def nbytes(self) -> int:
        """Bytes of geometry that a product reads."""
        straight = self.lanes.dofs.nbytes + sum(maps.nbytes for maps in self.maps.values())
        return straight + (0 if self.curved is None else self.curved.nbytes)

    def add_product(self, lame: list[np.ndarray], x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with ``x``, on local points, to ``y``; all in one precision."""
        kind = precision(x)
        end, table = "_double" if kind == "float64" else "", bernstein(self.degree, kind)
        cells = self.degree, self.lanes.batches, self.lanes.dofs, self.maps[kind], lame[0]
        call(f"add_product{end}", *cells, *table.forward, *table.back, table.raised, table.mass, x, y)
        if self.curved is not None:
            self.curved.add_product(lame[1], x, y)

    def diagonal(self, lame: list[FloatArray]) -> Single:
        """Return the diagonal blocks (local, 9), contributions of this rank's cells only."""
        blocks = np.zeros((self.ghosts.local, 9), dtype=np.float32)
        weights, _, gradients = reference(self.degree, 2 * self.degree - 2)
        tensors = np.ascontiguousarray(np.einsum("q,aqi,bqi->abi", weights, gradients, gradients))
        sizes = len(self.lanes.which), self.lanes.dofs.shape[1]
        call("add_diagonal", *sizes, self.lanes.dofs, self.maps["float64"], lame[0], tensors, blocks)
        if self.curved is not None:
            self.curved.add_diagonal(lame[1], blocks)
        return blocks


class Cells(Protocol):
    """The cells of a rank, laid out for products with ``coefficients`` of each cell.

    Products and diagonal blocks are contributions of this rank's cells only, without conditions.
    """

    comm: MPI.Comm
    ghosts: Ghosts
    prescribed: Int32Array

    @property
    def nbytes(self) -> int: ...  # noqa: D102

    def add_product(self, coefficients: list[np.ndarray], x: np.ndarray, y: np.ndarray) -> None: ...  # noqa: D102

    def diagonal(self, coefficients: list[np.ndarray]) -> Single: ...  # noqa: D102


class Joined(Protocol):
    """Other unknowns v of an operator, u = S v: see :class:`epsmesh.solve.contact.numbering.Pairs`."""

    def join(self, values: np.ndarray) -> None: ...  # noqa: D102
    def part(self, values: np.ndarray) -> None: ...  # noqa: D102
    def unfold(self, values: np.ndarray) -> None: ...  # noqa: D102
    def fold(self, values: np.ndarray) -> None: ...  # noqa: D102
    def fold_blocks(self, blocks: np.ndarray) -> None: ...  # noqa: D102


class CellOperator:
    """A matrix-free stiffness or tangent, with the ``coefficients`` of cells by precision: a context for PETSc.

    It includes ``further`` sparse parts. Rows of prescribed dofs are the identity's. Products are in double precision,
    or by :meth:`multiply` in single precision. On several ranks each multiplies with its own cells, between two ghost
    exchanges: products and diagonals are collective.
    """

    def __init__(self, cells: Cells, coefficients: dict[str, list[np.ndarray]], further: Sequence[SparsePart] = ()):
        self._cells, self.rows, self.prescribed, self.comm = cells, cells.ghosts.owned, cells.prescribed, cells.comm
        self._coefficients, self._further = coefficients, further
        self._pairs: Joined | None = None

    def joined(self, pairs: Joined) -> "CellOperator":
        """Return the operator Sᵀ A S of other unknowns; it shares everything else."""
        other = copy(self)
        other._pairs = pairs
        return other

    def holding(self, dofs: Int32Array) -> "CellOperator":
        """Return the operator with ``dofs`` (unrolled) prescribed, too; it shares everything else."""
        other = copy(self)
        other.prescribed = np.union1d(self.prescribed, dofs[dofs < 3 * self.rows]).astype(np.int32)
        return other

    def matrix(self) -> PETSc.Mat:
        """Return the operator as a PETSc matrix; the caller destroys it."""
        size = 3 * self.rows, None
        matrix = PETSc.Mat().createPython((size, size), self, comm=self.comm)
        matrix.setUp()
        return matrix

    def multiply(self, x: Single, y: Single) -> None:
        """Write A x into ``y``; prescribed dofs must be zero in ``x``, and are undefined in ``y``."""
        self._write(x, y)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write A x into ``y``; PETSc calls this."""
        self.product(x.array_r, y.array_w)

    def product(self, given: FloatArray, result: FloatArray) -> None:
        """Write A times ``given``, owned dofs, into ``result``."""
        values = given[self.prescribed]
        if values.any():
            given = given.copy()
            given[self.prescribed] = 0.0
        self._write(given, result)
        result[self.prescribed] = values

    def whole(self, x: FloatArray) -> FloatArray:
        """Return A x for the displacement of the owned points, without conditions."""
        result = np.empty(3 * self.rows)
        self._write(x, result)
        return result

    @property
    def nbytes(self) -> int:
        """Bytes that a product reads."""
        return self._cells.nbytes + sum(each.nbytes for kind in self._coefficients.values() for each in kind)

    def diagonal(self) -> Single:
        """Return the diagonal blocks (points, 9), without conditions."""
        blocks = self._cells.diagonal(self._coefficients["float64"])
        found = self._cells.ghosts.folded(blocks.reshape(-1), 9).reshape(-1, 9)
        for part in self._further:
            found += part.diagonal()
        if self._pairs is not None:
            self._pairs.fold_blocks(found)
        return found

    def _write(self, x: np.ndarray, y: np.ndarray) -> None:
        if self._pairs is not None:
            x = x.copy()
            self._pairs.join(x)
        self._write_cells(x, y)
        for part in self._further:
            part.add_product(x, y)
        if self._pairs is not None:
            self._pairs.fold(y)

    def _write_cells(self, x: np.ndarray, y: np.ndarray) -> None:
        cells, coefficients = self._cells, self._coefficients[precision(x)]
        if self.comm.size == 1:
            y[:] = 0.0
            cells.add_product(coefficients, x, y)
            return
        found = np.zeros(3 * cells.ghosts.local, dtype=x.dtype)
        cells.add_product(coefficients, cells.ghosts.extended(x, 3), found)
        y[:] = cells.ghosts.folded(found, 3)


def operator_of(matrix: PETSc.Mat) -> CellOperator:
    """Return the cell operator behind a matrix-free PETSc matrix."""
    operator: CellOperator = matrix.getPythonContext()
    return operator


def is_product(matrix: PETSc.Mat) -> bool:
    """Return whether a matrix is a matrix-free cell operator."""
    return matrix.getType() == "python" and isinstance(matrix.getPythonContext(), CellOperator)


def _indices(degree: int) -> list[tuple[int, ...]]:
    return [b for b in itertools.product(range(degree + 1), repeat=4) if sum(b) == degree]


def _factorials(b: tuple[int, ...]) -> int:
    return prod(factorial(int(part)) for part in b)


def _multinomial(b: tuple[int, ...]) -> float:
    return factorial(sum(b)) / _factorials(b)


def _rows(matrix: FloatArray, kind: str) -> Rows:
    sparse = sp.csr_matrix(matrix)
    return Rows(sparse.indptr.astype(np.int32), sparse.indices.astype(np.int32), sparse.data.astype(kind))
