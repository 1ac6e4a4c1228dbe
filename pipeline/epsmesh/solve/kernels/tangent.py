"""The tangent of a hyperelastic body, cell by cell: ``tangent.c``.

Moduli at quadrature points are evaluated at a state by the law's compiled code
(:class:`~epsmesh.solve.point_law.PointKernel`), 45 numbers a point in single precision. Products need no matrix.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.solve.kernels.cells import LANES, Lanes, by_points, reference
from epsmesh.solve.kernels.native import Single, call, precision
from epsmesh.solve.kernels.pressure import CellPressures, matrix_of
from epsmesh.solve.kernels.product import CellStiffness
from epsmesh.solve.point_law import SYMMETRIC, PointKernel

# Numbers of a symmetric (9, 9) array, and of a (3, 3) one.
MODULI, _COUPLING = 45, 9
_STEP = 9 * LANES
# Places of S_JL in the upper triangle of δ_ik S_JL, rows (i, J), columns (k, L).
_GEOMETRIC = {
    (j, k): [n * 9 - n * (n - 1) // 2 + m - n for n, m in ((3 * i + j, 3 * i + k) for i in range(3))]
    for j, k in SYMMETRIC
}


@dataclass(frozen=True, eq=False)
class _Part:
    """Straight or curved cells, and their quadrature: see ``tangent.c``; arrays by precision where both are used."""

    lanes: Lanes
    maps: dict[str, np.ndarray]
    step: int
    roots: FloatArray
    factors: FloatArray
    gradients: dict[str, np.ndarray]
    degree: int

    @property
    def sizes(self) -> tuple[int, int]:
        """Numbers of points of a cell and of quadrature points."""
        return self.lanes.dofs.shape[1], len(self.factors)

    def laid_out(self, kind: str) -> tuple[Any, ...]:
        """Return what products read besides moduli."""
        return *self.sizes, self.lanes.batches, self.lanes.dofs, self.maps[kind], self.step, self.gradients[kind]


@dataclass(frozen=True, eq=False)
class PressureField:
    """Pressures (Pa, or in the law's unit), local dofs."""

    pressures: CellPressures
    values: FloatArray


class TangentCells:
    """The cells of a stiffness, laid out for tangents with quadrature of a degree on straight cells.

    Products and diagonal blocks are contributions of this rank's cells only.
    """

    def __init__(self, space: Any, cells: CellStiffness, quadrature: int):
        self.comm, self.ghosts, self.prescribed, self._regions = (
            cells.comm,
            cells.ghosts,
            cells.prescribed,
            cells.regions,
        )
        weights, _, gradients = reference(compat.degree(space), quadrature)
        table = by_points(gradients)
        both: dict[str, np.ndarray] = {"float64": table, "float32": table.astype(np.float32)}
        self._parts = [_Part(cells.lanes, cells.maps, 0, cells.roots, weights, both, quadrature)]
        if (curved := cells.curved) is not None:
            tables = curved.roots, curved.signs["float64"], curved.gradients, curved.quadrature
            self._parts.append(_Part(curved.lanes, curved.maps, _STEP, *tables))

    @property
    def nbytes(self) -> int:
        """Bytes of geometry that products read."""
        return sum(part.lanes.dofs.nbytes + part.maps["float64"].nbytes for part in self._parts)

    def moduli(self, laws: Sequence[PointKernel], u: FloatArray, at: PressureField | None) -> list[Single]:
        """Return ∂²ψ/∂F² at local displacements u, and at pressures in mixed elements, by the law of each region."""
        return self._evaluated(laws, u, at, MODULI)

    def coupling(self, laws: Sequence[PointKernel], u: FloatArray, at: PressureField) -> list[Single]:
        """Return ∂²ψ/∂p∂F at local displacements u and local pressures."""
        return self._evaluated(laws, u, at, _COUPLING)

    def values(
        self, laws: Sequence[PointKernel], u: FloatArray, at: PressureField | None, size: int
    ) -> list[FloatArray]:
        """Return ``size`` values of the laws at the quadrature points, (batches, quadrature, size, lanes) by part."""
        found = []
        for part, values in zip(self._parts, self._evaluated(laws, u, at, size), strict=True):
            factor = part.factors[:, None] * part.roots
            factor = np.where(factor == 0, 1.0, factor)  # of padding
            found.append(values / factor[:, :, None, :])
        return found

    def weights(self) -> list[FloatArray]:
        """Return the volumes (m³) of the quadrature points, (batches, quadrature, lanes) by part; 0 of padding.

        They are those of the maps: times the factors of the cells.
        """
        return [part.factors[:, None] * part.roots**2 for part in self._parts]

    def by_region(self, values: Sequence[float]) -> list[FloatArray]:
        """Return the value of each cell's region, (batches, 1, lanes) by part."""
        regions = [part.lanes.spread(self._region_of(part, len(values))[:, None]) for part in self._parts]
        return [np.array(values, dtype=float)[of] for of in regions]

    def geometric(self, stress: Sequence[FloatArray]) -> list[Single]:
        """Return the moduli of S : Fᵀδ F for symmetric stresses S at the quadrature points, by part."""
        found = []
        for part, values in zip(self._parts, stress, strict=True):
            batches, quadrature, _, lanes = values.shape
            moduli = np.zeros((batches, quadrature, MODULI, lanes), dtype=np.float32)
            for number, (row, column) in enumerate(SYMMETRIC):
                for place in _GEOMETRIC[row, column]:
                    moduli[:, :, place] = part.factors[:, None] * values[:, :, number]
            found.append(moduli)
        return found

    def add_product(self, coefficients: list[np.ndarray], x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with ``x``, on local points, to ``y``; both in one precision. ``coefficients`` are moduli."""
        kind = precision(x)
        for part, moduli in zip(self._parts, coefficients, strict=True):
            call("add_tangent" if kind == "float32" else "add_tangent_double", *part.laid_out(kind), moduli, x, y)

    def diagonal(self, coefficients: list[np.ndarray]) -> Single:
        """Return the diagonal blocks (local, 9)."""
        blocks = np.zeros((self.ghosts.local, 9), dtype=np.float32)
        for part, moduli in zip(self._parts, coefficients, strict=True):
            call("add_tangent_diagonal", *part.laid_out("float64"), moduli, blocks)
        return blocks

    def couple(
        self, which: str, coupling: list[Single], pressures: CellPressures, x: FloatArray, y: FloatArray
    ) -> None:
        """Add B x ("dilation") or Bᵀ x ("pull"), on local points, to ``y``."""
        for part, dofs, factors in zip(self._parts, pressures.lanes, coupling, strict=True):
            _, values, _ = reference(pressures.degree, part.degree)
            given = factors, values.shape[1], dofs, np.ascontiguousarray(values)
            call(f"add_tangent_{which}", *part.laid_out("float64"), *given, x, y)

    def _evaluated(
        self, laws: Sequence[PointKernel], u: FloatArray, at: PressureField | None, outputs: int
    ) -> list[Single]:
        """Return a second derivative of the energy, for each part (batches, quadrature, ``outputs``, lanes)."""
        most = max(1, *(len(law.constants) for law in laws))
        constants = np.zeros((len(laws), most))
        for row, law in zip(constants, laws, strict=True):
            row[: len(law.constants)] = law.constants
        kernels = np.array([law.kernel.address for law in laws], dtype=np.uint64)
        positions = np.array([(law.deformation, law.pressure) for law in laws], dtype=np.int32)
        found = []
        for number, part in enumerate(self._parts):
            points, quadrature = part.sizes
            of_p: tuple[Any, ...] = (0, np.empty(0, dtype=np.int32), np.empty(0), np.empty(0))
            if at is not None:
                values = np.ascontiguousarray(reference(at.pressures.degree, part.degree)[1])
                of_p = values.shape[1], at.pressures.lanes[number], values, at.values
            result = np.zeros((part.lanes.batches, quadrature, outputs, LANES), dtype=np.float32)
            call(
                "evaluate_moduli",
                *(len(part.lanes.which), points, quadrature, part.lanes.dofs, part.maps["float64"], part.roots),
                *(part.step, part.factors, part.gradients["float64"], u, *of_p),
                *(self._region_of(part, len(laws)), kernels, positions, constants, most, outputs, result),
            )
            found.append(result)
        return found

    def _region_of(self, part: _Part, count: int) -> Int32Array:
        """Return the number of the law of each cell of a part."""
        which = part.lanes.which
        if self._regions is None or count == 1:
            return np.zeros(len(which), dtype=np.int32)
        return np.ascontiguousarray(self._regions[which], dtype=np.int32)


class TangentCoupling:
    """The operator B of a tangent, ∫ q ∂D/∂F : ∇u: a context for PETSc. ``factors`` are those of the cells."""

    def __init__(self, cells: TangentCells, pressures: CellPressures, prescribed: Int32Array):
        self._cells, self._pressures, self._prescribed = cells, pressures, prescribed
        self.factors: list[Single] = []

    def matrix(self) -> PETSc.Mat:
        """Return B as a PETSc matrix; the caller destroys it."""
        of = self._pressures
        return matrix_of(self, of.ghosts.owned, 3 * self._cells.ghosts.owned, of.comm)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write B x into ``y``; PETSc calls this."""
        given = x.array_r.copy()
        given[self._prescribed] = 0.0
        y.array_w[:] = self.whole(given)

    def whole(self, x: FloatArray) -> FloatArray:
        """Return B x for owned displacements, without conditions."""
        pressures, found = self._pressures, np.zeros(self._pressures.ghosts.local)
        self._cells.couple("dilation", self.factors, pressures, self._cells.ghosts.extended(x, 3), found)
        return pressures.unit * pressures.ghosts.folded(found, 1)

    def multTranspose(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write Bᵀ x into ``y``; PETSc calls this."""
        pressures, found = self._pressures, np.zeros(3 * self._cells.ghosts.local)
        self._cells.couple("pull", self.factors, pressures, pressures.ghosts.extended(x.array_r, 1), found)
        result = pressures.unit * self._cells.ghosts.folded(found, 3)
        result[self._prescribed] = 0.0
        y.array_w[:] = result
