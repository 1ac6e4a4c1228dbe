"""Static condensation of displacement elements to the candidate nodes: each active set is then a small dense solve.

A unit force on each candidate in turn gives the compliance C, the inverse of the stiffness condensed to these nodes:
its columns are the candidates' displacements. For an active set A with displacement b the reactions solve C_AA r = b,
exactly as in a direct solve. The result does not depend on the initial guess.
"""

from contextlib import ExitStack

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import vector
from epsmesh.solve.contact.elements import ContactElements, FarShare, State, Unknowns
from epsmesh.solve.contact.levels import Hierarchy, Surface
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Most candidates for which condensation pays within ten depths, measured: benchmarks/results/solvers.md.
_MOST_CANDIDATES = 1_500
# Right-hand sides solved together.
_TOGETHER = 64


def suits(elements: Elements, candidates: Candidates, method: str) -> bool:
    """Return whether to condense: a small body, on one process, and a direct solve is not excluded."""
    small = len(candidates) <= _MOST_CANDIDATES and elements.body.comm.size == 1
    return method != "iterative" and elements.element == "displacement" and small


class CondensedElements(ContactElements):
    """Displacement elements on one process, with the compliance of the candidates; freed with the stack."""

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
        self._place[order] = np.arange(len(order))  # position of each candidate among the sorted dofs
        with stage("set-up"):
            self._near = self._compliance = self._condense()

    def _factor(self) -> LinearSolver:
        space = self.space
        level = Level(space.space, self.hierarchy.finest, space.prescribed)
        return LinearSolver([level], direct=True)

    @stage("condensation")
    def _condense(self) -> FloatArray:
        """Return the compliance C (n, n), in m/N, symmetric."""
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
        """Prescribe the displacement of the ``active`` candidates (n) from now on."""
        self._active = active

    def approach(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Find the reactions that move the active nodes to ``bounds`` (n, m), exactly: ``tolerance`` is ignored.

        Raises:
            SolveError: if the compliance is not positive definite.
        """
        held = np.flatnonzero(self._active)
        try:
            pressed = cho_solve(cho_factor(self._compliance[np.ix_(held, held)], check_finite=False), bounds[held])
        except np.linalg.LinAlgError as error:
            raise SolveError("the compliance of the condensed surface is not positive definite") from error
        self._reactions = np.zeros(len(bounds))
        self._reactions[held] = pressed
        return 1

    def near_state(self) -> State:
        """Return displacements and reactions of the candidates, without the far field."""
        moved = self._compliance @ self._reactions
        return State(moved, self._reactions, float(moved @ self._reactions))

    def couple(self, far: FarShare | None) -> None:
        """Couple a far field to the cut face from now on: it adds φ φᵀ / k to the compliance."""
        super().couple(far)
        if far is not None:
            self._compliance = self._near + np.outer(far.unit.moved, far.unit.moved) / far.stiffness

    def improve(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Find the reactions that move the active nodes to ``bounds`` (n, m), and the amplitude of the far field."""
        iterations = self.approach(bounds, tolerance, energy)
        if self.far is not None:
            self.far.share = self.far.wanted(self._reactions)
        return iterations

    def state(self) -> State:
        """Return displacements and reactions of the candidates."""
        return self.near_state()

    def unknowns(self) -> Unknowns:
        """Return the displacement (m) of the whole body, owned dofs, under the current reactions."""
        with vector(self.space.space) as loads:
            self.numbering.put(loads.array, self._reactions, self._active)
            self._free.solve(loads, self.fields[0])
        return super().unknowns()

    def relax(self, tolerance: float, load: Unknowns) -> Unknowns:
        """Return the solution for a ``load`` on the body without a probe."""
        space = self.space
        with vector(space.space) as rhs, vector(space.space) as found:
            (rhs.array[:],) = load
            rhs.array[space.prescribed_owned] = 0.0
            self._free.solve(rhs, found)
            return (np.array(found.array),)

    def held_levels(self, facets: Int32Array, stack: ExitStack) -> list[Level]:
        """Return multigrid levels with the local ``facets`` fixed; they are kept for the next depth."""
        if self._multigrid is None:
            self._multigrid = self.hierarchy_of(self._stack, direct=False)
        return self._multigrid.hold_facets(facets)
