"""A multigrid cycle over degrees p, …, 2 in single precision, above a solver of degree 1 in double.

The smoother is Chebyshev's iteration with the blocks of the diagonal, the same as PETSc's. What an iteration takes is
the time to read its matrices: in single precision, and of a symmetric matrix the upper blocks alone, they are a
quarter as long. The residual is brought to magnitude 1 first, so that nothing runs out of the exponents of a float.

On several ranks each smooths the rows that it owns; what it needs of others' points is sent in single precision, too.
"""

from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from pipeline.arrays import Int32Array
from pipeline.solve.parcels import Shared
from pipeline.solve.single.beyond import beyond, summed
from pipeline.solve.straight.arrays import available, blocks_to_read
from pipeline.solve.straight.native import Library
from pipeline.solve.straight.product import is_product
from pipeline.solve.transfer import Side, free, point_weights

Single = npt.NDArray[np.float32]

_DECLARATIONS = """
void take_upper(int rows, const int* offsets, const int* columns, const double* blocks, const int* upper_offsets,
                int* upper_columns, float* upper);
int invert_diagonal(int rows, const int* offsets, const float* values, float* inverse);
void multiply(int rows, const int* first, const int* offsets, const int* columns, const float* blocks, const float* x,
              float* y);
void multiply_double(int rows, const int* first, const int* offsets, const int* columns, const double* blocks,
                     const double* x, double* y);
void multiply_beyond(int rows, const int* which, const int* offsets, const int* columns, const float* blocks,
                     const float* z, float* y);
void multiply_beyond_double(int rows, const int* which, const int* offsets, const int* columns, const double* blocks,
                            const double* z, double* y);
void advance(int rows, const float* inverse, float a, float b, const float* r, float* d, float* x);
void subtract(int count, const float* q, float* r);
double dot(int count, const float* x, const float* y);
void prolong(int rows, const int* offsets, const int* points, const float* weights, const float* coarse_free,
             const float* fine_free, const float* e, float* x);
void restrict_to(int rows, const int* offsets, const int* points, const float* weights, int coarse_count,
                 const float* coarse_free, const float* fine_free, const float* r, float* g);
double largest(int count, const double* x);
void to_single(int count, double scale, const double* x, float* y);
void to_double(int count, double scale, const float* x, double* y);
"""


# Chebyshev's iteration: steps, the share of the spectrum that is left to the coarser level, and by how much the
# largest eigenvalue that so many of Lanczos' steps find is raised. Measured: docs/solvers.md.
_STEPS, _LEFT, _RAISED, _LANCZOS = 2, 0.1, 1.15, 5
# Where the material jumps, as PETSc's own: see :mod:`pipeline.solve.linear`.
_LANCZOS_JUMPS = 12
# Beyond 1.1 times what it is taken for, an eigenvalue makes the cycle indefinite. A few slender elements have one of
# which noise has little; so many steps find it.
_LANCZOS_CLOSER = 40

_BLOCKED = ("seqbaij", "mpibaij")


def suits(matrices: list[PETSc.Mat]) -> bool:
    """Tell whether a cycle over operators of degrees 1, 2, … can be made: where C can be compiled; collective."""
    return len(matrices) > 1 and takes_product(matrices)


def takes_product(matrices: list[PETSc.Mat]) -> bool:
    """Tell whether a cycle could be made over these operators and one of the next degree, maybe without entries.

    Collective.
    """
    if not all(matrix.getType() in _BLOCKED or is_product(matrix) for matrix in matrices[1:]):
        return False
    works = available() and compiles()
    return bool(summed(matrices[0].comm.tompi4py(), works, MPI.MIN)) if matrices else works


@cache
def compiles() -> bool:
    """Tell whether C can be compiled here."""
    try:
        library()
    except Exception:  # distutils raises many kinds
        return False
    return True


@cache
def library() -> Library:
    """Return the functions of ``cycle.c``, compiled if they are not yet."""
    return Library(Path(__file__).with_name("cycle.c"), _DECLARATIONS)


