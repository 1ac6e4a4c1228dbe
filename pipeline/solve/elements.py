"""Elements of a body: unknown fields, operator, residuals and energies, and what one degree more adds to them.

Two kinds have one face. Displacement elements find u from

    a(u, v) = ∫ λ div u div v + 2μ ε(u) : ε(v).

Taylor–Hood elements P_k / P_{k-1} find u and a pressure p, up to ν = ½. λ is split into λ₀ = μ, which stays with the
displacement, and λ₁ = λ − λ₀. The energy is ½ ∫ λ₀ (div u)² + 2μ ε(u) : ε(u) + λ₁ (Π div u)², where Π is the
projection onto the pressures, p = λ₁ Π div u, and

    a₀(u, v) + b(v, p) = 0,    b(u, q) − (1/λ₁) (p, q) = 0,    b(v, q) = ∫ q div v.

Divided by μ, all but 1/λ₁ is the same for every material, and is assembled once. Of several materials λ₀, λ₁ and μ are
those of each region; pressures jump from one to the next. F of mixed elements is no upper bound, and F_k − F_{k+1} may
have either sign: N, the energy norm squared of the correction that degree k + 1 asks for, is told, too.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.conditions import Conditions, ConstrainedSpace
from pipeline.solve.dead_loads import Applied
from pipeline.solve.hierarchical_estimate import energy_decrements
from pipeline.solve.krylov import Level, LinearSolver, SolveError, is_direct
from pipeline.solve.loads import Loads, Motion
from pipeline.solve.mixed_space import MixedSpace
from pipeline.solve.physics import MaterialLaw, SplitLaw
from pipeline.solve.release import Front, Release
from pipeline.solve.saddle import Saddle, SaddleSolver
from pipeline.solve.spaces import ElasticSpace, Spaces
from pipeline.solve.vectors import global_sum, vector
from pipeline.stages import Times, recharge, recorded, stage

# λ₀/μ = 1 (ν = ¼): small enough for the multigrid, large enough for the pressure's mass to be a good preconditioner.
LAME = MaterialLaw.of(1.0, 1.0)
# Dofs up to which a direct solve of mixed elements is faster, measured for degrees 2 and 3 (docs/solvers.md).
DIRECT_LIMIT = 1_500
# Relative energy norm of the error to which the solution of degree k + 1 is found for the error bar.
_ESTIMATE_TOLERANCE = 0.1

# A displacement, and for mixed elements a pressure.
Fields = tuple[PETSc.Vec, ...]


@dataclass(eq=False)
class Column:
    """One load case and its solution: a unit of a motion, or dead loads on a probe that is held.

    The solution is ``unknown``, whose prescribed dofs are nought, and ``prescribed`` (m, local dofs with ghosts).
    ``right`` is the right-hand side for the unknown. ``amount`` is that of the motion (m, or rad), 1 for loads.
    """

    prescribed: FloatArray
    applied: Applied | None
    right: Fields
    unknown: Fields
    amount: float = 1.0


@dataclass(frozen=True, eq=False)
class Products:
    """What n solutions do: displacements ``moved`` (m) and ``residuals`` (N) of the unmodified operator, owned dofs.

    ``stationary`` (n, n), J, are a(u_i, u_j), or what takes their place in mixed elements, stationary at the solution;
    ``energies`` (n) are twice the strain energies. Energies are global, of the part that is modelled.
    """

    dofs: ConstrainedSpace
    moved: list[FloatArray]
    residuals: list[FloatArray]
    stationary: FloatArray
    energies: FloatArray


@dataclass(frozen=True, eq=False)
class Enriched:
    """What one degree more makes of n solutions: ``columns`` in ``elements`` of that degree, if they were to be kept.

    ``decrements`` (n, n), J, is what it takes from their energies, None where that is to be found from the columns;
    ``unseen`` (n), J, are N of mixed elements.
    """

    elements: "Elements"
    columns: list[Column]
    iterations: int
    decrements: FloatArray | None = None
    unseen: FloatArray | None = None


class Solver(Protocol):
    """A solver of elements for one law.

    ``is_exact`` tells that nothing improves what it finds; ``stored`` is the energy (J) of the modelled part where that
    is not half the work of the force.
    """

    is_exact: bool
    stored: float | None

    def lift(self, columns: Sequence[Column]) -> None:
        """Put what columns prescribe and their loads on their right-hand sides; collective."""

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residuals and energies of solutions; collective."""

    def solve(self, columns: Sequence[Column], tolerance: float) -> int:
        """Lower the energy norm of the error of each solution to a ``tolerance``; return the iterations; collective."""

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Lower it to that ``share`` of what the last solve left; return the iterations; collective."""

    def enrich(self, columns: Sequence[Column], loads: Loads, stack: ExitStack, *, keep: bool) -> Enriched:
        """Solve on in one degree more; what is made is freed with the ``stack``; collective.

        ``keep`` asks for the solutions, too.
        """


class Elements(ABC):
    """Elements of one degree on a mesh, with their conditions. Made with ``elements_of``; ``close`` frees them."""

    # As the study has it.
    element: str
    # Solutions are found to this share of the tolerance that is asked for.
    stricter: float

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        """Prepare the space of displacements; collective.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._spaces, self._conditions = spaces, conditions
        self.body: BodyMesh = spaces.body
        self.degree = degree
        self.displacements: ElasticSpace = spaces.get(degree, conditions)

    @property
    @abstractmethod
    def dofs(self) -> int:
        """Unknowns of the modelled part."""

    @property
    @abstractmethod
    def whole_dofs(self) -> int:
        """Unknowns of the whole body; collective."""

    @abstractmethod
    def close(self) -> None:
        """Free what is kept from solve to solve."""

    @abstractmethod
    def is_direct(self, method: str) -> bool:
        """Decide between a factorisation and iterations."""

    @abstractmethod
    def fields(self) -> AbstractContextManager[Fields]:
        """Lend fields of zeros; collective."""

    @abstractmethod
    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> Solver:
        """Return a solver, freed with the ``stack`` unless it is to ``keep``; collective.

        Raises:
            SolveError: if it cannot be set up, or the elements are not for the law.
        """

    @abstractmethod
    def products(self, law: MaterialLaw, columns: Sequence[Column], *, checked: bool = True) -> Products:
        """Return residuals and energies of solutions; collective. ``checked``: see :meth:`ElasticSpace.apply`."""

    @abstractmethod
    def set_fields(self, fields: Fields) -> None:
        """Make ``fields`` those of the forms; collective."""

    @abstractmethod
    def release(self, law: MaterialLaw, line: Front) -> Release:
        """Return what tells the energy that the present fields of the forms release at a ``line``; collective."""

    @abstractmethod
    def lift(self, column: Column, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put what a column prescribes and its loads on its right-hand side; collective."""

    def columns(self, loads: Loads, stack: ExitStack) -> list[Column]:
        """Return a column for each motion, and one more for dead loads, if there are any; collective.

        They have no solution yet, and are freed with the ``stack``.
        """
        dofs = self.displacements.dofs
        prescribed = [dofs.held(motion) for motion in loads.motions]
        amounts = [*loads.amounts]
        applied: list[Applied | None] = [None for _ in prescribed]
        if loads.dead is not None:
            prescribed.append(np.zeros(len(self.displacements.forms.displacement.x.array)))
            amounts.append(1.0)
            applied.append(self.displacements.applied(loads.dead))
        return [
            Column(
                prescribed=values,
                applied=load,
                right=stack.enter_context(self.fields()),
                unknown=stack.enter_context(self.fields()),
                amount=amount,
            )
            for values, load, amount in zip(prescribed, applied, amounts, strict=True)
        ]

    def show(self, columns: Sequence[Column], amounts: Sequence[float] | None = None) -> None:
        """Make the sum of solutions, each times its amount or another one, the fields of the forms; collective."""
        with self.fields() as total:
            for column, amount in zip(columns, amounts or [column.amount for column in columns], strict=True):
                for whole, part in zip(total, column.unknown, strict=True):
                    whole.axpy(amount, part)
                total[0].array[:] += amount * column.prescribed[: self.displacements.dofs.owned]
            self.set_fields(total)

    def total(self, column: Column, result: Fields) -> None:
        """Write a solution into ``result``."""
        for whole, part in zip(result, column.unknown, strict=True):
            part.copy(whole)
        result[0].array[:] += column.prescribed[: self.displacements.dofs.owned]

    def _sums(self, products: Any) -> FloatArray:
        return global_sum(self.displacements.dofs.comm, np.array(products))


def elements_of(spaces: Spaces, degree: int, conditions: Conditions, element: str = "displacement") -> Elements:
    """Return elements of a kind, "displacement" or "mixed", and a ``degree``; collective.

    Raises:
        SolveError: if footprint and support share a point: no displacement satisfies both.
    """
    if element == "mixed":
        return MixedElements(spaces, degree, conditions)
    return DisplacementElements(spaces, degree, conditions)


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
        return [_level(space, law, stack, direct=direct) for space in spaces]

    def finer(
        self, law: MaterialLaw, levels: list[Level], stack: ExitStack, below: LinearSolver | None = None
    ) -> tuple["DisplacementElements", LinearSolver]:
        """Return elements of one degree more and a solver above ``levels``, freed with the stack; collective.

        ``below`` is the solver of ``levels``, if it is still there.
        """
        finer = DisplacementElements(self._spaces, self.degree + 1, self._conditions)
        if len(levels) == 1 and self.degree > 1:
            levels = self.levels(law, stack, direct=False)
        level = _level(finer.displacements, law, stack)
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


class MixedElements(Elements):
    """Displacements of degree k and pressures of degree k - 1, for λ > μ somewhere, infinity too.

    Set-ups are shared by all laws that have the same λ₀ and μ up to a unit, as those of one material have.
    """

    # Forces balance at a tenth of the tolerance that F needs: three iterations more, less than to find out and go on.
    element, stricter = "mixed", 0.1

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        """Prepare; collective."""
        super().__init__(spaces, degree, conditions)
        self._stack, self._set_up = ExitStack(), ExitStack()
        self._elastic = LAME
        self._solvers: dict[bool, tuple[SaddleSolver, Times]] = {}
        with recorded() as self._cost:
            self.space = self._space()
        self._finer: MixedElements | None = None

    @stage("spaces, forms")
    def _space(self) -> MixedSpace:
        space = MixedSpace(self.body, self.displacements)
        self._stack.callback(space.close)
        return space

    @property
    def dofs(self) -> int:
        """Unknowns of the modelled part."""
        return self.space.dofs

    @property
    def whole_dofs(self) -> int:
        """Unknowns of the whole body; collective."""
        return self.space.whole_dofs

    def is_direct(self, method: str) -> bool:
        """Decide between a factorisation and iterations."""
        return method == "direct" or (method == "auto" and self.dofs <= DIRECT_LIMIT)

    def close(self) -> None:
        """Free what is kept from solve to solve."""
        if self._finer is not None:
            self._finer.close()
        self._set_up.close()
        self._stack.close()

    def fields(self) -> AbstractContextManager[Fields]:
        """Lend displacement and pressure of zeros; collective."""
        return self.space.pair()

    def set_fields(self, fields: Fields) -> None:
        """Make ``fields`` those of the forms; collective."""
        u, p = fields
        self.space.set_fields((u, p))

    def lift(self, column: Column, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put what a column prescribes and its loads, in the law's unit, on its right-hand side; collective."""
        split, (u, p) = SplitLaw.of(law), column.right
        if column.applied is None:
            self.space.lift((u, p), column.prescribed, split.elastic, checked=checked)
        else:
            self.displacements.put(u, column.applied, 1 / split.unit)

    def products(self, law: MaterialLaw, columns: Sequence[Column], *, checked: bool = True) -> Products:
        """Return residuals K₀ u + Bᵀ p and a₀(u, v) + b(u, q) + b(v, p) − (p, q)/λ₁; collective."""
        space, split = self.space, SplitLaw.of(law)
        compliance = space.by_region(split.compliance)
        elastic, residuals, dilations, masses, moved = [], [], [], [], []
        for column in columns:
            with space.pair() as (residual, dilation), space.pair() as (pull, mass_p), space.pair() as total:
                self.total(column, total)
                space.set_fields(total)
                space.apply(residual, pull, dilation, split.elastic, checked=checked)
                space.weigh(total[1], mass_p)
                elastic.append(residual.array.copy())
                residuals.append(split.unit * (residual.array + pull.array))
                dilations.append(dilation.array.copy())
                masses.append(compliance * mass_p.array)
                moved.append((total[0].array.copy(), total[1].array.copy()))
        # a₀(u_i, u_j), b(u_j, p_i), (p_i, p_j)/λ₁.
        products = split.unit * self._sums(
            [[[u @ k, p @ d, p @ m] for k, d, m in zip(elastic, dilations, masses, strict=True)] for u, p in moved]
        )
        stretched, coupled, compressed = np.moveaxis(products, -1, 0)
        return Products(
            dofs=self.displacements.dofs,
            moved=[u for u, _ in moved],
            residuals=residuals,
            stationary=stretched + coupled + coupled.T - compressed,
            energies=np.diag(stretched + compressed),
        )

    def release(self, law: MaterialLaw, line: Front) -> Release:
        """Return what tells the energy that the present fields of the forms release at a ``line``; collective."""
        forms, split = self.displacements.forms, SplitLaw.of(law)
        forms.set_law(split.elastic)
        pressure = self.space.forms.pressure, forms.by_region(split.compliance)
        return Release(self.body, line, forms.displacement, forms.lame, pressure, unit=split.unit)

    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> "MixedSolver":
        """Return a solver; it is kept for all laws of the same λ₀ and μ, in their units; collective.

        Raises:
            SolveError: if λ <= μ everywhere, or it cannot be set up.
        """
        if not any(region.ratio > 1 for region in law.parameters):
            raise SolveError("mixed elements are for Poisson's ratios above 0.25; use displacement elements")
        return MixedSolver(self, law, self._solver(SplitLaw.of(law).elastic, direct=direct), is_exact=direct)

    def finer(self) -> "MixedElements":
        """Return the elements of one degree more, made when first asked for; collective."""
        if self._finer is None:
            self._finer = MixedElements(self._spaces, self.degree + 1, self._conditions)
        return self._finer

    def saddle(self, elastic: MaterialLaw, stack: ExitStack, *, direct: bool) -> Saddle:
        """Return the blocks for λ₀ and μ of the law ``elastic``, given back with the ``stack``; collective."""
        spaces = [self._spaces.get(d, self._conditions) for d in ([self.degree] if direct else self._degrees)]
        levels = [_level(space, elastic, stack, direct=direct) for space in spaces]
        stiffness = self.space.by_region(tuple(part.lame_lambda + 2 * part.lame_mu for part in elastic.parameters))
        return Saddle(levels, *self.space.blocks(entries=direct), stiffness, self.degree - 1)

    @property
    def _degrees(self) -> range:
        return range(1, self.degree + 1)

    def _solver(self, elastic: MaterialLaw, *, direct: bool, below: SaddleSolver | None = None) -> SaddleSolver:
        if elastic != self._elastic:
            self._set_up.close()
            self._solvers.clear()
            self._elastic = elastic
        recharge(self._cost)
        if direct in self._solvers:
            solver, cost = self._solvers[direct]
            recharge(cost)
            return solver
        with recorded() as cost, stage("set-up"):
            saddle = self.saddle(elastic, self._set_up, direct=direct)
            solver = self._set_up.enter_context(SaddleSolver(saddle, direct=direct, below=below))
        self._solvers[direct] = solver, cost
        return solver


@dataclass(eq=False)
class MixedSolver:
    """A solver of mixed elements for a ``law``."""

    elements: MixedElements
    law: MaterialLaw
    saddle: SaddleSolver
    is_exact: bool
    stored: float | None = None

    def lift(self, columns: Sequence[Column]) -> None:
        """Put what columns prescribe and their loads on their right-hand sides; collective."""
        for column in columns:
            self.elements.lift(column, self.law)

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residuals and energies of solutions; collective."""
        return self.elements.products(self.law, columns)

    def solve(self, columns: Sequence[Column], tolerance: float) -> int:
        """Lower the energy norm of each error by a ``tolerance``; return the iterations; collective."""
        compliance = self.elements.space.by_region(SplitLaw.of(self.law).compliance)
        with stage("iterations"):
            return self.saddle.solve(compliance, *_transposed(columns), tolerance)

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Lower it to that ``share`` of what the last solve left; return the iterations; collective."""
        return self.solve(columns, share)

    def enrich(self, columns: Sequence[Column], loads: Loads, stack: ExitStack, *, keep: bool) -> Enriched:
        """Solve on in elements of one degree more; collective."""
        coarse, split = self.elements, SplitLaw.of(self.law)
        finer = coarse.finer()
        below = coarse._solvers.get(False, (None, None))[0]
        above = MixedSolver(finer, self.law, finer._solver(split.elastic, direct=False, below=below), is_exact=False)
        found = finer.columns(loads, stack)
        for column, fine in zip(columns, found, strict=True):
            coarse.show([column], [1.0])
            u, p = fine.unknown
            finer.space.start_from(coarse.space, (u, p), fine.prescribed)
            finer.lift(fine, self.law, checked=False)
        iterations = above.solve(found, _ESTIMATE_TOLERANCE)
        return Enriched(finer, found, iterations, unseen=split.unit * np.array(above.saddle.first_energies))


def _level(space: ElasticSpace, law: MaterialLaw, stack: ExitStack, *, direct: bool = False) -> Level:
    """Return a level of multigrid, or of a direct solve; its operator is given back with the ``stack``; collective."""
    operators = space.operators
    matrix = stack.enter_context(operators.lend(law) if direct or space.degree == 1 else operators.lend_product(law))
    return Level(space.dofs.space, matrix, space.dofs.prescribed, not law.is_uniform)


def _transposed(columns: Sequence[Column]) -> tuple[list[Fields], list[Fields]]:
    """Return right-hand sides and unknowns of columns."""
    return [column.right for column in columns], [column.unknown for column in columns]


# A solver is made for any tolerance: each solve has its own.
_ANY = 0.5
