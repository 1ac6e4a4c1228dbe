"""Multigrid cycle over degrees and meshes in single precision, above a coarse solver of degree 1 in double precision.

Prolongation is interpolation, restriction its transpose. The smoother is Chebyshev's iteration with the inverses of the
diagonal blocks, as in PETSc; operators are matrix-free. The residual is scaled to magnitude 1 first, so that single
precision does not overflow. Each rank smooths its own rows; ghosts are exchanged in single precision.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.mesh.curve import EDGES
from epsmesh.solve.kernels.cells import Ghosts, summed
from epsmesh.solve.kernels.native import Single, call
from epsmesh.solve.kernels.product import CellOperator, Joined
from epsmesh.stages import stage

# Chebyshev's iteration: steps, lower end of its interval as a share of the largest eigenvalue, safety factor on the
# estimated largest eigenvalue, and Lanczos steps for that estimate. Measured: benchmarks/results/solvers.md.
_STEPS, _LEFT, _RAISED, _LANCZOS = 2, 0.1, 1.15, 5
# Where the material jumps, the largest eigenvector is in the stiffest region, where random vectors have little of it.
_LANCZOS_JUMPS = 12
# From this many unknowns on, twice the steps of bodies of one material: the more elements, the less a random vector has
# of the worst few. At ten million the estimate was 22 % too low with 5 steps, 9 % with 10, which saved a third of the
# iterations of mixed elements, a ninth of those of others.
_MANY, _LANCZOS_MANY = 500_000, 10
# An eigenvalue above 1.1 times the estimate makes the cycle indefinite. A few slender elements may have one, with an
# eigenvector that random vectors hardly contain; this many steps find it.
_LANCZOS_CLOSER = 40
# Corners of a cell at the ends of the edge of each of its points of degree 2; both are the corner at a corner.
_ENDS = np.vstack([np.repeat(np.arange(4)[:, None], 2, axis=1), EDGES])
# Prolongation weights below this are rounding.
_NOTHING = 1e-12


class Side(Protocol):
    """A vector space and its prescribed local dofs (unrolled).

    ``children`` (cells, 10) are the points of the next finer mesh in each cell: its corners, and those that halve its
    edges; None if the next space is on the same mesh. ``pairs`` are those of its unknowns, None for displacements.
    """

    @property
    def space(self) -> Any: ...  # noqa: D102

    @property
    def prescribed(self) -> npt.NDArray[Any]: ...  # noqa: D102

    @property
    def children(self) -> Int32Array | None: ...  # noqa: D102

    @property
    def pairs(self) -> Joined | None: ...  # noqa: D102


class Rows(Protocol):
    """A prolongation P from local coarse points to owned fine ones, without conditions."""

    def prolong(self, coarse: Single, free: Single, fine: Single) -> None:
        """Add P ``coarse`` to ``fine`` where it is ``free`` (1, else 0)."""

    def restrict(self, fine: Single, free: Single, coarse: Single) -> None:
        """Add the transpose of P times ``fine``, where it is ``free``, to ``coarse``."""


@dataclass(frozen=True)
class OnEdges:
    """Points that are in the middle of two coarse ones, their ``ends`` (n, 2), or on one, which is both ends."""

    ends: Int32Array

    def prolong(self, coarse: Single, free: Single, fine: Single) -> None:
        """See :class:`Rows`."""
        call("prolong_on_edges", len(self.ends), self.ends, free, coarse, fine)

    def restrict(self, fine: Single, free: Single, coarse: Single) -> None:
        """See :class:`Rows`."""
        call("restrict_from_edges", len(self.ends), self.ends, free, fine, coarse)


class Weights(NamedTuple):
    """Prolongation weights of the points of a fine cell, as sparse rows: ``columns`` are points of the coarse cell."""

    offsets: Int32Array
    columns: Int32Array
    weights: Single


@dataclass(frozen=True)
class InCells:
    """Points that have their row of ``weights`` by their ``position`` in one of their cells, ``cell``.

    ``points`` (cells, points of a cell) are the coarse points of all cells.
    """

    cell: Int32Array
    position: npt.NDArray[np.uint8]
    points: Int32Array
    weights: Weights

    def prolong(self, coarse: Single, free: Single, fine: Single) -> None:
        """See :class:`Rows`."""
        call("prolong", *self._rows, free, coarse, fine)

    def restrict(self, fine: Single, free: Single, coarse: Single) -> None:
        """See :class:`Rows`."""
        call("restrict_to", *self._rows, free, fine, coarse)

    @property
    def _rows(self) -> tuple[Any, ...]:
        return len(self.cell), self.cell, self.position, self.points.shape[1], self.points, *self.weights


@dataclass(frozen=True)
class Interpolation:
    """Prolongation from the points of a coarse space to those of a fine one, equal for all components.

    ``coarse_free`` and ``fine_free`` are 0 at prescribed dofs, else 1. ``ghosts`` are those of the coarse space. Both
    maps are collective.
    """

    rows: Rows
    coarse_free: Single
    fine_free: Single
    ghosts: Ghosts

    def prolong(self, coarse: Single, fine: Single) -> None:
        """Add the prolongation of ``coarse`` to ``fine``."""
        free = coarse * self.coarse_free[: len(coarse)]
        self.rows.prolong(self.ghosts.extended(free, 3), self.fine_free, fine)

    def restrict(self, fine: Single, coarse: Single) -> None:
        """Write the restriction of ``fine``, the transposed prolongation, into ``coarse``."""
        found = np.zeros(len(self.coarse_free), dtype=np.float32)
        self.rows.restrict(fine, self.fine_free, found)
        coarse[:] = self.ghosts.folded(found, 3)
        coarse *= self.coarse_free[: len(coarse)]

    def joined(self, coarse: Joined | None, fine: Joined | None) -> "Interpolation":
        """Return the interpolation between other unknowns of both spaces; itself where they have none."""
        if coarse is None or fine is None:
            return self
        return JoinedInterpolation(self.rows, self.coarse_free, self.fine_free, self.ghosts, (coarse, fine))


@dataclass(frozen=True)
class JoinedInterpolation(Interpolation):
    """Interpolation between the unknowns of ``pairs``, of the coarse space and of the fine one."""

    pairs: tuple[Joined, Joined]

    def prolong(self, coarse: Single, fine: Single) -> None:
        """Add the prolongation of ``coarse`` to ``fine``."""
        (below, above), given, found = self.pairs, coarse * self.coarse_free[: len(coarse)], np.zeros_like(fine)
        below.join(given)
        self.rows.prolong(self.ghosts.extended(given, 3), np.ones_like(self.fine_free), found)
        above.part(found)
        fine += found * self.fine_free[: len(fine)]

    def restrict(self, fine: Single, coarse: Single) -> None:
        """Write the restriction of ``fine``, the transposed prolongation, into ``coarse``."""
        (below, above), given = self.pairs, fine * self.fine_free[: len(fine)]
        above.unfold(given)
        found = np.zeros(len(self.coarse_free), dtype=np.float32)
        self.rows.restrict(given, np.ones_like(self.fine_free), found)
        coarse[:] = self.ghosts.folded(found, 3)
        below.fold(coarse)
        coarse *= self.coarse_free[: len(coarse)]


class SmoothedLevel:
    """An operator in single precision and its smoother."""

    def __init__(self, operator: CellOperator, *, jumps: bool = False):
        """Set up; ``jumps`` says that the material jumps between regions. Collective.

        Raises:
            ArithmeticError: if a diagonal block is not positive definite.
        """
        self._operator, self._comm, rows = operator, operator.comm, operator.rows
        self._rows = rows
        self._blocks: Single | None = operator.diagonal()
        self._inverse = np.empty((rows, 9), dtype=np.float32)
        singular = call("invert_diagonal", rows, self._blocks, self._inverse)
        if summed(self._comm, singular):
            raise ArithmeticError("the operator is not positive definite")
        self.size, self._held = 3 * rows, np.empty(0, dtype=np.int32)
        self._product, self._direction = (np.zeros(self.size, dtype=np.float32) for _ in range(2))
        self.hold(self._held)
        self._blocks = None  # 12 bytes per dof; most solvers do not need them again
        usual = _LANCZOS_MANY if summed(self._comm, self.size) >= _MANY else _LANCZOS
        self._most = _RAISED * self._largest_eigenvalue(_LANCZOS_JUMPS if jumps else usual)

    def refine_eigenvalues(self) -> None:
        """Estimate the largest eigenvalue again with many more steps, and use it from now on; collective."""
        held = self._held
        self.hold(np.empty(0, dtype=np.int32))  # the operator ignores the dofs that the smoother fixes
        self._most = max(self._most, _RAISED * self._largest_eigenvalue(_LANCZOS_CLOSER))
        self.hold(held)

    def hold(self, dofs: Int32Array) -> None:
        """Fix local ``dofs``, and no others, in the smoother alone from now on; the operator ignores them.

        Ghosts are left to their owners. The smoother neither reads nor writes fixed dofs: it then smooths for the
        operator without these rows and columns. Collective.
        """
        if self._blocks is None:
            self._blocks = self._operator.diagonal()
        self._invert(np.unique(self._held // 3), np.zeros(0, dtype=np.int32))
        held = np.union1d(self._operator.prescribed, dofs).astype(np.int32)
        self._held = held[held < self.size]
        self._invert(np.unique(self._held // 3), self._held)

    def replace_operator(self, operator: CellOperator) -> None:
        """Smooth for another ``operator`` of the same size and about the same eigenvalues; collective."""
        if operator is self._operator:
            return
        self._operator, self._blocks = operator, operator.diagonal()
        call("invert_diagonal", self._rows, self._blocks, self._inverse)
        self._invert(np.unique(self._held // 3), self._held)

    def _invert(self, rows: Int32Array, held: Int32Array) -> None:
        """Invert diagonal blocks without the rows and columns of ``held`` dofs, where the inverse is zero."""
        free = np.ones((len(rows), 3), dtype=bool)
        free[np.searchsorted(rows, held // 3), held % 3] = False
        both = free[:, :, None] & free[:, None, :]
        assert self._blocks is not None
        blocks = self._blocks[rows].reshape(-1, 3, 3).astype(np.float64)
        inverse = np.linalg.inv(np.where(both, blocks, np.eye(3)))
        self._inverse[rows] = np.where(both, inverse, 0.0).reshape(-1, 9)

    @property
    def cleared(self) -> Single:
        """A work vector of zeros, until the next call of :meth:`smooth`."""
        self._direction[:] = 0.0
        return self._direction

    def subtract_product(self, x: Single, r: Single) -> None:
        """Subtract A x from ``r``."""
        self._multiply(x)
        call("subtract", self.size, self._product, r)

    def smooth(self, x: Single, r: Single) -> Single:
        """Improve ``x``, with residual ``r``, by Chebyshev's iteration.

        Return its last step, which ``r`` does not account for yet; the next call overwrites it.
        """
        theta, delta = (1 + _LEFT) * self._most / 2, (1 - _LEFT) * self._most / 2
        d, rho = self._direction, delta / theta
        d[:] = 0.0
        call("advance", self._rows, self._inverse, 0.0, 1 / theta, r, d, x)
        for _ in range(_STEPS - 1):
            self.subtract_product(d, r)
            previous, rho = rho, 1 / (2 * theta / delta - rho)
            call("advance", self._rows, self._inverse, rho * previous, 2 * rho / delta, r, d, x)
        return d

    def _multiply(self, x: Single) -> None:
        """Write A x into the work vector."""
        self._operator.multiply(x, self._product)

    def _largest_eigenvalue(self, steps: int) -> float:
        """Return a lower estimate of the largest eigenvalue of D⁻¹ A, by Lanczos from random vectors; collective.

        Raises:
            ArithmeticError: on every rank, if entries exceed the range of single precision.
        """
        r = np.random.default_rng(self._comm.rank).standard_normal(self.size, dtype=np.float32)
        z, p, diagonal, beside = np.empty_like(r), np.zeros_like(r), [], []
        previous = step = 0.0
        for _ in range(steps):
            z[:] = 0.0
            call("advance", self._rows, self._inverse, 0.0, 1.0, r, self._direction, z)
            rz = self._dot(r, z)
            ratio = rz / previous if previous else 0.0
            p *= ratio
            p += z
            self._multiply(p)
            before, step = step, rz / self._dot(p, self._product)
            diagonal.append(1 / step + (ratio / before if before else 0.0))
            beside.append(ratio**0.5 / before if before else 0.0)
            if not isfinite(diagonal[-1]):
                raise ArithmeticError("moduli or sizes exceed the range of single precision")
            self._product *= step
            call("subtract", self.size, self._product, r)
            previous = rz
        return float(np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside[1:], 1) + np.diag(beside[1:], -1))[-1])

    def _dot(self, x: Single, y: Single) -> float:
        return summed(self._comm, call("dot", self.size, x, y))


class Cycle:
    """The preconditioner: a context for PETSc's type "python"."""

    def __init__(self, levels: list[SmoothedLevel], interpolations: list[Interpolation], coarse: PETSc.PC):
        """``levels`` go up from the second, ``interpolations`` lead to each; ``coarse`` is the solver of the first."""
        self._levels, self._interpolations, self.coarse = levels, interpolations, coarse
        bottom, _ = coarse.getOperators()
        self._comm = bottom.comm.tompi4py()
        sizes = [bottom.getLocalSize()[0], *(level.size for level in levels)]
        self._x, self._r = ([np.zeros(size, dtype=np.float32) for size in sizes] for _ in range(2))
        self._bottom = bottom.createVecs()

    def hold(self, held: list[Int32Array], masks: list[tuple[Single, Single]], coarse: PETSc.PC) -> None:
        """Fix other dofs on each level than the operators do, with the masks of each interpolation."""
        for level, dofs in zip(self._levels, held, strict=True):
            level.hold(dofs)
        self._interpolations = [
            replace(between, coarse_free=below, fine_free=above)
            for between, (below, above) in zip(self._interpolations, masks, strict=True)
        ]
        self.coarse = coarse

    def join(self, operators: list[CellOperator], pairs: Sequence[Joined | None]) -> None:
        """Take the ``operators`` of other unknowns from the second level on; ``pairs`` are those of all levels."""
        for level, operator in zip(self._levels, operators, strict=True):
            level.replace_operator(operator)
        both = zip(self._interpolations, itertools.pairwise(pairs), strict=True)
        self._interpolations = [between.joined(*ends) for between, ends in both]

    def above(self, levels: list[SmoothedLevel], interpolations: list[Interpolation]) -> "Cycle":
        """Return a cycle with more levels on top; it shares the present ones."""
        return Cycle([*self._levels, *levels], [*self._interpolations, *interpolations], self.coarse)

    def refine_eigenvalues(self) -> None:
        """Estimate the largest eigenvalue of each level again with many more steps."""
        for level in self._levels:
            level.refine_eigenvalues()

    def apply(self, _: PETSc.PC, residual: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the correction of one cycle for ``residual`` into ``result``; PETSc calls this."""
        self.correct(residual.array_r, result.array_w)

    def correct(self, given: FloatArray, result: FloatArray) -> None:
        """Write the correction of one cycle for the residual ``given``, owned dofs, into ``result``; collective."""
        top = len(self._levels)
        scale = summed(self._comm, call("largest", len(given), given), MPI.MAX)
        call("to_single", len(given), 1 / scale if scale else 0.0, given, self._r[top])
        self._cycle(top)
        call("to_double", len(self._x[top]), scale, self._x[top], result)

    def destroy(self, _: PETSc.PC) -> None:
        """Free the vectors of the coarsest level."""
        for vector in self._bottom:
            vector.destroy()

    def _cycle(self, number: int) -> None:
        """Apply the cycle from this level down to its residual, which is overwritten."""
        x, r = self._x[number], self._r[number]
        if number == 0:
            self._solve_coarsest(x, r)
            return
        level, interpolation = self._levels[number - 1], self._interpolations[number - 1]
        x[:] = 0.0
        level.subtract_product(level.smooth(x, r), r)
        interpolation.restrict(r, self._r[number - 1])
        self._cycle(number - 1)
        correction = level.cleared
        interpolation.prolong(self._x[number - 1], correction)
        x += correction
        level.subtract_product(correction, r)
        level.smooth(x, r)

    def _solve_coarsest(self, x: Single, r: Single) -> None:
        solution, rhs = self._bottom
        call("to_double", len(r), 1.0, r, rhs.array_w)
        self.coarse.apply(rhs, solution)
        x[:] = solution.array_r


@stage("interpolation")
def interpolation(coarse: Side, fine: Side) -> Interpolation:
    """Return the interpolation between two spaces; collective."""
    points, degree = compat.cell_dofs(fine.space), compat.degree(fine.space)
    if coarse.children is not None:
        points, degree = coarse.children, 2
    cell, position = _places(fine.space.dofmap.index_map.size_local, points)
    weights, below = _weights(compat.degree(coarse.space), degree), compat.cell_dofs(coarse.space)
    rows: Rows = InCells(cell, position, below, weights)
    if (compat.degree(coarse.space), degree) == (1, 2):
        rows = OnEdges(below[cell[:, None], _ENDS[position]])
    return Interpolation(rows, free(coarse), free(fine), Ghosts(coarse.space)).joined(coarse.pairs, fine.pairs)


def free(side: Side) -> Single:
    """Return a mask of a side's local dofs, ghosts included: 0 where prescribed, else 1."""
    dofmap = side.space.dofmap
    mask = np.ones(3 * (dofmap.index_map.size_local + dofmap.index_map.num_ghosts), dtype=np.float32)
    mask[side.prescribed] = 0.0
    return mask


def _places(owned: int, dofs: Int32Array) -> tuple[Int32Array, npt.NDArray[np.uint8]]:
    """Return for each ``owned`` point one of its cells, and its position among the points ``dofs`` of this cell.

    A point may belong to several cells; any of them gives the same weights.
    """
    cell, position = np.zeros(owned, dtype=np.int32), np.zeros(owned, dtype=np.uint8)
    call("find_places", *dofs.shape, dofs, owned, cell, position)
    return cell, position


@cache
def _weights(coarse: int, fine: int) -> Weights:
    """Return the weights between two degrees."""
    local = _on_one_cell(coarse, fine)
    few = [np.flatnonzero(np.abs(row) > _NOTHING) for row in local]
    return Weights(
        np.cumsum([0, *map(len, few)]).astype(np.int32),
        np.concatenate(few).astype(np.int32),
        np.concatenate([row[columns] for row, columns in zip(local, few, strict=True)]).astype(np.float32),
    )


def _on_one_cell(coarse: int, fine: int) -> FloatArray:
    """Return the values of the functions of degree ``coarse`` at the points of ``fine`` on the reference cell."""
    low, high = (compat.reference_element(degree) for degree in (coarse, fine))
    return np.asarray(low.tabulate(0, high.points)[0, :, :, 0])
