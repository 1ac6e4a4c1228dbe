"""Displacement elements: u with a(u, v) = ∫ λ div u div v + 2μ ε(u) : ε(v), solved directly or by multigrid."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.crack import Front, Release
from pipeline.solve.fields import Column, Elements, Enriched, Fields, Products, level_of
from pipeline.solve.hierarchical_estimate import energy_decrements
from pipeline.solve.krylov import Level, LinearSolver, is_direct
from pipeline.solve.loads import Loads, Motion
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.spaces import Conditions, ElasticSpace, Spaces
from pipeline.solve.vectors import vector
from pipeline.stages import Times, recharge, recorded

# A solver is made for any tolerance: each solve has its own.
_ANY = 0.5


class DisplacementElements(Elements):
    """Displacements alone."""

    element, stricter = "displacement", 1.0

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        """Prepare; collective."""
        super().__init__(spaces, degree, conditions)
        self._kept: DisplacementSolver | None = None

    @property
    def dofs(self) -> int:
        """Unknowns of the modelled part."""
        return self.displacements.dofs.dofs

    @property
    def whole_dofs(self) -> int:
        """Unknowns of the whole body; collective."""
        return self.displacements.dofs.whole_dofs

    def is_direct(self, method: str) -> bool:
        """Decide between a factorisation and iterations."""
        return is_direct(method, self.dofs, self.degree)

    @contextmanager
    def fields(self) -> Iterator[Fields]:
        """Lend a displacement of zeros; collective."""
        with vector(self.displacements.dofs.space) as u:
            yield (u,)

    def set_fields(self, fields: Fields) -> None:
        """Make ``fields`` those of the forms; collective."""
        self.displacements.set_displacement(fields[0])

    def lift(self, column: Column, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put what a column prescribes and its loads on its right-hand side; collective."""
        (right,) = column.right
        if column.applied is None:
            self.displacements.lift(right, column.prescribed, law, checked=checked)
        else:
            self.displacements.put(right, column.applied)

    def products(self, law: MaterialLaw, columns: Sequence[Column], *, checked: bool = True) -> Products:
        """Return residuals and energies of solutions; collective."""
        residuals, moved = [], []
        for column in columns:
            with self.fields() as (residual,), self.fields() as total:
                self.total(column, total)
                self.set_fields(total)
                self.displacements.apply(residual, law, checked=checked)
                residuals.append(residual.array.copy())
                moved.append(total[0].array.copy())
        stationary = self._sums([[u @ r for r in residuals] for u in moved])
        return Products(self.displacements.dofs, moved, residuals, stationary, np.diag(stationary))

    def release(self, law: MaterialLaw, line: Front) -> Release:
        """Return what tells the energy that the present displacement of the forms releases at a ``line``."""
        forms = self.displacements.forms
        forms.set_law(law)
        return Release(self.body, line, forms.displacement, forms.lame)

    def close(self) -> None:
        """Free what is kept from solve to solve."""
        if self._kept is not None:
            self._kept.owner.close()
        self._kept = None

    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> "DisplacementSolver":
        """Return a solver, freed with the ``stack`` unless it is to ``keep``; collective.

        What is kept begins each solve from the best sum of earlier solutions. A factorisation is not kept: it takes
        much memory beside the next degree.
        """
        if self._kept is not None and self._kept.law == law and keep and not direct:
            recharge(self._kept.cost)
            return self._kept
        self.close()
        with ExitStack() as owner:
            with recorded() as cost:
                levels = self.levels(law, owner, direct=direct)
                solver = LinearSolver(levels, direct=direct, tolerance=_ANY)
                owner.callback(solver.close)
            found = DisplacementSolver(self, law, levels, solver, cost, is_exact=direct)
            if keep and not direct:
                solver.recycle()
                self._kept, found.owner = found, owner.pop_all()
            else:
                stack.push(owner.pop_all())
                found.owner = stack
        return found

    def levels(self, law: MaterialLaw, stack: ExitStack, *, direct: bool) -> list[Level]:
        """Return the levels of multigrid, or the one of a direct solve, given back with the ``stack``; collective."""
        spaces = [self.displacements] if direct else [*self._coarser(), self.displacements]
        return [level_of(space, law, stack, direct=direct) for space in spaces]

    def finer(
        self, law: MaterialLaw, levels: list[Level], stack: ExitStack, below: LinearSolver | None = None
    ) -> tuple["DisplacementElements", LinearSolver]:
        """Return elements of one degree more and a solver above ``levels``, freed with the stack; collective.

        ``below`` is the solver of ``levels``, if it is still there.
        """
        finer = DisplacementElements(self._spaces, self.degree + 1, self._conditions)
        if len(levels) == 1 and self.degree > 1:
            levels = self.levels(law, stack, direct=False)
        level = level_of(finer.displacements, law, stack)
        solver = LinearSolver([*levels, level], direct=False, tolerance=_ANY, below=below)
        stack.callback(solver.close)
        return finer, solver

    def _coarser(self) -> list[ElasticSpace]:
        """Return the spaces of lower degree."""
        return [self._spaces.get(degree, self._conditions) for degree in range(1, self.degree)]


