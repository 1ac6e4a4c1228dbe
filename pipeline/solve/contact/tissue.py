"""A hyperelastic body seen from the nodes that a tool may touch: the interface of :mod:`.deformed` on its elements.

Linear systems are solved in turned frames, in which the normal displacement of an active node is one unknown.
"""

from contextlib import ExitStack

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray, Int32Array
from pipeline.solve.compiled import global_sum
from pipeline.solve.contact.deformed import Constraint
from pipeline.solve.contact.levels import Numbering
from pipeline.solve.contact.surface import Candidates
from pipeline.solve.elements.assembled import AssembledTangent
from pipeline.solve.elements.base import Elements
from pipeline.solve.elements.mixed import MixedElements
from pipeline.solve.elements.pressures import without_columns
from pipeline.solve.krylov import explained, factorised, keep
from pipeline.solve.newton import HyperelasticBody
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage


class DeformedBody:
    """Elements of a hyperelastic ``law`` with ``candidates`` of contact: see :class:`.deformed.Tissue`.

    The state is one vector of owned dofs: displacement, and in mixed elements pressure. What is made is freed with the
    stack.
    """

    def __init__(self, elements: Elements, candidates: Candidates, law: MaterialLaw, stack: ExitStack):
        """Set up; collective."""
        self.elements, self.candidates, self.law = elements, candidates, law
        space = self._space = elements.displacements
        self._body = HyperelasticBody(elements, law)
        self._tangent = AssembledTangent(elements, law, stack)
        elements.set_law(law)
        stack.callback(self._body.close)
        self._unit = elements.unit(law)
        self._numbering = Numbering(space.space, candidates.numbers)
        self._now, self._residual, self._change = (stack.enter_context(self._body.state()) for _ in range(3))
        self._from = self._now.array.copy()
        is_fixed = np.zeros(space.owned)
        is_fixed[space.prescribed_owned] = 1.0
        self.fixed = self._numbering.gather_vectors(is_fixed) > 0
        self._is_current = False
        self.iterations = 0

    # ---- the interface --------------------------------------------------------------------------------

    @property
    def state(self) -> FloatArray:
        """The unknowns of this rank."""
        return np.array(self._now.array)

    @state.setter
    def state(self, values: FloatArray) -> None:
        self._now.array[:] = values
        self._from, self._is_current = values.copy(), False

    def positions(self) -> FloatArray:
        """Return the nodes' deformed positions (n, 3), in m."""
        return self.candidates.points + self._numbering.gather_vectors(self._now.array[: self._space.owned])

    def forces(self) -> FloatArray:
        """Return the nodal forces (n, 3), N; zero at prescribed components."""
        return np.where(self.fixed, 0.0, self._numbering.gather_vectors(self._forces()[: self._space.owned]))

    def unbalanced(self) -> float:
        """Return the norm (N) of the residual at all other free dofs."""
        left = self._forces().copy()
        left[self._space.prescribed_owned] = 0.0
        self._numbering.put_vectors(left, np.zeros(self.fixed.shape))
        return float(np.sqrt(global_sum(self._space.comm, np.array([left @ left]))[0]))

    @stage("tangent solves")
    def linearise(self, constraint: Constraint) -> FloatArray:
        """Find the increment under a ``constraint``; return the nodal forces (n, 3), N, that it predicts.

        Raises:
            SolveError: if the linear solver fails.
        """
        self._body.show(self._now)
        self._tangent.update()
        self._from = self.state
        self._turn_normals(constraint)
        with ExitStack() as stack, self._body.state() as right, explained():
            turn = keep(stack, self._turn(constraint))
            held = self._slots(constraint)
            self._prescribe(constraint, turn, held)
            self._tangent.matrix.mult(self._change, right)
            right.array[:] = -right.array - self._forces() / self._unit
            self._numbering.add_vectors(right.array, constraint.forces / self._unit)
            self._turned_solve(turn, held, right, stack)
            self._tangent.matrix.mult(self._change, right)
            moved = self._numbering.gather_vectors(self._change.array[: self._space.owned])
            change = self._numbering.gather_vectors(self._unit * right.array[: self._space.owned])
        self.iterations += 1
        return self.forces() + change + np.einsum("nij,nj->ni", constraint.turning, moved)

    def advance(self, share: float) -> bool:
        """Set the state to the last one linearised plus a ``share`` of its increment; return whether J > 0."""
        self._now.array[:] = self._from + share * self._change.array
        self._is_current = False
        return self.is_sound

    @property
    def is_sound(self) -> bool:
        """Whether J > 0 everywhere; collective."""
        return bool(np.isfinite(self.energy))

    @property
    def energy(self) -> float:
        """Stored energy (J) of the modelled part, NaN if tissue is inside out; collective."""
        return self._body.energy(self._now)

    # ---- results ----------------------------------------------------------------------------------------

    def residual(self) -> FloatArray:
        """Return the nodal forces (N) of the displacement, owned dofs, reactions of the support included."""
        return self._forces()[: self._space.owned].copy()

    def split(self) -> list[FloatArray]:
        """Return the state by field."""
        with self.elements.fields() as parts:
            return self._body.split(self.state, parts)

    def show(self) -> None:
        """Set the fields of the forms."""
        self._body.show(self._now)

    def interpolate(self, coarse: Elements) -> None:
        """Set the state to the fields of the forms of ``coarse``."""
        self.elements.interpolate(coarse)
        fields = [self._space.forms.displacement.x.array[: self._space.owned]]
        if isinstance(self.elements, MixedElements):
            fields.append(self.elements.pressures.values)
        self.state = np.concatenate(fields)

    # ---- the linear system ------------------------------------------------------------------------------

    def _forces(self) -> FloatArray:
        if not self._is_current:
            self._body.forces(self._now, self._residual)
            self._is_current = True
        return np.asarray(self._residual.array)

    def _turn_normals(self, constraint: Constraint) -> None:
        """Subtract the change of the contact forces' directions from K."""
        stiffness, index_map = self._tangent.blocks[0], self._space.space.dofmap.index_map
        for number in np.flatnonzero(self._numbering.is_owned & constraint.turning.any(axis=(1, 2))):
            rows = 3 * (index_map.local_range[0] + self._numbering.local[number]) + np.arange(3)
            rows = rows.astype(PETSc.IntType)
            stiffness.setValues(rows, rows, -constraint.turning[number] / self._unit, PETSc.InsertMode.ADD_VALUES)
        self._tangent.matrix.assemble()

    def _turn(self, constraint: Constraint) -> PETSc.Mat:
        """Return the orthogonal matrix Q of the frames, on displacements."""
        space, blocks = self._space, self._space.owned // 3
        frames = np.broadcast_to(np.eye(3), (blocks, 3, 3)).copy()
        here = self._numbering.is_owned
        frames[self._numbering.local[here]] = constraint.frames[here]
        first = space.space.dofmap.index_map.local_range[0]
        columns = 3 * (first + np.arange(blocks))[:, None, None] + np.arange(3)
        columns = np.broadcast_to(columns, (blocks, 3, 3)).astype(PETSc.IntType).ravel()
        rows = np.arange(0, len(columns) + 1, 3, dtype=PETSc.IntType)
        size = (space.owned, space.size)
        return PETSc.Mat().createAIJ((size, size), csr=(rows, columns, frames.ravel()), comm=space.comm)

    def _slots(self, constraint: Constraint) -> Int32Array:
        """Return the owned dofs that are held in the turned frames: of the constraint, and prescribed ones."""
        held = np.zeros(self._space.owned)
        self._numbering.put_vectors(held, constraint.held.astype(float))
        held[self._space.prescribed_owned] = 1.0
        return np.flatnonzero(held).astype(np.int32)

    def _prescribe(self, constraint: Constraint, turn: PETSc.Mat, held: Int32Array) -> None:
        """Write the prescribed increment into the change."""
        moved = np.einsum("nij,nj->ni", constraint.frames, np.where(constraint.held, constraint.values, 0.0))
        self._change.set(0.0)
        self._numbering.put_vectors(self._change.array, np.where(self.fixed, 0.0, moved))

    def _turned_solve(self, turn: PETSc.Mat, held: Int32Array, right: PETSc.Vec, stack: ExitStack) -> None:
        """Add the free part of the increment to the change: a factorisation in the turned frames."""
        owned = self._space.owned
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
        self._change.array[:owned] += whole.array
        self._change.array[owned:] += found.array[owned:]

    def _turned(self, turn: PETSc.Mat, held: Int32Array, stack: ExitStack) -> PETSc.Mat:
        """Return the tangent in the turned frames, with the ``held`` slots eliminated, assembled."""
        stiffness, *others = self._tangent.blocks
        turned = stiffness.ptap(turn)
        first, _ = turned.getOwnershipRange()
        turned.zeroRowsColumns((first + held).astype(PETSc.IntType), 1.0)
        if others:
            keep(stack, turned)
            coupling, of_pressures = others
            turned = self._nested(turned, coupling, of_pressures, turn, held, stack)
        turned.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return turned

    @staticmethod
    def _nested(
        stiffness: PETSc.Mat,
        coupling: PETSc.Mat,
        of_pressures: PETSc.Mat,
        turn: PETSc.Mat,
        held: Int32Array,
        stack: ExitStack,
    ) -> PETSc.Mat:
        coupled = keep(stack, coupling.matMult(turn))
        without_columns(coupled, held)
        transpose = keep(stack, coupled.transpose(PETSc.Mat()))
        nest = keep(stack, PETSc.Mat().createNest([[stiffness, transpose], [coupled, of_pressures]], comm=turn.comm))
        return nest.convert("aij", PETSc.Mat())
