"""Displacement elements condensed to the nodes that may touch: a set, and a depth, then cost a small dense solve.

With a unit force on each candidate in turn, the displacements of all of them are the columns of the compliance C, the
inverse of the stiffness condensed to these nodes. Of a set A that is moved to b, the reactions are the solution of
C_AA r = b, exact as those of a direct solve: what is found does not depend on where the search began.
"""

from contextlib import ExitStack

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from pipeline.arrays import BoolArray, FloatArray, Int32Array
from pipeline.solve import SolveError
from pipeline.solve.compiled import vector
from pipeline.solve.contact.elements import ContactElements, FarShare, State, Unknowns
from pipeline.solve.contact.levels import Hierarchy, Surface
from pipeline.solve.contact.surface import Candidates
from pipeline.solve.elements.base import Elements
from pipeline.solve.linear_solver import Level, LinearSolver
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

# Surfaces up to which it pays for ten depths, measured: docs/solvers.md.
_MOST_CANDIDATES = 1_500
# Right-hand sides at a time.
_TOGETHER = 64


def suits(elements: Elements, candidates: Candidates, method: str) -> bool:
    """Tell whether to condense the surface of a small body: on one process, if a direct solve is not ruled out."""
    small = len(candidates) <= _MOST_CANDIDATES and elements.body.comm.size == 1
    return method != "iterative" and elements.element == "displacement" and small


class CondensedElements(ContactElements):
    """Displacements on one process, with the compliance of the candidates. Freed with the stack."""

    is_exact = True

    def __init__(self, elements: Elements, surface: Surface, law: MaterialLaw, method: str, stack: ExitStack):
        """Assemble, factorise and condense.

        Raises:
            SolveError: if the factorisation fails.
        """
        super().__init__(elements, surface, law, method, stack)
        self._stack = stack
        self._multigrid: Hierarchy | None = None
        self._free = self._factor()
        stack.callback(self._free.close)
        self._dofs = self.numbering.normal_dofs(np.ones(len(self.candidates), dtype=bool))
        order = np.argsort(3 * self.numbering.local + 2)
        self._place = np.empty_like(order)
        self._place[order] = np.arange(len(order))  # of each candidate among the sorted dofs
        with stage("set-up"):
            self._near = self._compliance = self._condense()

    def _factor(self) -> LinearSolver:
        space = self.space
        level = Level(space.space, self.hierarchy.finest, space.prescribed)
        return LinearSolver([level], direct=True)

    @stage("condensation")
    def _condense(self) -> FloatArray:
        """Return C (n, n), in m/N, symmetric."""
        count, size = len(self._dofs), self.space.owned
        compliance = np.empty((count, count))
        for first in range(0, count, _TOGETHER):
            here = self._dofs[first : first + _TOGETHER]
            loads = np.zeros((size, len(here)), order="F")
            loads[here, np.arange(len(here))] = 1.0
            compliance[:, first : first + len(here)] = self._free.solve_many(loads)[self._dofs]
        compliance = compliance[np.ix_(self._place, self._place)]
        return (compliance + compliance.T) / 2

    def hold(self, active: BoolArray) -> None:
        """Hold the ``active`` candidates (n) from now on."""
        self._active = active

    def approach(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Find the reactions that move what is held to ``bounds`` (n, m): exactly, whatever the ``tolerance``.

        Raises:
            SolveError: if the compliance is not definite.
        """
        held = np.flatnonzero(self._active)
        try:
            pressed = cho_solve(cho_factor(self._compliance[np.ix_(held, held)], check_finite=False), bounds[held])
        except np.linalg.LinAlgError as error:
            raise SolveError("the condensed surface has no positive compliance") from error
        self._reactions = np.zeros(len(bounds))
        self._reactions[held] = pressed
        return 1

    def near_state(self) -> State:
        """Return what the candidates do, far field aside."""
        moved = self._compliance @ self._reactions
        return State(moved, self._reactions, float(moved @ self._reactions))

    def couple(self, far: FarShare | None) -> None:
        """Let a far field act on the cut face from now on: it adds φ φᵀ / k to the compliance."""
        super().couple(far)
        if far is not None:
            self._compliance = self._near + np.outer(far.unit.moved, far.unit.moved) / far.stiffness

    def improve(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Find the reactions that move what is held to ``bounds`` (n, m), and the share of the far field."""
        iterations = self.approach(bounds, tolerance, energy)
        if self.far is not None:
            self.far.share = self.far.wanted(self._reactions)
        return iterations

    def state(self) -> State:
        """Return what the candidates do."""
        return self.near_state()

    def unknowns(self) -> Unknowns:
        """Return the displacement (m) of the whole body, owned dofs, for the reactions found."""
        with vector(self.space.space) as loads:
            self.numbering.put(loads.array, self._reactions, self._active)
            self._free.solve(loads, self.fields[0])
        return super().unknowns()

    def relax(self, tolerance: float, load: Unknowns) -> Unknowns:
        """Return the solution for a ``load`` with nothing held by the probe."""
        space = self.space
        with vector(space.space) as rhs, vector(space.space) as found:
            (rhs.array[:],) = load
            rhs.array[space.prescribed_owned] = 0.0
            self._free.solve(rhs, found)
            return (np.array(found.array),)

    def held_levels(self, facets: Int32Array, stack: ExitStack) -> list[Level]:
        """Return the levels of multigrid with the local ``facets`` held; they are kept for the next depth."""
        if self._multigrid is None:
            self._multigrid = self.hierarchy_of(self._stack, direct=False)
        return self._multigrid.hold_facets(facets)
