"""Displacement elements: u with a(u, v) = ∫ λ div u div v + 2μ ε(u) : ε(v), solved directly or by multigrid."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.solve.compiled import vector
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate, Linearised, Solver, level_of
from epsmesh.solve.elements.fields import Column, Fields
from epsmesh.solve.elements.tangent import Tangent
from epsmesh.solve.hierarchical_estimate import energy_decrements
from epsmesh.solve.krylov import DIRECT_LIMIT
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces
from epsmesh.stages import Times, recharge, recorded


class DisplacementElements(Elements):
    """Displacement elements."""

    element, stricter, masks = "displacement", 1.0, True

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        super().__init__(spaces, degree, conditions)
        self._kept: DisplacementSolver | None = None

    @property
    def direct_limit(self) -> int:
        """Number of unknowns up to which a factorisation is faster than iterations."""
        return DIRECT_LIMIT[self.degree]

    def close(self) -> None:
        """Free what is kept between solves."""
        if self._kept is not None:
            self._kept.close()
        self._kept = None

    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> "DisplacementSolver":
        """Return a solver.

        A kept solver recycles earlier solutions for the initial guess. A factorisation is not kept: it would take much
        memory besides the next degree.
        """
        if self._kept is not None and self._kept.law == law and keep and not direct:
            recharge(self._kept.cost)
            return self._kept
        self.close()
        found = self.solver(law, direct=direct)
        if keep and not direct:
            found.linear.recycle()
            self._kept = found
        else:
            stack.callback(found.close)
        return found

    def solver(self, law: MaterialLaw, *, direct: bool) -> "DisplacementSolver":
        """Return a solver with levels of its own."""
        with ExitStack() as stack, recorded() as cost:
            found = DisplacementSolver(self, law, self.levels(law, stack, direct=direct), direct=direct)
            found.owner.push(stack.pop_all())
        found.cost = cost
        return found

    def solver_on(
        self, levels: list[Level], law: MaterialLaw, held: Int32Array, *, direct: bool, earlier: Solver | None
    ) -> "DisplacementSolver":
        """Return a solver of operators in which further dofs are fixed."""
        if isinstance(earlier, DisplacementSolver) and earlier.linear.cycle is not None:
            earlier.linear.hold(levels)
            return earlier
        if earlier is not None:
            earlier.close()
        return DisplacementSolver(self, law, levels, direct=direct)

    def weigh(self, residual: Fields) -> None:
        """Do nothing: both units are the same."""

    def tangent(self, law: MaterialLaw) -> Tangent:
        """Return the tangent of a law of large displacements; the caller closes it."""
        return Tangent(self.displacements, law)

    def operator(self, stiffness: PETSc.Mat, law: MaterialLaw, *, entries: bool) -> Callable[[Fields, Fields], None]:
        """Return a function that writes K u into other fields."""
        return lambda fields, result: stiffness.mult(fields[0], result[0])

    def linearised(self, law: MaterialLaw, stack: ExitStack, *, direct: bool) -> "LinearisedDisplacement":
        """Return linear elasticity with the moduli of a law of large displacements."""
        return LinearisedDisplacement(self, law, stack, direct=direct)

    def finer(
        self, law: MaterialLaw, levels: list[Level], stack: ExitStack, below: LinearSolver | None = None
    ) -> tuple["DisplacementElements", LinearSolver]:
        """Return elements of one degree more and a solver above ``levels``, freed with the stack.

        ``below`` is the solver of ``levels``, unless it was closed.
        """
        finer = DisplacementElements(self._spaces, self.degree + 1, self._conditions)
        if len(levels) == 1 and self.degree > 1:
            levels = self.levels(law, stack, direct=False)
        level = level_of(finer.displacements, law, stack)
        return finer, stack.enter_context(LinearSolver([*levels, level], direct=False, below=below))


class DisplacementSolver(Solver):
    """A solver of displacement elements for a law, by its ``levels``, and the solver above it once it was made.

    ``cost`` is that of its set-up.
    """

    elements: DisplacementElements
    cost: Times

    def __init__(self, elements: DisplacementElements, law: MaterialLaw, levels: list[Level], *, direct: bool):
        """Set up. The ``levels`` must live as long."""
        super().__init__(elements, law, is_exact=direct)
        self._above: tuple[DisplacementElements, LinearSolver] | None = None
        self._tolerance, self.levels = 1.0, levels
        self.linear = self.owner.enter_context(LinearSolver(levels, direct=direct))

    def solve(self, columns: Sequence[Column], tolerance: float, target: float | None = None) -> int:
        """Reduce the energy norm of each error, relative to that of the solution; return the iterations."""
        self._tolerance = tolerance
        return sum(self.linear.solve(column.right[0], column.unknown[0], tolerance, target) for column in columns)

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Reduce it to this ``share`` of what the last solve left; return the iterations."""
        return self.solve(columns, share * self._tolerance)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the hierarchical estimate, from the residuals in one degree more."""
        coarse = self.elements
        if self.linear.cycle is None and coarse.degree > 1:
            self.linear.close()  # the next degree sets the peak of memory
        self._above = self._above or coarse.finer(self.law, self.levels, self.owner, self.linear)
        finer, solver = self._above
        space, residuals = finer.displacements, []
        solutions: list[FloatArray] = []
        for column in columns:
            residual = stack.enter_context(vector(space.space))
            coarse.show([column], [1.0])
            space.residual_of(coarse.displacements, self.law, residual)
            if keep:
                solutions.append(space.forms.displacement.x.array[: space.owned].copy())
            if movement.loads is not None and column.applied is not None:
                space.put(residual, space.applied(movement.loads))
            residuals.append(residual)
        decrements, corrections, _ = energy_decrements(solver, residuals)
        kept = []
        for solution, correction in zip(solutions, corrections, strict=False):
            (values,) = fields = stack.enter_context(finer.fields())
            values.array[:] = solution + correction
            kept.append(Column(np.zeros(len(space.forms.displacement.x.array)), None, (), fields))
        return HierarchicalEstimate(finer, kept, decrements=decrements)


class LinearisedDisplacement(Linearised):
    """Linear elasticity of displacement elements in place of the tangent."""

    preconditioner: LinearSolver

    def __init__(self, elements: DisplacementElements, law: MaterialLaw, stack: ExitStack, *, direct: bool):
        """Set up; the ``stack`` frees it."""
        self._elements, self._law, self._stack = elements, law, stack
        self._levels = elements.levels(law, stack, direct=direct)
        self.preconditioner = stack.enter_context(LinearSolver(self._levels, direct=direct))

    def finer(self) -> DisplacementElements:
        """Return the elements of one degree more."""
        finer, self._above = self._elements.finer(self._law, self._levels, self._stack)
        return finer

    def finer_preconditioner(self) -> LinearSolver:
        """Return the preconditioner of the elements of one degree more."""
        return self._above

    def decrements(self, residuals: Sequence[Fields]) -> tuple[FloatArray, None]:
        """Return decrements."""
        found, *_ = energy_decrements(self._above, [residual[0] for residual in residuals])
        return found, None