@dataclass(frozen=True)
class Interpolation:
    """From the points of a coarse space to those of a fine one: sparse rows with the same weight for all components.

    ``coarse_free`` and ``fine_free`` are 0 for numbers that are prescribed, else 1. Rows are of the points that this
    rank owns; those of the coarse space that others own are ``shared``, None on one process. Both maps are collective.
    """

    offsets: Int32Array
    points: Int32Array
    weights: Single
    coarse_free: Single
    fine_free: Single
    shared: Shared | None = None

    def prolong(self, coarse: Single, fine: Single) -> None:
        """Add the interpolation of ``coarse`` to ``fine``."""
        if self.shared is not None:
            coarse = np.concatenate([coarse, self.shared.read(coarse.reshape(-1, 3)).reshape(-1)])
        library()("prolong", len(self.offsets) - 1, self.offsets, self.points, self.weights, self.coarse_free,
                  self.fine_free, coarse, fine)  # fmt: skip

    def restrict(self, fine: Single, coarse: Single) -> None:
        """Write the transposed interpolation of ``fine`` into ``coarse``."""
        owned = len(coarse)
        found = coarse if self.shared is None else np.empty(len(self.coarse_free), dtype=np.float32)
        library()("restrict_to", len(self.offsets) - 1, self.offsets, self.points, self.weights, len(found),
                  self.coarse_free, self.fine_free, fine, found)  # fmt: skip
        if self.shared is not None:
            coarse[:] = found[:owned]
            self.shared.add(found[owned:].reshape(-1, 3), coarse.reshape(-1, 3))


def interpolation(coarse: Side, fine: Side) -> Interpolation:
    """Return the interpolation between two spaces; collective."""
    offsets, points, weights = point_weights(coarse.space, fine.space)
    comm, index_map, shared = coarse.space.mesh.comm, coarse.space.dofmap.index_map, None
    if comm.size > 1:
        shared = Shared(comm, index_map.local_range, np.asarray(index_map.ghosts, dtype=np.int64))
    return Interpolation(
        offsets.astype(np.int32), points, weights.astype(np.float32), *masks(coarse, fine), shared=shared
    )


def masks(coarse: Side, fine: Side) -> tuple[Single, Single]:
    """Return 0 for each number of the two spaces that is prescribed, else 1."""
    return free(coarse).astype(np.float32), free(fine).astype(np.float32)


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
        library()("take_upper", self.rows, offsets, columns, inside.values, self._offsets, self._columns, self._values)
        self._beyond = beyond(matrix, np.float32, partial(library(), "multiply_beyond"))

    def multiply(self, x: Single, y: Single) -> None:
        """Write A x into ``y``; collective."""
        begun = self._beyond and self._beyond.begin(x)
        library()("multiply", self.rows, self._offsets, self._offsets, self._columns, self._values, x, y)
        if self._beyond and begun:
            self._beyond.add(begun, y)

    def diagonal(self) -> Single:
        """Return the blocks on the diagonal, shape (rows, 9)."""
        return self._values[self._offsets[:-1]]


