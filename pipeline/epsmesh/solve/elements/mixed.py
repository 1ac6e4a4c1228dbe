"""Mixed elements for nearly and fully incompressible tissue: Taylor–Hood, P_k / P_{k-1}, u and pressure p, up to ν = ½.

λ = λ₀ + λ₁ is split, with λ₀ = μ. The energy is ½ ∫ λ₀ (div u)² + 2μ ε(u) : ε(u) + λ₁ (Π div u)², with Π the projection
onto the pressures and p = λ₁ Π div u:

    a₀(u, v) + b(v, p) = 0,    b(u, q) − (1/λ₁) (p, q) = 0,    b(v, q) = ∫ q div v.

Divided by μ, all terms but 1/λ₁ are the same for every material, and are set up once. With several materials λ₀, λ₁ and
μ depend on the region, and pressures jump between regions. F is no upper bound, and F_k − F_{k+1} may have either sign.
The solver therefore also gives N, the energy norm squared of the correction in degree k + 1.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import vector
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate, Linearised, Solver, level_of
from epsmesh.solve.elements.fields import Column, ElementFields, Fields
from epsmesh.solve.elements.pressures import Pressures
from epsmesh.solve.elements.tangent import Tangent
from epsmesh.solve.krylov import keep
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw, SplitLaw
from epsmesh.solve.saddle import Saddle, SaddleSolver
from epsmesh.solve.spaces import Spaces
from epsmesh.stages import Times, recharge, recorded, stage

# λ₀/μ = 1 (ν = ¼): small enough for multigrid, large enough for the pressure's mass to be a good preconditioner.
LAME = MaterialLaw.of(1.0, 1.0)
# Relative energy norm of the error of the solution of degree k + 1, for the error bar.
_ESTIMATE_TOLERANCE = 0.1


class MixedElements(Elements):
    """Displacements of degree k and pressures of degree k - 1, for a law with λ > μ somewhere, infinite included.

    Laws with the same λ₀ and μ up to a factor share one set-up, as all laws of one material do.
    """

    # Forces balance at a tenth of the tolerance for F: three more iterations, less than a second round would cost.
    element, stricter, masks = "mixed", 0.1, False
    # Measured for degrees 2 and 3 (benchmarks/results/solvers.md).
    direct_limit = 1_500

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        super().__init__(spaces, degree, conditions)
        self._stack, self._set_up = ExitStack(), ExitStack()
        self._elastic = LAME
        self._solvers: dict[bool, tuple[SaddleSolver, Times]] = {}
        with recorded() as self._cost, stage("spaces, forms"):
            self.pressures = Pressures(self.body, self.displacements)
        self._stack.callback(self.pressures.close)
        self._finer: MixedElements | None = None

    @property
    def dofs(self) -> int:
        """Number of unknowns of the modelled part."""
        return super().dofs + self.pressures.dofs

    @property
    def unknowns(self) -> int:
        """Number of dofs of this rank."""
        return super().unknowns + self.pressures.owned

    @property
    def whole_dofs(self) -> int:
        """Number of unknowns of the whole body."""
        return super().whole_dofs + self.pressures.whole_dofs

    def close(self) -> None:
        """Free what is kept between solves."""
        self._forget()
        if self._finer is not None:
            self._finer.close()
        self._stack.close()

    def elastic(self, law: MaterialLaw) -> MaterialLaw:
        """Return λ₀ and μ, in units of the law."""
        return SplitLaw.of(law).elastic

    def unit(self, law: MaterialLaw) -> float:
        """Return the unit (Pa) of moduli in right-hand sides."""
        return SplitLaw.of(law).unit

    def compliance(self, law: MaterialLaw) -> float | FloatArray:
        """Return 1/λ₁ in units of the law: one number, or one for each pressure of this rank."""
        return self.pressures.by_region(SplitLaw.of(law).compliance)

    @contextmanager
    def fields(self) -> Iterator[Fields]:
        """Lend zero fields of displacement and pressure."""
        with super().fields() as (u,), vector(self.pressures.space) as p:
            yield u, p

    def set_fields(self, fields: Fields) -> None:
        """Copy ``fields`` to the fields of the forms."""
        super().set_fields(fields)
        self.pressures.set(fields[1])

    @property
    def values(self) -> FloatArray:
        """The forms' fields as one vector of owned dofs."""
        return np.concatenate([super().values, self.pressures.values])

    def interpolate(self, coarse: ElementFields) -> None:
        """Interpolate the forms' fields of ``coarse``; displacement elements have no pressure."""
        super().interpolate(coarse)
        if isinstance(coarse, MixedElements):
            self.pressures.forms.pressure.interpolate(coarse.pressures.forms.pressure)

    def start_from(self, coarse: ElementFields, unknown: Fields, prescribed: FloatArray) -> None:
        """Interpolate the initial guess from ``coarse``; displacement elements give no pressure."""
        super().start_from(coarse, unknown, prescribed)
        if isinstance(coarse, MixedElements):
            unknown[1].array[:] = self.pressures.values

    def apply(self, result: Fields, law: MaterialLaw, *, checked: bool = True) -> None:
        """Write K₀ u + Bᵀ p (N) and B u − M p / λ₁ of the forms' fields into ``result``."""
        forces, rates = result
        super().apply(result, law, checked=checked)
        self.pressures.pull(forces, checked=checked)
        self.pressures.dilate(rates, checked=checked)
        rates.array[:] -= self.compliance(law) * self.pressures.weighed()
        for part in result:
            part.scale(self.unit(law))

    def lift(self, column: Column, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put prescribed displacement and loads of a column, in the law's unit, on its right-hand side."""
        super().lift(column, law, checked=checked)
        if column.applied is None:
            self.pressures.dilate(column.right[1], checked=checked)
            column.right[1].scale(-1.0)

    def weigh(self, residual: Fields) -> None:
        """Change the unit of the residual of pressures."""
        residual[1].scale(self.pressures.unit)

    def tangent(self, law: MaterialLaw) -> Tangent:
        """Return the tangent of a law of large displacements; the caller closes it."""
        return Tangent(self.displacements, law, self.pressures)

    def _pressure(self, law: MaterialLaw) -> tuple[Any, Any]:
        compliance = self.displacements.forms.by_region(SplitLaw.of(law).compliance)
        return self.pressures.forms.pressure, compliance

    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> "MixedSolver":
        """Return a solver; it is kept for all laws of the same λ₀ and μ, in their units.

        Raises:
            SolveError: if λ <= μ everywhere, or the set-up fails.
        """
        _check_ratio(law)
        return MixedSolver(self, law, self._solver(self.elastic(law), direct=direct), is_exact=direct)

    def solver_on(
        self, levels: list[Level], law: MaterialLaw, held: Int32Array, *, direct: bool, earlier: Solver | None
    ) -> "MixedSolver":
        """Return a solver of operators in which the owned dofs ``held`` are fixed, too."""
        if earlier is not None:
            earlier.close()
        with ExitStack() as stack:
            coupling = keep(stack, self.pressures.holding(held, entries=direct))
            if (pairs := levels[-1].pairs) is not None:
                coupling = keep(stack, coupling.getPythonContext().joined(pairs).matrix())
            _, mass = self.pressures.blocks(entries=direct)
            saddle = self.saddle_of(levels, self.elastic(law), coupling, mass)
            found = MixedSolver(self, law, stack.enter_context(SaddleSolver(saddle, direct=direct)), is_exact=direct)
            found.owner.push(stack.pop_all())
        return found

    def operator(self, stiffness: PETSc.Mat, law: MaterialLaw, *, entries: bool) -> Callable[[Fields, Fields], None]:
        """Return a function that writes K₀ u + Bᵀ p and B u − M p / λ₁, in the law's unit, into other fields."""
        (coupling, mass), compliance = self.pressures.blocks(entries=entries), self.compliance(law)

        def multiply(fields: Fields, result: Fields) -> None:
            with self.fields() as (pull, dilation):
                stiffness.mult(fields[0], result[0])
                coupling.multTranspose(fields[1], pull)
                result[0].axpy(1.0, pull)
                coupling.mult(fields[0], dilation)
                mass.mult(fields[1], result[1])
                result[1].array[:] *= -compliance
                result[1].axpy(1.0, dilation)

        return multiply

    def linearised(self, law: MaterialLaw, stack: ExitStack, *, direct: bool) -> "LinearisedMixed":
        """Return linear elasticity with the moduli of a law of large displacements.

        Raises:
            SolveError: if λ <= μ everywhere, or the set-up fails.
        """
        _check_ratio(law)
        return LinearisedMixed(self, law, stack, direct=direct)

    def finer(self) -> "MixedElements":
        """Return the elements of one degree more, made at the first call."""
        if self._finer is None:
            self._finer = MixedElements(self._spaces, self.degree + 1, self._conditions)
        return self._finer

    def saddle(
        self, elastic: MaterialLaw, stack: ExitStack, *, direct: bool, below: LinearSolver | None = None
    ) -> Saddle:
        """Return the blocks for λ₀ and μ of the law ``elastic``, freed with the ``stack``.

        ``below`` has the levels of one degree less, which must live as long.
        """
        if below is None:
            levels = self.levels(elastic, stack, direct=direct)
        else:
            levels = [*below.levels, level_of(self.displacements, elastic, stack)]
        return self.saddle_of(levels, elastic, *self.pressures.blocks(entries=direct))

    def saddle_of(self, levels: list[Level], elastic: MaterialLaw, coupling: PETSc.Mat, mass: PETSc.Mat) -> Saddle:
        """Return the saddle point of given blocks; K₀ is the last of ``levels``."""
        stiffness = self.pressures.by_region(tuple(part.lame_lambda + 2 * part.lame_mu for part in elastic.parameters))
        return Saddle(levels, coupling, mass, stiffness, self.degree - 1)

    def finer_solver(self, elastic: MaterialLaw) -> SaddleSolver:
        """Return the iterative solver of the elements of one degree more, on the levels of this one's, if it has one.

        It lives as long as that.
        """
        below = self._solvers.get(False, (None, None))[0] if self._is_set_up_for(elastic) else None
        return self.finer()._solver(elastic, direct=False, below=below)

    def _is_set_up_for(self, elastic: MaterialLaw) -> bool:
        return elastic == self._elastic and (elastic.unit == self._elastic.unit or not self.displacements.terms)

    def _forget(self) -> None:
        """Free the solvers, those of one degree more first: they share levels."""
        if self._finer is not None:
            self._finer._forget()
        self._set_up.close()
        self._solvers.clear()

    def _solver(self, elastic: MaterialLaw, *, direct: bool, below: SaddleSolver | None = None) -> SaddleSolver:
        if not self._is_set_up_for(elastic):
            self._forget()
            self._elastic = elastic
        recharge(self._cost)
        if direct in self._solvers:
            solver, cost = self._solvers[direct]
            recharge(cost)
            return solver
        with recorded() as cost, stage("set-up"):
            known = None if below is None else below.multigrid
            saddle = self.saddle(elastic, self._set_up, direct=direct, below=known)
            solver = self._set_up.enter_context(SaddleSolver(saddle, direct=direct, below=below))
        self._solvers[direct] = solver, cost
        return solver


class MixedSolver(Solver):
    """A solver of mixed elements for a law."""

    elements: MixedElements

    def __init__(self, elements: MixedElements, law: MaterialLaw, saddle: SaddleSolver, *, is_exact: bool):
        super().__init__(elements, law, is_exact=is_exact)
        self.saddle = saddle

    def solve(self, columns: Sequence[Column], tolerance: float, target: float | None = None) -> int:
        """Reduce the energy norm of each error, relative to the initial error; return the iterations."""
        right, unknown = [column.right for column in columns], [column.unknown for column in columns]
        with stage("iterations"):
            return self.saddle.solve(self.elements.compliance(self.law), right, unknown, tolerance, target)

    @property
    def first_energies(self) -> FloatArray:
        """N (J) of each column: squared energy norm of the last solve's initial error, seen by the preconditioner."""
        return self.elements.unit(self.law) * np.array(self.saddle.first_energies)

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Reduce it to this ``share`` of what the last solve left; return the iterations."""
        return self.solve(columns, share)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the hierarchical estimate, from elements of one degree more."""
        coarse, finer = self.elements, self.elements.finer()
        above = MixedSolver(finer, self.law, coarse.finer_solver(coarse.elastic(self.law)), is_exact=False)
        found = finer.columns(movement, stack)
        for column, fine in zip(columns, found, strict=True):
            coarse.show([column], [1.0])
            finer.start_from(coarse, fine.unknown, fine.prescribed)
            finer.lift(fine, self.law, checked=False)
        above.solve(found, _ESTIMATE_TOLERANCE)
        return HierarchicalEstimate(finer, found, unseen=above.first_energies)


class LinearisedMixed(Linearised):
    """Linear elasticity of mixed elements in place of the tangent."""

    def __init__(self, elements: MixedElements, law: MaterialLaw, stack: ExitStack, *, direct: bool):
        """Set up; the ``stack`` frees it."""
        self._elements, self._law, self._stack = elements, law, stack
        self._saddle = elements._solver(elements.elastic(law), direct=direct)
        self.preconditioner = self._saddle.preconditioner(elements.compliance(law), stack)

    def finer(self) -> MixedElements:
        """Return the elements of one degree more."""
        return self._elements.finer()

    def finer_preconditioner(self) -> Any:
        """Return the preconditioner of the elements of one degree more."""
        return self._finer_saddle().preconditioner(self._elements.finer().compliance(self._law), self._stack)

    def _finer_saddle(self) -> SaddleSolver:
        return self._elements.finer_solver(self._elements.elastic(self._law))

    def decrements(self, residuals: Sequence[Fields]) -> tuple[FloatArray, FloatArray]:
        """Return decrements and N."""
        finer, law, saddle = self._elements.finer(), self._law, self._finer_saddle()
        fixed = np.zeros(len(finer.displacements.forms.displacement.x.array))
        found = [Column(fixed, None, residual, self._stack.enter_context(finer.fields())) for residual in residuals]
        MixedSolver(finer, law, saddle, is_exact=False).solve(found, _ESTIMATE_TOLERANCE)
        unit = finer.unit(law)
        # x_i·r_j + x_j·r_i − x_i·K x_j: its error is the product of both solutions' errors.
        works = np.array(
            [[sum(x.dot(r) for x, r in zip(i.unknown, j.right, strict=True)) for j in found] for i in found]
        )
        energies = finer.products(law, found, checked=False).stationary
        return unit * (works + works.T) - energies, unit * np.array(saddle.first_energies)


def _check_ratio(law: MaterialLaw) -> None:
    """Raise an error if no λ₁ is positive."""
    if not any(region.ratio > 1 for region in law.parameters):
        raise SolveError("mixed elements need a Poisson's ratio above 0.25; use displacement elements")
