"""Static condensation of a linear body to nodes of its surface: each active set is then a small dense solve.

A unit force on each node in turn gives the compliance C, the inverse of the stiffness condensed to these nodes: its
columns are the nodes' displacements. For an active set A with displacement b the reactions solve C_AA r = b, exactly as
in a direct solve. The result does not depend on the initial guess.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from functools import cached_property
from math import nan

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve import SolveError
from epsmesh.solve.contact.constraint import Constraint, Sliding
from epsmesh.solve.contact.elements import ContactElements, FarShare, SurfaceState, Unknowns
from epsmesh.solve.contact.levels import Hierarchy, Surface
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.surface_body import SurfaceBody
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.linear_solver import Level
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Most candidates for which condensation pays within ten depths, measured: benchmarks/results/solvers.md.
_MOST_CANDIDATES = 1_500


class CondensedTissue:
    """A linear body seen from nodes of its surface, through their compliance: see :class:`.deformed.Tissue`.

    ``compliance`` (n, d, n, d), in m/N, is symmetric; ``fixed`` (n, d) are the components that have none. The tool's
    normal is the last axis. The state are forces (N) and displacements (m) of the nodes at ``places`` (n, d), m.
    """

    is_sound, energy, slope = True, nan, None  # steps are exact

    def __init__(self, compliance: FloatArray, places: FloatArray, fixed: BoolArray):
        """Begin at rest."""
        self._compliance, self.places, self.fixed = compliance.reshape(fixed.size, -1), places, fixed
        self.state = np.zeros((2, *fixed.shape))

    def positions(self) -> FloatArray:
        """Return the nodes' places under the forces (n, d), in m."""
        return np.asarray(self.places + self.state[1])

    def forces(self) -> FloatArray:
        """Return the forces (n, d) on the nodes, N."""
        return np.asarray(self.state[0])

    def unbalanced(self) -> float:
        """Return zero: the body below is condensed."""
        return 0.0

    def linearise(self, constraint: Constraint) -> FloatArray:
        """Find the forces (n, d) under a ``constraint``, and return them; they are exact.

        Raises:
            SolveError: if the compliance is not positive definite.
        """
        wanted = self.state[1] + np.einsum("nii->ni", constraint.frames) * constraint.values
        sliding = constraint.sliding
        if sliding is None or not sliding.nodes.any():
            forces = self._holding(constraint.held & ~self.fixed, wanted)
        else:
            forces = self._sliding(constraint.held[:, -1], wanted, sliding)
        self._from, self._to = self.state, np.stack([forces, self.moved(forces)])
        return forces

    def advance(self, fraction: float) -> bool:
        """Set the state to the last one linearised plus a ``fraction`` of its increment."""
        self.state = self._from + fraction * (self._to - self._from)
        return True

    def moved(self, forces: FloatArray) -> FloatArray:
        """Return the displacements (n, d), m, under ``forces`` (n, d), N."""
        return np.asarray((self._compliance @ forces.ravel()).reshape(forces.shape))

    @property
    def penalty(self) -> FloatArray:
        """The parameter c (n) of the trial traction (N/m): the stiffness of a node alone, along tangents."""
        own = self._compliance.diagonal().reshape(self.fixed.shape)[:, :-1].max(axis=1)
        return np.divide(1.0, own, out=np.zeros_like(own), where=own > 0)

    def _holding(self, held: BoolArray, wanted: FloatArray) -> FloatArray:
        """Return the forces (n, d) that move the ``held`` components (n, d) to ``wanted`` (n, d), m."""
        forces, those = np.zeros(held.shape), np.flatnonzero(held)
        if len(those):
            try:
                factors = cho_factor(self._compliance[np.ix_(those, those)], check_finite=False)
            except np.linalg.LinAlgError as error:
                raise SolveError("the compliance of the condensed surface is not positive definite") from error
            forces[held] = cho_solve(factors, wanted[held], check_finite=False)
        return forces

    def _sliding(self, active: BoolArray, wanted: FloatArray, sliding: Sliding) -> FloatArray:
        """Return the forces (n, d) on ``active`` nodes (n), which move to ``wanted`` (n, d), m, or are ``sliding``."""
        nodes, dim = np.flatnonzero(active), self.fixed.shape[1]
        all_of = (dim * nodes[:, None] + np.arange(dim)).ravel()
        rows = self._compliance[np.ix_(all_of, all_of)].reshape(len(nodes), dim, len(nodes), dim)
        right, (those,) = wanted[nodes], np.nonzero(sliding.nodes[nodes])
        which, count, tangents = nodes[those], np.arange(len(those)), np.arange(dim - 1)
        turning = sliding.turning[which][:, :-1, :-1]
        pull = sliding.penalty[which][:, None, None] * turning
        equations = (pull @ rows[those, :-1].reshape(len(those), dim - 1, -1)).reshape(len(those), dim - 1, -1, dim)
        own = np.ix_(count, tangents, tangents)
        equations[own[0], own[1], those[:, None, None], own[2]] += np.eye(dim - 1) - turning
        equations[count, :, those, -1] += sliding.slope[which, :-1]  # the pressure counts against the last axis
        rows[those, :-1] = equations
        right[those, :-1] = np.einsum("kij,kj->ki", pull, (self.state[1] - sliding.slips)[which, :-1])
        free, found = np.flatnonzero(~self.fixed[nodes]), np.zeros(len(all_of))
        found[free] = np.linalg.solve(rows.reshape(len(found), -1)[np.ix_(free, free)], right.ravel()[free])
        forces = np.zeros(self.fixed.shape)
        forces[nodes] = found.reshape(-1, dim)
        return forces


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
        self._multigrid: Hierarchy | None = None
        free = self.without_tool.is_free() & [False, False, True]
        with stage("set-up"):
            self._near = np.zeros((len(free), len(free)))
            self._near[np.ix_(free[:, 2], free[:, 2])] = self.without_tool.compliance(np.argwhere(free))
        self.couple(None)

    @cached_property
    def without_tool(self) -> SurfaceBody:
        """The body without a tool, with the operator of all sets."""
        level = Level(self.space.space, self.hierarchy.finest, self.space.prescribed)
        nothing = np.empty(0, dtype=np.int32)
        solver = self.plug.solver_on([level], self.law, nothing, direct=True, earlier=None)
        self._stack.callback(solver.close)
        return SurfaceBody(self.plug, self.law, self.numbering.local, solver)

    def tissue(self, tolerances: Sequence[float], energy: float | None) -> CondensedTissue:
        """Return the condensed tissue in its current state; it is exact, whatever the tolerances."""
        return self._tissue

    def couple(self, far: FarShare | None) -> None:
        """Couple a far field to the cut face from now on: it adds φ φᵀ / k to the compliance."""
        super().couple(far)
        compliance, count = self._near, len(self.candidates)
        if far is not None:
            compliance = compliance + np.outer(far.unit.moved, far.unit.moved) / far.stiffness
        self._tissue = CondensedTissue(compliance[:, None, :, None], np.zeros((count, 1)), self.is_fixed[:, None])

    def state(self) -> SurfaceState:
        """Return displacements and reactions of the candidates; the far field takes the amplitude of these."""
        reactions, moved = self._tissue.state[..., 0]
        if self.far is not None:
            self.far.share = self.far.wanted(reactions)
        return SurfaceState(moved, reactions, float(moved @ reactions))

    def begin(self, state: SurfaceState, unknowns: Unknowns) -> None:
        """Begin with forces of the candidates; the far field may be another one than that of the ``state``."""
        forces = state.reactions[:, None]
        self._tissue.state = np.stack([forces, self._tissue.moved(forces)])

    def unknowns(self) -> Unknowns:
        """Return the displacement (m) of the whole body, owned dofs, under the current reactions."""
        reactions = self._tissue.forces()
        return self.without_tool.moved(np.pad(reactions, ((0, 0), (2, 0))))[1]

    def relax(self, tolerance: float, load: Unknowns) -> Unknowns:
        """Return the solution for a ``load`` on the body without a probe."""
        return self.without_tool.solved([load])[0]

    def held_levels(self, facets: Int32Array, stack: ExitStack) -> list[Level]:
        """Return multigrid levels with the local ``facets`` fixed; they are kept for the next depth."""
        if self._multigrid is None:
            self._multigrid = self.hierarchy_of(self._stack, direct=False)
        return self._multigrid.hold_facets(facets)