class SmoothedLevel:
    """An operator in single precision and its smoother."""

    def __init__(self, operator: SymmetricOperator, *, jumps: bool = False):
        """Set up; ``jumps``: the material does. Collective.

        Raises:
            ArithmeticError: if a block of the diagonal is not positive.
        """
        self._operator, self._comm, rows = operator, operator.comm, operator.rows
        self._rows, self._blocks = rows, operator.diagonal()
        self._inverse = np.empty((rows, 9), dtype=np.float32)
        singular = library()("invert_diagonal", rows, np.arange(rows, dtype=np.int32), self._blocks, self._inverse)
        if summed(self._comm, singular):
            raise ArithmeticError("the operator is not positive definite")
        self.size, self._held = 3 * rows, np.empty(0, dtype=np.int32)
        self._product, self._direction, self.scratch = (np.zeros(self.size, dtype=np.float32) for _ in range(3))
        self.hold(self._held)
        self._most = _RAISED * self._largest_eigenvalue(_LANCZOS_JUMPS if jumps else _LANCZOS)

    def look_closer(self) -> None:
        """Find the largest eigenvalue by many more steps, for the smoother from now on."""
        held = self._held
        self.hold(np.empty(0, dtype=np.int32))  # the operator knows nothing of what is held
        self._most = max(self._most, _RAISED * self._largest_eigenvalue(_LANCZOS_CLOSER))
        self.hold(held)

    def hold(self, dofs: Int32Array) -> None:
        """Let the smoother alone hold ``dofs`` from now on, which the operator knows nothing of, and no others.

        They are local ones; ghosts are left to their owners. Where it neither reads nor writes, it smooths for the
        operator without those rows and columns.
        """
        self._invert(np.unique(self._held // 3), np.zeros(0, dtype=np.int32))
        held = np.union1d(self._operator.prescribed, dofs).astype(np.int32)
        self._held = held[held < self.size]
        self._invert(np.unique(self._held // 3), self._held)

    def _invert(self, rows: Int32Array, held: Int32Array) -> None:
        """Invert blocks of the diagonal without the rows and columns of ``held`` dofs, where the inverse is nought."""
        free = np.ones((len(rows), 3), dtype=bool)
        free[np.searchsorted(rows, held // 3), held % 3] = False
        both = free[:, :, None] & free[:, None, :]
        blocks = self._blocks[rows].reshape(-1, 3, 3).astype(np.float64)
        inverse = np.linalg.inv(np.where(both, blocks, np.eye(3)))
        self._inverse[rows] = np.where(both, inverse, 0.0).reshape(-1, 9)

    def subtract_product(self, x: Single, r: Single) -> None:
        """Take A x away from ``r``."""
        self._multiply(x)
        library()("subtract", self.size, self._product, r)

    def smooth(self, x: Single, r: Single) -> Single:
        """Improve ``x``, of which ``r`` is the residual, by Chebyshev's iteration.

        Returns its last step, by which ``r`` still differs from the residual; the next call overwrites it.
        """
        theta, delta = (1 + _LEFT) * self._most / 2, (1 - _LEFT) * self._most / 2
        d, rho = self._direction, delta / theta
        d[:] = 0.0
        library()("advance", self._rows, self._inverse, 0.0, 1 / theta, r, d, x)
        for _ in range(_STEPS - 1):
            self.subtract_product(d, r)
            previous, rho = rho, 1 / (2 * theta / delta - rho)
            library()("advance", self._rows, self._inverse, rho * previous, 2 * rho / delta, r, d, x)
        return d

    def _multiply(self, x: Single) -> None:
        """Write A x into the product."""
        self._operator.multiply(x, self._product)

    def _largest_eigenvalue(self, steps: int) -> float:
        """Return the largest eigenvalue of D⁻¹ A, from below, by Lanczos' method from noise."""
        r = np.random.default_rng(self._comm.rank).standard_normal(self.size, dtype=np.float32)
        z, p, diagonal, beside = np.empty_like(r), np.zeros_like(r), [], []
        previous = step = 0.0
        for _ in range(steps):
            z[:] = 0.0
            library()("advance", self._rows, self._inverse, 0.0, 1.0, r, self._direction, z)
            rz = self._dot(r, z)
            ratio = rz / previous if previous else 0.0
            p *= ratio
            p += z
            self._multiply(p)
            before, step = step, rz / self._dot(p, self._product)
            diagonal.append(1 / step + (ratio / before if before else 0.0))
            beside.append(ratio**0.5 / before if before else 0.0)
            self._product *= step
            library()("subtract", self.size, self._product, r)
            previous = rz
        return float(np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside[1:], 1) + np.diag(beside[1:], -1))[-1])

    def _dot(self, x: Single, y: Single) -> float:
        return summed(self._comm, library()("dot", self.size, x, y))


class SymmetricProduct:
    """A symmetric operator in double, of which the blocks from the diagonal on are read: a context for PETSc.

    Its own product reads all of them, and no faster.
    """

    def __init__(self, matrix: PETSc.Mat):
        """Refer to the entries of a matrix, in blocks, which must live as long; collective."""
        inside, _, _ = blocks_to_read(matrix)
        self._offsets, self._columns, self._blocks = inside.offsets, inside.columns, inside.values
        self._beyond = beyond(matrix, np.float64, partial(library(), "multiply_beyond_double"))
        rows = np.repeat(np.arange(len(self._offsets) - 1, dtype=np.int32), np.diff(self._offsets))
        self._diagonal = np.flatnonzero(self._columns == rows).astype(np.int32)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write A x into ``y``."""
        given, result = x.array_r, y.array_w
        begun = self._beyond and self._beyond.begin(given)
        library()("multiply_double", len(self._diagonal), self._diagonal, self._offsets, self._columns, self._blocks,
                  given, result)  # fmt: skip
        if self._beyond and begun:
            self._beyond.add(begun, result)


class SingleCycle:
    """The preconditioner: a context for PETSc's type "python"."""

    def __init__(self, levels: list[SmoothedLevel], interpolations: list[Interpolation], coarse: PETSc.PC):
        """``levels`` go up from degree 2, ``interpolations`` lead to each; ``coarse`` is the solver of degree 1."""
        self._levels, self._interpolations, self._coarse = levels, interpolations, coarse
        bottom, _ = coarse.getOperators()
        self._comm = bottom.comm.tompi4py()
        sizes = [bottom.getLocalSize()[0], *(level.size for level in levels)]
        self._x, self._r = ([np.zeros(size, dtype=np.float32) for size in sizes] for _ in range(2))
        self._bottom = bottom.createVecs()

    def hold(self, held: list[Int32Array], masks: list[tuple[Single, Single]], coarse: PETSc.PC) -> None:
        """Hold other dofs of each level than the operators say, with the masks of each interpolation."""
        for level, dofs in zip(self._levels, held, strict=True):
            level.hold(dofs)
        self._interpolations = [
            replace(between, coarse_free=below, fine_free=above)
            for between, (below, above) in zip(self._interpolations, masks, strict=True)
        ]
        self._coarse = coarse

    def above(self, levels: list[SmoothedLevel], interpolations: list[Interpolation]) -> "SingleCycle":
        """Return the cycle with more levels on top, which shares those that are there."""
        return SingleCycle([*self._levels, *levels], [*self._interpolations, *interpolations], self._coarse)

    def look_closer(self) -> None:
        """Let each level's smoother find its largest eigenvalue by many more steps."""
        for level in self._levels:
            level.look_closer()

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write one cycle's correction for ``residual`` into ``result``; collective."""
        top, given = len(self._levels), residual.array_r
        scale = summed(self._comm, library()("largest", len(given), given), MPI.MAX)
        library()("to_single", len(given), 1 / scale if scale else 0.0, given, self._r[top])
        self._cycle(top)
        library()("to_double", len(self._x[top]), scale, self._x[top], result.array_w)

    def destroy(self, _: PETSc.PC) -> None:
        """Free the vectors of the coarsest level."""
        for vector in self._bottom:
            vector.destroy()

    def _cycle(self, number: int) -> None:
        """Solve roughly for the residual of a level, which is overwritten."""
        x, r = self._x[number], self._r[number]
        if number == 0:
            self._solve_coarsest(x, r)
            return
        level, interpolation = self._levels[number - 1], self._interpolations[number - 1]
        x[:] = 0.0
        level.subtract_product(level.smooth(x, r), r)
        interpolation.restrict(r, self._r[number - 1])
        self._cycle(number - 1)
        correction = level.scratch
        correction[:] = 0.0
        interpolation.prolong(self._x[number - 1], correction)
        x += correction
        level.subtract_product(correction, r)
        level.smooth(x, r)

    def _solve_coarsest(self, x: Single, r: Single) -> None:
        solution, rhs = self._bottom
        library()("to_double", len(r), 1.0, r, rhs.array_w)
        self._coarse.apply(rhs, solution)
        x[:] = solution.array_r
