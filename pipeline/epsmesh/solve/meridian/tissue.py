"""A half plane at large displacements, seen from the surface nodes that a tool may touch.

The interface is that of :mod:`epsmesh.solve.contact.deformed`, in two dimensions. Lengths are in units of the mesh,
forces per radian.
"""

from math import hypot

import numpy as np
import scipy.sparse as sp

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.solve.contact.constraint import Constraint
from epsmesh.solve.meridian.system import FreeSystem
from epsmesh.stages import stage

# Rounding of positions at which nodes are held, in units of the largest.
_ROUNDED = 1e-14


class MeridianTissue:
    """The elements of a ``system``, with nodes ``dofs`` (n, 2) at ``places`` (n, 2): see :class:`.deformed.Tissue`."""

    def __init__(self, system: FreeSystem, dofs: IntArray, places: FloatArray):
        """Begin at rest."""
        self.system, self.places = system, places
        self._dofs = dofs
        self._is_free = np.zeros(system.forms.dofs, dtype=bool)
        self._is_free[system.free] = True
        self._beside = np.setdiff1d(system.free, dofs)
        self.fixed = ~np.isin(dofs, system.free)
        self._now = self._from = self._change = np.zeros(system.forms.dofs)
        self._residual: FloatArray | None = None
        self._energy: float | None = None
        self.slope: float | None = None
        self.iterations = 0

    @property
    def state(self) -> FloatArray:
        """All dofs: displacement, and in mixed elements pressure."""
        return self._now

    @state.setter
    def state(self, values: FloatArray) -> None:
        self._now, self._residual, self._energy = values, None, None

    def positions(self) -> FloatArray:
        """Return the nodes' deformed positions (n, 2)."""
        return self.places + self._now[self._dofs]

    def displacements(self) -> FloatArray:
        """Return the nodes' displacements (n, 2), in m."""
        return np.asarray(self._now[self._dofs])

    def forces(self) -> FloatArray:
        """Return the nodal forces (n, 2); zero at prescribed components."""
        return np.where(self.fixed, 0.0, self.residual()[self._dofs])

    def residual(self) -> FloatArray:
        """Return the derivative of the energy by all dofs."""
        if self._residual is None:
            self._residual = self.system.forms.residual(self._now)
        return self._residual

    def unbalanced(self) -> float:
        """Return the norm of the residual at all other free dofs."""
        return float(np.linalg.norm(self.residual()[self._beside]))

    def linearise(self, constraint: Constraint) -> FloatArray:
        """Find the increment under a ``constraint``; return the nodal forces (n, 2) that it predicts.

        Raises:
            SolveError: if the linear solver fails.
        """
        self._from, dofs = self._now, self._dofs
        with stage("assembly"):
            tangent = self.system.forms.stiffness(self._now)
            turn, turned = None, tangent
            if constraint.is_turned:
                turn = self._blocks(constraint.frames) + sp.diags(self._not_in_contact())
                turned = (turn.T @ (tangent - self._blocks(constraint.turning)) @ turn).tocsr()
        change: FloatArray = np.zeros_like(self._now)
        held = dofs[constraint.held]
        change[held] = constraint.values[constraint.held]
        load = -self.residual()
        load[dofs] += constraint.forces
        is_unknown = self._is_free.copy()
        is_unknown[held] = False
        unknown = np.flatnonzero(is_unknown)
        rows = turned[unknown]
        with self.system.inverse(rows[:, unknown], is_definite=False) as solve, stage("solve"):
            change[unknown] = solve((load if turn is None else turn.T @ load)[unknown] - rows @ change)
        self._change = change if turn is None else turn @ change
        self.iterations += 1
        return np.where(self.fixed, 0.0, (self.residual() + tangent @ self._change)[dofs])

    def advance(self, fraction: float) -> bool:
        """Set the state to the last one linearised plus a ``fraction`` of its increment; return whether J > 0."""
        self.state = self._from + fraction * self._change
        return self.is_sound

    @property
    def is_sound(self) -> bool:
        """Whether no tissue is inside out."""
        return bool(np.isfinite(self.energy))

    @property
    def energy(self) -> float:
        """The energy, NaN if tissue is inside out."""
        if self._energy is None:
            self._energy = self.system.forms.energy(self._now)
        return self._energy

    def _blocks(self, blocks: FloatArray) -> sp.csr_matrix:
        """Return the matrix with ``blocks`` (n, 2, 2) at the nodes."""
        rows, columns = (np.repeat(self._dofs, 2, axis=1), np.tile(self._dofs, 2))
        size = len(self._now)
        return sp.csr_matrix((blocks.reshape(-1, 4).ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))

    def _not_in_contact(self) -> FloatArray:
        """Return 1 at all dofs but those of the nodes."""
        free = np.ones(len(self._now))
        free[self._dofs] = 0.0
        return free


class HeldNodes:
    """A ``tissue`` whose components ``held`` (n, 2) go to positions ``goal`` (n, 2): see :class:`.newton.Held`."""

    is_compared = False

    def __init__(self, tissue: MeridianTissue, held: BoolArray, goal: FloatArray):
        """Begin at the tissue's state."""
        self._tissue, self._held, self._goal = tissue, held, goal
        nodes, dim = held.shape
        self._frames, self._nothing = np.broadcast_to(np.eye(dim), (nodes, dim, dim)), np.zeros((nodes, dim, dim))

    @property
    def energy(self) -> float:
        """The energy, NaN if tissue is inside out."""
        return self._tissue.energy

    @property
    def slope(self) -> float | None:
        """See :class:`.newton.Moving`."""
        return self._tissue.slope

    @property
    def _todo(self) -> FloatArray:
        return np.where(self._held, self._goal - self._tissue.positions(), 0.0)

    @property
    def is_there(self) -> bool:
        """Whether nodes are at their goal, but for rounding of positions."""
        return bool(np.abs(self._todo).max() <= _ROUNDED * np.abs(self._goal).max())

    def residual(self) -> tuple[float, float]:
        """Return the norms of the residual and of the forces that hold the nodes."""
        forces = self._tissue.forces()
        left = float(np.linalg.norm(np.where(self._held, 0.0, forces)))
        return hypot(self._tissue.unbalanced(), left), float(np.linalg.norm(np.where(self._held, forces, 0.0)))

    def rounding(self) -> float:
        """Return zero: factorisations leave no more than the tolerance."""
        return 0.0

    def linearise(self, tolerance: float) -> None:
        """Find the increment.

        Raises:
            SolveError: if the factorisation fails.
        """
        values = self._todo
        self._tissue.linearise(Constraint(self._frames, self._held, values, self._nothing, np.zeros_like(values)))

    def advance(self, fraction: float) -> bool:
        """Set the state to the last one linearised plus a ``fraction`` of its increment; return whether J > 0."""
        return self._tissue.advance(fraction)
