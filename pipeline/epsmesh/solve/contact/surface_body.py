"""A linear elastic body without a tool, factorised: its response to forces on nodes of its surface."""

from contextlib import ExitStack

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.elements.base import Elements, Solver
from epsmesh.solve.elements.displacement import DisplacementSolver
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Right-hand sides solved together; in mixed elements each such solve factorises anew.
_TOGETHER, _TOGETHER_MIXED = 64, 192
# The solver is direct: its tolerance has no effect.
_EXACT = 1e-12


class SurfaceBody:
    """Elements of a ``law`` under forces on candidates, by a direct ``solver``; methods are collective.

    ``local`` (n) are the local blocks of the candidates, −1 for those of other ranks.
    """

    def __init__(self, elements: Elements, law: MaterialLaw, local: IntArray, solver: Solver):
        self._elements, self._unit, self._solver = elements, elements.unit(law), solver
        self._space = space = elements.displacements
        dofs = 3 * local[:, None] + np.arange(3)
        self._dofs = np.where((local[:, None] >= 0) & (dofs < space.owned), dofs, -1)

    def is_free(self) -> BoolArray:
        """Return a mask (n, 3) of the components that neither symmetry nor support fix."""
        own = self._dofs >= 0
        fixed = own & np.isin(self._dofs, self._space.prescribed_owned)
        return np.asarray(global_sum(self._space.comm, fixed.astype(float)) == 0)

    def moved(self, forces: FloatArray) -> tuple[FloatArray, tuple[FloatArray, ...]]:
        """Return the displacements (n, 3) of all candidates and the unknowns, under ``forces`` (n, 3) in N."""
        own, load = self._dofs >= 0, np.zeros(self._space.owned)
        load[self._dofs[own]] = forces[own] / self._unit
        (unknowns,) = self.solved([(load,)])
        return self.gathered(unknowns[0]), unknowns

    @stage("condensation")
    def compliance(self, components: IntArray) -> FloatArray:
        """Return the compliance (k, k) in m/N, symmetric, of free ``components`` (k, 2): candidates and their axes."""
        nodes, axes = components.T
        found, dofs = np.empty((len(nodes), len(nodes))), self._dofs[nodes, axes]
        is_mixed = not isinstance(self._solver, DisplacementSolver)
        together = _TOGETHER_MIXED if is_mixed else _TOGETHER
        for first in range(0, len(nodes), together):
            some = dofs[first : first + together]
            loads = np.zeros((self._space.owned, len(some)), order="F")
            here = np.flatnonzero(some >= 0)
            loads[some[here], here] = 1 / self._unit
            if isinstance(self._solver, DisplacementSolver) and self._space.comm.size == 1:
                found[:, first : first + len(some)] = self._solver.linear.solve_many(loads)[dofs]
                continue
            for number, (moved, *_) in enumerate(self.solved([(load,) for load in loads.T]), start=first):
                found[:, number] = self.gathered(moved)[nodes, axes]
        return (found + found.T) / 2

    def solved(self, loads: list[tuple[FloatArray, ...]]) -> list[tuple[FloatArray, ...]]:
        """Return the unknowns for each of several ``loads``: fields of the elements, in the law's unit; zero if none.

        Raises:
            SolveError: if the factorisation fails.
        """
        space = self._space
        nothing = np.zeros(len(space.forms.displacement.x.array))
        with ExitStack() as stack:
            columns = []
            for load in loads:
                right, unknown = (stack.enter_context(self._elements.fields()) for _ in range(2))
                for part, values in zip(right, load, strict=False):
                    part.array[:] = values
                right[0].array[space.prescribed_owned] = 0.0
                columns.append(Column(prescribed=nothing, applied=None, right=right, unknown=unknown))
            self._solver.solve(columns, _EXACT)
            return [tuple(np.array(part.array) for part in column.unknown) for column in columns]

    def gathered(self, values: FloatArray) -> FloatArray:
        """Return displacements (n, 3) of all candidates from ``values`` on owned dofs."""
        own = self._dofs >= 0
        found = np.zeros(self._dofs.shape)
        found[own] = values[self._dofs[own]]
        return np.asarray(global_sum(self._space.comm, found))
