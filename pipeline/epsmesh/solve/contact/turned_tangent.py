"""Linear systems of the tangent in turned frames, in which normal displacements of active nodes are held.

Systems are solved by conjugate gradients, in mixed elements by generalised conjugate residuals, with the matrix-free
tangent, or factorised on request. The preconditioner is that of linear elasticity, which holds the same nodes
along z: it knows neither the turn of the frames nor the strain, and needs more iterations the larger both are.
"""

from abc import ABC, abstractmethod
from contextlib import ExitStack
from functools import cached_property

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve.contact.constraint import Constraint
from epsmesh.solve.contact.levels import Hierarchy, Surface
from epsmesh.solve.contact.numbering import Numbering, Pairs
from epsmesh.solve.contact.sliding import Slipping
from epsmesh.solve.elements.assembled import AssembledTangent
from epsmesh.solve.elements.base import Elements, Solver
from epsmesh.solve.elements.displacement import DisplacementSolver
from epsmesh.solve.elements.mixed import MixedElements, MixedSolver
from epsmesh.solve.elements.pressures import without_columns
from epsmesh.solve.hyperelastic import HyperelasticBody
from epsmesh.solve.kernels.pressure import matrix_of
from epsmesh.solve.krylov import (
    INDEFINITE,
    check_converged,
    explained,
    factorised,
    has_converged,
    is_nearly_converged,
    is_truncated,
    keep,
    solver_of,
)
from epsmesh.solve.newton import FINE, forcing
from epsmesh.solve.physics import MaterialLaw

_MOST_ITERATIONS = 300
# Tolerances of linear solves where nodes rest on a bed: the least, that with friction, and those while the set still
# changes, without and with friction; and the share of the gain that is needed to the end.
_ON_BED, _RUBBED, _TRIED, _TRIED_RUBBED, _SPARE = 1e-8, 1e-6, 1e-3, 1e-4, 0.1


def tolerance_on_bed(enough: float, *, rubs: bool, is_tried: bool) -> float:
    """Return the relative tolerance of a linear solve where nodes rest on a bed.

    Far from the tool, nodes there carry little, and rough solves would judge them in the end. ``enough`` is the share
    of the load that may be left then: above 1 if less is left already.
    """
    tried, least = (_TRIED_RUBBED, _RUBBED) if rubs else (_TRIED, _ON_BED)
    return tried if is_tried else min(max(least, _SPARE * enough), tried)


