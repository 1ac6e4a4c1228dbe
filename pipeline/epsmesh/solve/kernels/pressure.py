"""Matrix-free ∫ p q and ∫ q div u of mixed elements (``pressure.c``): contexts for PETSc.

On several ranks each multiplies with its own cells, between two ghost exchanges, as
:class:`~epsmesh.solve.kernels.product.CellOperator` does. All methods are collective.
"""

from copy import copy
from typing import Any

import numpy as np
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.solve.kernels.cells import Ghosts, owned_cells, reference
from epsmesh.solve.kernels.native import call
from epsmesh.solve.kernels.product import CellStiffness, Joined, bernstein


class CellPressures:
    """Pressures, one degree below the displacements on the same cells, in units of ``unit`` (1/m).

    ``diagonal`` is that of the mass, of owned pressures.
    """

    def __init__(self, pressures: Any, cells: CellStiffness):
        """Lay out the cells; collective. ``unit`` is about one over the size of an element."""
        self.ghosts, dofs = Ghosts(pressures), owned_cells(pressures)
        self.comm, self.cells, self.degree = cells.comm, cells, compat.degree(pressures)
        self._prescribed = cells.prescribed
        self._pairs: Joined | None = None
        self._dofs = cells.lanes.spread(dofs[cells.lanes.which])
        self._roots = cells.roots
        weights, values, _ = reference(self.degree, 2 * self.degree)
        self._mass = np.ascontiguousarray(np.einsum("q,qi,qj->ij", weights, values, values))
        # The displacements' mass has a factor p²; a single gradient needs one p.
        self._coupled = bernstein(cells.degree, "float64").mass / cells.degree
        if (curved := cells.curved) is not None:
            self._bent = curved.lanes.spread(dofs[curved.lanes.which])
            self._values = curved.values(self.degree)
        diagonal = self._diagonal()
        total = self.comm.allreduce(np.array([diagonal.sum(), len(diagonal)]))
        self.unit = float(total[0] / total[1]) ** (-1 / 3)
        self.diagonal = self.unit**2 * diagonal

    def _diagonal(self) -> FloatArray:
        """Return the diagonal of the mass, of owned pressures, in units of length."""
        parts = [(self._dofs, self._roots**2 * np.diag(self._mass)[:, None])]
        if (curved := self.cells.curved) is not None:
            squares = curved.signs["float64"][:, None] * self._values**2
            parts.append((self._bent, squares.T @ curved.roots**2))
        found = sum(np.bincount(dofs.reshape(-1), values.reshape(-1), self.ghosts.local) for dofs, values in parts)
        return self.ghosts.folded(np.asarray(found), 1).copy()

    @property
    def lanes(self) -> list[Int32Array]:
        """The points of straight cells, and of curved ones if there are any, (batches, points, lanes)."""
        return [self._dofs] if self.cells.curved is None else [self._dofs, self._bent]

    def holding(self, dofs: Int32Array) -> "CellPressures":
        """Return a copy with owned displacement ``dofs`` (unrolled) prescribed, too; it shares everything else."""
        other = copy(self)
        other._prescribed = np.union1d(self._prescribed, dofs).astype(np.int32)
        return other

    def joined(self, pairs: Joined) -> "CellPressures":
        """Return a copy for other unknowns of the displacement: see :meth:`.CellOperator.joined`."""
        other = copy(self)
        other._pairs = pairs
        return other

    def dilation(self, x: FloatArray, *, whole: bool = False) -> FloatArray:
        """Return B x for owned displacements; prescribed ones count as zero unless ``whole``."""
        given = x.copy()
        if not whole:
            given[self._prescribed] = 0.0
        if self._pairs is not None:
            self._pairs.join(given)
        found = np.zeros(self.ghosts.local)
        self._couple("dilation", self.cells.ghosts.extended(given, 3), found)
        return self.unit * self.ghosts.folded(found, 1)

    def pull(self, x: FloatArray, *, whole: bool = False) -> FloatArray:
        """Return Bᵀ x for owned pressures; zero at prescribed displacements unless ``whole``."""
        found = np.zeros(3 * self.cells.ghosts.local)
        self._couple("pull", self.ghosts.extended(x, 1), found)
        result = self.unit * self.cells.ghosts.folded(found, 3)
        if self._pairs is not None:
            self._pairs.fold(result)
        if not whole:
            result[self._prescribed] = 0.0
        return result

    def weigh(self, x: FloatArray) -> FloatArray:
        """Return M x for owned pressures."""
        given, found, curved = self.ghosts.extended(x, 1), np.zeros(self.ghosts.local), self.cells.curved
        count, batches = len(self._mass), self.cells.lanes.batches
        call("add_mass", count, batches, self._dofs, self._roots, self._mass, given, found)
        if curved is not None:
            _, quadrature, batches = curved.sizes
            tables = self._bent, curved.roots, curved.signs["float64"], self._values
            call("add_curved_mass", count, quadrature, batches, *tables, given, found)
        return self.unit**2 * self.ghosts.folded(found, 1)

    def _couple(self, which: str, x: FloatArray, y: FloatArray) -> None:
        """Add B x or Bᵀ x, on local points, to ``y``."""
        cells, kind = self.cells, "float64"
        table, pressures = bernstein(cells.degree, kind), bernstein(self.degree, kind)
        there, back = (table, pressures) if which == "dilation" else (pressures, table)
        sizes = cells.lanes.dofs.shape[1], len(self._mass)
        laid_out = cells.lanes.batches, cells.lanes.dofs, self._dofs, cells.maps[kind], self._roots
        call(f"add_{which}", *sizes, *laid_out, *there.forward, *back.back, table.raised, self._coupled, x, y)
        if (curved := cells.curved) is not None:
            _, quadrature, batches = curved.sizes
            bent = quadrature, batches, curved.lanes.dofs, self._bent, curved.maps[kind], curved.roots
            call(f"add_curved_{which}", *sizes, *bent, curved.signs[kind], curved.gradients[kind], self._values, x, y)


