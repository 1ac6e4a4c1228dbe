"""Nearly and fully incompressible bodies: Taylor–Hood elements P_k / P_{k-1} find u and a pressure p, up to ν = ½.

λ is split into λ₀ = μ, which stays with the displacement, and λ₁ = λ − λ₀. The energy is
½ ∫ λ₀ (div u)² + 2μ ε(u) : ε(u) + λ₁ (Π div u)², where Π is the projection onto the pressures, p = λ₁ Π div u, and

    a₀(u, v) + b(v, p) = 0,    b(u, q) − (1/λ₁) (p, q) = 0,    b(v, q) = ∫ q div v.

Divided by μ, all but 1/λ₁ is the same for every material, and is assembled once. Of several materials λ₀, λ₁ and μ are
those of each region; pressures jump from one to the next. F is no upper bound, and F_k − F_{k+1} may have either sign:
N, the energy norm squared of the correction that degree k + 1 asks for, is told, too.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass

import numpy as np

from pipeline.solve.crack import Front, Release
from pipeline.solve.fields import Column, Elements, Enriched, Fields, Products, level_of, transposed
from pipeline.solve.krylov import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.mixed_space import MixedSpace
from pipeline.solve.physics import MaterialLaw, SplitLaw
from pipeline.solve.saddle import Saddle, SaddleSolver
from pipeline.solve.spaces import Conditions, Spaces
from pipeline.stages import Times, recharge, recorded, stage

# λ₀/μ = 1 (ν = ¼): small enough for the multigrid, large enough for the pressure's mass to be a good preconditioner.
LAME = MaterialLaw.of(1.0, 1.0)
# Dofs up to which a direct solve of mixed elements is faster, measured for degrees 2 and 3 (docs/solvers.md).
DIRECT_LIMIT = 1_500
# Relative energy norm of the error to which the solution of degree k + 1 is found for the error bar.
_ESTIMATE_TOLERANCE = 0.1


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
        levels = [level_of(space, elastic, stack, direct=direct) for space in spaces]
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
            return self.saddle.solve(compliance, *transposed(columns), tolerance)

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