class TurnedTangent(ABC):
    """The tangent K - Σ λ H of a ``body`` with contact, in the unit of the forms. Methods are collective."""

    def __init__(
        self,
        elements: Elements,
        law: MaterialLaw,
        body: HyperelasticBody,
        numbering: Numbering,
        surface: Surface,
        stack: ExitStack,
    ):
        """Prepare; what is made is freed with the stack."""
        self.pairs = surface.pairs(elements.degree)
        self.slipping: Slipping | None = None
        self._elements, self._space = elements, elements.displacements
        self._law, self._unit, self._stack = law, elements.unit(law), stack
        self._body, self._numbering = body, numbering
        self._here = numbering.is_owned
        self._dofs = 3 * numbering.local[self._here][:, None] + np.arange(3)

    @abstractmethod
    def update(self, state: PETSc.Vec, constraint: Constraint) -> None:
        """Evaluate the tangent at a state."""

    @abstractmethod
    def multiply(self, x: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the product with a change of the state, which is zero at prescribed dofs; other rows are valid."""

    @abstractmethod
    def solve(self, constraint: Constraint, right: PETSc.Vec, change: PETSc.Vec, target: float) -> None:
        """Add to ``change`` the solution for ``right`` that is zero where the constraint holds.

        ``target`` is the norm of the residual at the end of Newton's method, in the unit of the forms.

        Raises:
            SolveError: if the solver fails.
        """

    def _frames_of(self, constraint: Constraint) -> FloatArray:
        """Return the frames (n, 3, 3) of the candidates that the matrix S of loose tissue has not turned already."""
        return constraint.frames if self.pairs is None else self.pairs.upright(constraint.frames)

    def _joined(self, constraint: Constraint) -> Pairs | None:
        """Return the pairs of loose tissue where a constraint holds."""
        return None if self.pairs is None else self.pairs.holding(constraint.held[:, -1], self._firm(constraint))

    def _firm(self, constraint: Constraint) -> BoolArray | None:
        """Return the nodes (n) whose tangents are held where the preconditioner has to know it: above a bed, and on a
        tool that deforms, to which they are then tied."""
        firm = constraint.firm
        if self.pairs is None:
            return firm
        tied = np.zeros(len(constraint.held), dtype=bool)
        tied[self.pairs.nodes] = constraint.held[self.pairs.nodes].all(axis=1)
        return tied if firm is None else firm | tied

    def _slots(self, constraint: Constraint) -> Int32Array:
        """Return the owned dofs that are held in the turned frames: of the constraint, and prescribed ones."""
        held = np.zeros(self._space.owned)
        self._numbering.put_vectors(held, constraint.held.astype(float))
        held[self._space.prescribed_owned] = 1.0
        return np.flatnonzero(held).astype(np.int32)


class FactorisedTangent(TurnedTangent):
    """The assembled tangent, factorised at each solve."""

    @cached_property
    def _tangent(self) -> AssembledTangent:
        return AssembledTangent(self._elements, self._law, self._stack)

    def update(self, state: PETSc.Vec, constraint: Constraint) -> None:
        """Assemble the tangent at a state."""
        self._body.show(state)
        self._tangent.update()
        stiffness, index_map = self._tangent.blocks[0], self._space.space.dofmap.index_map
        for number in np.flatnonzero(self._here & constraint.turning.any(axis=(1, 2))):
            rows = 3 * (index_map.local_range[0] + self._numbering.local[number]) + np.arange(3)
            rows = rows.astype(PETSc.IntType)
            stiffness.setValues(rows, rows, -constraint.turning[number] / self._unit, PETSc.InsertMode.ADD_VALUES)
        self._tangent.matrix.assemble()

    def multiply(self, x: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the product with a change of the state."""
        self._tangent.matrix.mult(x, result)

    def solve(self, constraint: Constraint, right: PETSc.Vec, change: PETSc.Vec, target: float) -> None:
        """Add the solution that is zero where the constraint holds."""
        owned, held = self._space.owned, self._slots(constraint)
        with ExitStack() as stack, explained():
            turn = keep(stack, self._turn(constraint))
            matrix = keep(stack, self._turned(turn, held, stack))
            load, found = (keep(stack, vector) for vector in matrix.createVecs())
            whole, turned = (keep(stack, vector) for vector in turn.createVecs())
            whole.array[:] = right.array[:owned]
            turn.multTranspose(whole, turned)
            load.array[:owned], load.array[owned:] = turned.array, right.array[owned:]
            load.array[held] = 0.0
            factorised(matrix, stack).solve(load, found)
            turned.array[:] = found.array[:owned]
            turn.mult(turned, whole)
            change.array[:owned] += whole.array
            change.array[owned:] += found.array[owned:]

    def _turn(self, constraint: Constraint) -> PETSc.Mat:
        """Return the matrix of the frames, on displacements: an orthogonal one, or S times it where tissue is loose."""
        space, blocks = self._space, self._space.owned // 3
        frames = np.broadcast_to(np.eye(3), (blocks, 3, 3)).copy()
        frames[self._numbering.local[self._here]] = self._frames_of(constraint)[self._here]
        first = space.space.dofmap.index_map.local_range[0]
        columns = 3 * (first + np.arange(blocks))[:, None, None] + np.arange(3)
        columns = np.broadcast_to(columns, (blocks, 3, 3)).astype(PETSc.IntType).ravel()
        rows = np.arange(0, len(columns) + 1, 3, dtype=PETSc.IntType)
        size = (space.owned, space.size)
        found = PETSc.Mat().createAIJ((size, size), csr=(rows, columns, frames.ravel()), comm=space.comm)
        if (pairs := self._joined(constraint)) is None:
            return found
        with ExitStack() as stack:
            return keep(stack, pairs.matrix(found)).matMult(keep(stack, found))

    def _turned(self, turn: PETSc.Mat, held: Int32Array, stack: ExitStack) -> PETSc.Mat:
        """Return the tangent in the turned frames, with the ``held`` slots eliminated."""
        stiffness, *others = self._tangent.blocks
        turned = stiffness.ptap(turn)
        first, _ = turned.getOwnershipRange()
        turned.zeroRowsColumns((first + held).astype(PETSc.IntType), 1.0)
        if others:
            keep(stack, turned)
            coupling, of_pressures = others
            coupled = keep(stack, coupling.matMult(turn))
            without_columns(coupled, held)
            transpose = keep(stack, coupled.transpose(PETSc.Mat()))
            nest = keep(stack, PETSc.Mat().createNest([[turned, transpose], [coupled, of_pressures]], comm=turn.comm))
            turned = nest.convert("aij", PETSc.Mat())
        turned.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return turned


class IteratedTangent(TurnedTangent):
    """The matrix-free tangent, with linear elasticity as preconditioner; a context for PETSc."""

    def __init__(
        self,
        elements: Elements,
        law: MaterialLaw,
        body: HyperelasticBody,
        numbering: Numbering,
        surface: Surface,
        stack: ExitStack,
    ):
        """Set up; freed with the stack.

        Raises:
            SolveError: if the set-up fails.
        """
        super().__init__(elements, law, body, numbering, surface, stack)
        elastic = elements.elastic(law)
        self._hierarchy = Hierarchy(surface, elements.degree, elastic, stack, direct=False, masks=elements.masks)
        self._solver: Solver | None = None
        self._sets = np.zeros(len(numbering.local), dtype=bool)  # of the preconditioner
        self._before = 0.0  # norm of the last right-hand side
        stack.callback(self._close)
        self._work = [stack.enter_context(body.state()) for _ in range(2)]
        size = self._work[0].getLocalSize()
        self._matrix = keep(stack, matrix_of(self, size, size, self._space.comm))

    def _close(self) -> None:
        if self._solver is not None:
            self._solver.close()

    def update(self, state: PETSc.Vec, constraint: Constraint) -> None:
        """Evaluate the moduli at a state."""
        self._body.assemble(state)
        self._turning = constraint.turning[self._here] / self._unit

    def multiply(self, x: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the product with a change of the state."""
        self._body.tangent.mult(x, result)
        result.array[self._dofs] -= np.einsum("nij,nj->ni", self._turning, x.array_r[self._dofs])
        if self.slipping is not None:
            self.slipping.add(x.array_r, result.array, 1 / self._unit)

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, result: PETSc.Vec) -> None:
        """Write the product in the turned frames, identity at held slots; PETSc calls this."""
        whole, image = self._work
        whole.array[:] = x.array_r
        whole.array[self._held] = 0.0
        self._turn(whole)
        self.multiply(whole, image)
        self._turn_back(image)
        image.array[self._held] = x.array_r[self._held]
        result.array[:] = image.array

    def solve(self, constraint: Constraint, right: PETSc.Vec, change: PETSc.Vec, target: float) -> None:
        """Add the solution that is zero where the constraint holds."""
        self._frames, self._held = self._frames_of(constraint)[self._here], self._slots(constraint)
        self._now = self._joined(constraint)
        with ExitStack() as stack, self._body.state() as load, self._body.state() as found, explained():
            load.array[:] = right.array
            self._turn_back(load)
            load.array[self._held] = 0.0
            self._iterate(constraint, load, found, target, stack)
            self._turn(found)
            change.axpy(1.0, found)

    def _iterate(
        self, constraint: Constraint, load: PETSc.Vec, found: PETSc.Vec, target: float, stack: ExitStack
    ) -> None:
        preconditioner = self._preconditioner(constraint, stack)
        is_mixed, norm = isinstance(self._elements, MixedElements), load.norm()
        gained, self._before = norm / self._before if self._before else 1.0, norm
        tolerance = forcing(gained, target / norm if norm else 1.0)
        rubs = constraint.sliding is not None
        if rubs:
            # Friction is corrected once an iteration, and then gains little: its nodes would be judged by rough solves.
            tolerance = FINE
        if constraint.resting is not None:
            enough = target / norm if norm else 1.0
            tolerance = tolerance_on_bed(enough, rubs=rubs, is_tried=constraint.is_tried)
        for kind in ("tangent, mixed",) if is_mixed else ("tangent", "tangent, mixed"):
            how = {"ksp_rtol": tolerance, "ksp_max_it": _MOST_ITERATIONS}
            ksp = solver_of(kind, self._matrix, stack, preconditioner, **how)
            found.set(0.0)
            ksp.solve(load, found)
            # The loop judges the state by its residual: a poor step costs iterations, and no accuracy.
            is_enough = is_nearly_converged(ksp) or (constraint.is_there and is_truncated(ksp, found))
            if is_enough or has_converged(ksp):
                break
            # Conjugate gradients end where the tangent is indefinite, as far from equilibrium.
            if ksp.getConvergedReason() == INDEFINITE and isinstance(self._solver, DisplacementSolver):
                self._solver.linear.refine_eigenvalues()
        self._body.iterations += int(ksp.its) if is_enough else check_converged(ksp)

    def _preconditioner(self, constraint: Constraint, stack: ExitStack) -> object:
        """Return the preconditioner of linear elasticity with the same nodes held along z."""
        active, firm = constraint.held[:, -1], self._firm(constraint)
        sets = active if firm is None else np.append(active, firm)
        if self._solver is None or not np.array_equal(sets, self._sets):
            held = self._numbering.normal_dofs(active, owned=True)
            if firm is not None:
                held = np.union1d(held, self._numbering.all_dofs(firm, owned=True)).astype(np.int32)
            levels = self._hierarchy.hold(active, firm)
            self._solver = self._elements.solver_on(levels, self._law, held, direct=False, earlier=self._solver)
            self._sets = sets
        if isinstance(self._solver, MixedSolver):
            elements = self._solver.elements
            return self._solver.saddle.preconditioner(elements.compliance(self._law), stack)
        assert isinstance(self._solver, DisplacementSolver)
        return self._solver.linear

    def _turn(self, change: PETSc.Vec) -> None:
        """Change displacements in the turned frames to those along the axes."""
        self._rotate(change.array, "nij,nj->ni")
        if self._now is not None:
            self._now.join(change.array)

    def _turn_back(self, forces: PETSc.Vec) -> None:
        """Change forces along the axes to those in the turned frames."""
        if self._now is not None:
            self._now.fold(forces.array)
        self._rotate(forces.array, "nji,nj->ni")

    def _rotate(self, values: FloatArray, how: str) -> None:
        values[self._dofs] = np.einsum(how, self._frames, values[self._dofs])