@dataclass(eq=False)
class DisplacementSolver:
    """A solver of displacement elements for a ``law``, its ``levels``, and the one above it, once it was made.

    ``owner`` frees it, and ``cost`` is what it took to make. ``known`` are solutions for a unit of motions that may
    come again, less what is prescribed.
    """

    elements: DisplacementElements
    law: MaterialLaw
    levels: list[Level]
    linear: LinearSolver
    cost: Times
    is_exact: bool
    stored: float | None = None
    owner: ExitStack = field(default_factory=ExitStack)
    known: dict[Motion, FloatArray] = field(default_factory=dict)
    _above: tuple[DisplacementElements, LinearSolver] | None = None
    _tolerance: float = 1.0

    def lift(self, columns: Sequence[Column]) -> None:
        """Put what columns prescribe and their loads on their right-hand sides; collective."""
        for column in columns:
            self.elements.lift(column, self.law)

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residuals and energies of solutions; collective."""
        return self.elements.products(self.law, columns)

    def solve(self, columns: Sequence[Column], tolerance: float) -> int:
        """Lower the energy norm of each error to a ``tolerance``; return the iterations; collective."""
        self._tolerance = tolerance
        return sum(self.linear.solve(column.right[0], column.unknown[0], tolerance) for column in columns)

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Lower it to that ``share`` of what the last solve left; return the iterations; collective."""
        return self.solve(columns, share * self._tolerance)

    def enrich(self, columns: Sequence[Column], loads: Loads, stack: ExitStack, *, keep: bool) -> Enriched:
        """Solve on in one degree more, from the residuals there; collective."""
        coarse = self.elements
        if self.linear.cycle is None and coarse.degree > 1:
            self.linear.close()  # what the next degree takes is the most memory of all
        self._above = self._above or coarse.finer(self.law, self.levels, self.owner, self.linear)
        finer, solver = self._above
        space, residuals = finer.displacements, []
        solutions: list[FloatArray] = []
        for column in columns:
            residual = stack.enter_context(vector(space.dofs.space))
            coarse.show([column], [1.0])
            space.forms.displacement.interpolate(coarse.displacements.forms.displacement)
            if keep:
                solutions.append(space.forms.displacement.x.array[: space.dofs.owned].copy())
            space.apply(residual, self.law, checked=False)
            residual.scale(-1.0)
            residual.array[space.dofs.prescribed_owned] = 0.0
            if loads.dead is not None and column.applied is not None:
                space.put(residual, space.applied(loads.dead))
            residuals.append(residual)
        decrements, corrections, iterations = energy_decrements(solver, residuals, keep_solutions=keep)
        kept = []
        for solution, correction in zip(solutions, corrections, strict=False):
            (values,) = fields = stack.enter_context(finer.fields())
            values.array[:] = solution + correction
            kept.append(Column(np.zeros(len(space.forms.displacement.x.array)), None, (), fields))
        return Enriched(finer, kept, iterations, decrements=decrements)