class Coupling:
    """The operator B: a context for PETSc."""

    def __init__(self, pressures: CellPressures):
        self.pressures = pressures

    def holding(self, dofs: Int32Array) -> "Coupling":
        """Return B with zero columns for owned ``dofs`` (unrolled), too."""
        return Coupling(self.pressures.holding(dofs))

    def joined(self, pairs: Joined) -> "Coupling":
        """Return B S: see :meth:`.CellOperator.joined`."""
        return Coupling(self.pressures.joined(pairs))

    def matrix(self) -> PETSc.Mat:
        """Return B as a PETSc matrix; the caller destroys it."""
        of = self.pressures
        return matrix_of(self, of.ghosts.owned, 3 * of.cells.ghosts.owned, of.comm)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write B x into ``y``; PETSc calls this."""
        y.array_w[:] = self.pressures.dilation(x.array_r)

    def multTranspose(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write Bᵀ x into ``y``; PETSc calls this."""
        y.array_w[:] = self.pressures.pull(x.array_r)


class Mass:
    """The mass M, each row times its ``weight``: a context for PETSc."""

    def __init__(self, pressures: CellPressures, weight: float | FloatArray = 1.0):
        self._pressures, self.weight = pressures, weight

    def weighted(self, weight: float | FloatArray) -> "Mass":
        """Return the mass with other weights."""
        return Mass(self._pressures, weight)

    def matrix(self) -> PETSc.Mat:
        """Return M as a PETSc matrix; the caller destroys it."""
        of = self._pressures
        return matrix_of(self, of.ghosts.owned, of.ghosts.owned, of.comm)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write M x into ``y``; PETSc calls this."""
        y.array_w[:] = self.product(x.array_r)

    def product(self, x: FloatArray) -> FloatArray:
        """Return M x for owned pressures."""
        return np.asarray(self.weight * self._pressures.weigh(x))

    def getDiagonal(self, _: PETSc.Mat, y: PETSc.Vec) -> None:
        """Write the diagonal into ``y``; PETSc calls this."""
        y.array_w[:] = self.weight * self._pressures.diagonal


def matrix_of(context: Any, rows: int, columns: int, comm: Any) -> PETSc.Mat:
    """Return a PETSc matrix of owned ``rows`` and ``columns``, which the caller destroys; collective."""
    matrix = PETSc.Mat().createPython(((rows, None), (columns, None)), context, comm=comm)
    matrix.setUp()
    return matrix
