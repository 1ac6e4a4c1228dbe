"""Nearly and fully incompressible bodies: displacement and pressure by Taylor–Hood elements P_k / P_{k-1}.

With λ split into λ₀ = μ, which stays with the displacement, and λ₁ = λ − λ₀, the energy is
½ ∫ λ₀ (div u)² + 2μ ε(u) : ε(u) + λ₁ (Π div u)², Π the projection onto the pressures: p = λ₁ Π div u, and

    a₀(u, v) + b(v, p) = 0,    b(u, q) − (1/λ₁) (p, q) = 0,    b(v, q) = ∫ q div v,

holds for ν = ½, where 1/λ₁ = 0. Divided by μ, all but 1/λ₁ is the same for every material: it is assembled once. Of
several materials λ₀, λ₁ and μ are those of each region; pressures jump from one to the next.

The force is the reaction K₀ u + Bᵀ p on the probe; the probe's stiffness is, for each pair of motions,
a₀(u, v) + b(u, q) + b(v, p) − (p, q)/λ₁, which is stationary: its error is the product of the solver's.

F_h is no upper bound, since the constraint is relaxed; s = F_k − F_{k+1} may have either sign, and vanish by chance.
The bar is therefore the larger of what :mod:`pipeline.solve.error` makes of |s|, with the same constants, and of a
share of N, the energy norm squared of the correction that elements of degree k + 1 ask for. N / |s| is 2 to 5 but
where s changes its sign.
"""

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.carried import Carried, carried_of, imbalance, shares
from pipeline.solve.closure import balanced, energy_beyond, far_share
from pipeline.solve.conditions import Conditions
from pipeline.solve.dead_loads import Applied
from pipeline.solve.error import error_bar, stiffness_bars
from pipeline.solve.forms import mean_strain_form
from pipeline.solve.linear import Level, SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.material import MaterialLaw, SplitLaw
from pipeline.solve.mixed_space import MixedSpace
from pipeline.solve.reaction import Response, reaction, sums
from pipeline.solve.release import Front, Release, Released
from pipeline.solve.rim import plain_share
from pipeline.solve.saddle import Pair, Saddle, SaddleSolver
from pipeline.solve.solution import TOLERANCE, Solution, check_balance, rest
from pipeline.solve.spaces import Spaces
from pipeline.solve.strain import largest_strain, principal_strains
from pipeline.solve.vectors import global_sum
from pipeline.stages import stage

# λ₀/μ = 1 (ν = ¼): small enough for the multigrid, large enough for the pressure's mass to be a good preconditioner.
LAME = MaterialLaw.of(1.0, 1.0)
# Dofs up to which a direct solve is faster, measured for degrees 2 and 3 (docs/solvers.md).
DIRECT_LIMIT = 1_500
# Relative energy norm of the error to which the solution of degree k + 1 is found for the error bar.
_ESTIMATE_TOLERANCE = 0.1
# Forces balance at a tenth of the tolerance that F needs: three iterations more, less than to find out and go on.
STRICTER = 0.1


class MixedProblem:
    """The spaces of a mesh, a degree k and conditions: solves for any λ > μ, infinity too, sharing all assembly.

    A context manager, which frees what it made.
    """

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        """Prepare; collective.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._spaces, self._body, self._conditions = spaces, spaces.body, conditions
        self._stack, self._set_up = ExitStack(), ExitStack()
        self._elastic = LAME
        self._mixed: dict[int, MixedSpace] = {}
        self._levels: dict[tuple[int, bool], tuple[Level, float]] = {}
        self._solvers: dict[tuple[int, bool], SaddleSolver] = {}
        self._degree = degree
        self._fine = self._space(degree)
        fine = self._fine.displacements
        self._strain = mean_strain_form(fine.dofs.space, fine.forms.displacement)

    def __enter__(self) -> "MixedProblem":
        return self

    def __exit__(self, *_: object) -> None:
        self._set_up.close()
        self._stack.close()

    @property
    def dofs(self) -> int:
        """Unknowns of the modelled part."""
        return self._fine.dofs

    def solve(
        self, law: MaterialLaw, loads: Loads, *, method: str = "auto", tolerance: float = TOLERANCE,
        estimate: bool = False,
    ) -> Solution:  # fmt: skip
        """Solve for each motion of ``loads``, with one set-up, and return forces and checks; collective.

        ``tolerance`` is that of the energy norm of the solver's error. ``estimate`` goes on with elements of one
        degree more, for the solution's ``decrements``, which may be negative, and ``bars``.

        Raises:
            SolveError: if λ <= μ everywhere, the solver did not converge, or the solution fails a check.
        """
        if not any(lame_lambda > mu for lame_lambda, mu in zip(law.lame_lambda, law.lame_mu, strict=True)):
            raise SolveError("mixed elements are for Poisson's ratios above 0.25; use displacement elements")
        tolerance = STRICTER * tolerance
        split = SplitLaw.of(law)
        self._use(split.elastic)
        direct = method == "direct" or (method == "auto" and self.dofs <= DIRECT_LIMIT)
        solver, assemble = self._solver(self._degree, direct=direct)
        fine = self._fine
        start = time.perf_counter()
        held = [fine.displacements.dofs.held(motion) for motion in loads.motions]
        applied = fine.displacements.applied(loads.dead)
        with ExitStack() as stack:
            unknowns = [stack.enter_context(fine.pair()) for _ in [*held, *applied]]
            iterations = self._correct(fine, solver, split, unknowns, held, applied, tolerance)
            response, carried = self._response(fine, split, unknowns, held, applied, loads)
            if (share := rest(response.balance, tolerance)) < 1:
                iterations += self._correct(fine, solver, split, unknowns, held, applied, share)
                response, carried = self._response(fine, split, unknowns, held, applied, loads)
            if loads.far is not None:
                loads, held = self._close(response, unknowns, held)
                response = balanced(self._response(fine, split, unknowns, held, applied, loads)[0])
            seconds = time.perf_counter() - start - (solver.setup_seconds if direct else 0.0)
            check_balance(response.balance)
            released, pushed = self._released(fine, split, unknowns, held)
            amounts = [*loads.amounts, *(1.0 for _ in applied)]
            self._move(unknowns, held, amounts)
            strain = largest_strain(self._strain, self._body, self._conditions.front)
            solution = Solution(
                _times(response, split.unit), strain, fine.whole_dofs, self._body.cells, iterations,
                assemble, solver.setup_seconds, seconds, released=released, pushed=pushed,
                carried=carried and carried.times(split.unit),
            )  # fmt: skip
            if not estimate:
                return solution
            coarse = response.stiffness if carried is None else carried.form
            solution = self._estimate(solution, coarse, unknowns, held, split)
            self._move(unknowns, held, amounts)
        return solution

    @staticmethod
    def _close(response: Response, unknowns: list[Pair], held: list[FloatArray]) -> tuple[Loads, list[FloatArray]]:
        """Make one motion, with its share of the far field, of two: return it and what it prescribes."""
        share = far_share(response)
        for part, far in zip(*unknowns, strict=True):
            part.axpy(share, far)
        del unknowns[1]
        return response.loads.closed(share), [held[0] + share * held[1]]

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        return self._fine.displacements.forms.displacement, principal_strains(self._strain, self._body)

    def _move(
        self, unknowns: list[Pair], held: list[FloatArray], amounts: Sequence[float], space: MixedSpace | None = None
    ) -> None:
        """Make the sum of the motions the displacement and the pressure of the forms of a space; collective."""
        space = space or self._fine
        owned = space.displacements.dofs.owned
        with space.pair() as (displacement, pressure):
            for number, ((u, p), amount) in enumerate(zip(unknowns, amounts, strict=True)):
                displacement.axpy(amount, u)
                if number < len(held):
                    displacement.array[:] += amount * held[number][:owned]
                pressure.axpy(amount, p)
            space.set_fields((displacement, pressure))

    @stage("energy release")
    def _released(self, space: MixedSpace, split: SplitLaw, unknowns: list[Pair], held: list[FloatArray]) -> Released:
        """Return what a slit's front and the blade's tip in the whole body release (J/m), by pairs of motions.

        Collective.
        """
        forms = space.displacements.forms
        forms.set_law(split.elastic)

        def of(line: Front | None) -> FloatArray | None:
            if line is None:
                return None
            pressure = (space.forms.pressure, forms.by_region(split.compliance))
            release = Release(self._body, line, forms.displacement, forms.lame, pressure)
            found = release.matrix(len(held), lambda amounts: self._move(unknowns, held, list(amounts), space))
            return 2.0 ** len(self._body.mirrored) * split.unit * found

        return of(self._conditions.front), of(self._conditions.tip)

    @stage("error bar")
    def _estimate(
        self, solution: Solution, coarse: FloatArray, unknowns: list[Pair], held: list[FloatArray], split: SplitLaw
    ) -> Solution:
        """Return ``solution``, whose form in the law's unit is ``coarse``, with its error bars; collective.

        That is the stiffness, with a row more for loads.
        """
        start, loads = time.perf_counter(), solution.response.loads
        solver, _ = self._solver(self._degree + 1, direct=False)
        finer = self._space(self._degree + 1)
        finer_held = [finer.displacements.dofs.held(motion) for motion in loads.motions]
        applied = finer.displacements.applied(loads.dead)
        with ExitStack() as stack:
            found = [stack.enter_context(finer.pair()) for _ in unknowns]
            for number, (pair, unknown) in enumerate(zip(found, unknowns, strict=True)):
                self._move([unknown], held[number : number + 1], [1.0])
                values = finer_held[number] if number < len(held) else np.zeros(finer.displacements.dofs.owned)
                finer.start_from(self._fine, pair, values)
            iterations = self._correct(finer, solver, split, found, finer_held, applied, _ESTIMATE_TOLERANCE)
            fine, carried = self._response(finer, split, found, finer_held, applied, loads)
            released, pushed = self._released(finer, split, found, finer_held)
        decrements = coarse - (fine.stiffness if carried is None else carried.form)
        first = 2.0 ** len(self._body.mirrored) * np.diag(solver.first_energies)
        plain = plain_share(self._body)
        unseen = shares(first, coarse)
        relative = [
            error_bar(d, self._degree, "mixed", plain=plain, unseen=n)
            for d, n in zip(shares(decrements, coarse), unseen, strict=True)
        ]
        bars = split.unit * stiffness_bars(coarse, np.array(relative))
        return replace(
            solution.with_bars(split.unit * decrements, bars, "mixed", apart=loads.apart), plain=plain,
            unseen=unseen[: len(loads.motions)], released_finer=released, pushed_finer=pushed,
            estimate_iterations=iterations, time_estimate=time.perf_counter() - start,
        ).with_release_bar(self._degree)  # fmt: skip

    @stage("iterations")
    def _correct(
        self, space: MixedSpace, solver: SaddleSolver, split: SplitLaw, unknowns: list[Pair], held: list[FloatArray],
        applied: list[Applied], tolerance: float,
    ) -> int:  # fmt: skip
        """Improve ``unknowns``, each less the prescribed displacements ``held``; return the iterations.

        The last is that of loads that are ``applied``, if any are.
        """
        with ExitStack() as stack:
            loads = [stack.enter_context(space.pair()) for _ in unknowns]
            for load, values in zip(loads, held, strict=False):
                space.lift(load, values, split.elastic, checked=space is self._fine)
            for dead in applied:
                space.displacements.put(loads[-1][0], dead, 1 / split.unit)
            return solver.solve(space.by_region(split.compliance), loads, unknowns, tolerance)

    def _response(
        self, space: MixedSpace, split: SplitLaw, unknowns: list[Pair], held: list[FloatArray],
        applied: list[Applied], loads: Loads,
    ) -> tuple[Response, Carried | None]:  # fmt: skip
        """Return the response, in the law's unit, to motions of solutions ``unknowns`` less ``held``; collective.

        After it comes what the loads do that are ``applied``, of which the last of ``unknowns`` is the solution.
        """
        dofs, elastic, residuals, dilations, masses, moved = space.displacements.dofs, [], [], [], [], []
        c = space.by_region(split.compliance)
        for number, unknown in enumerate(unknowns):
            values = held[number] if number < len(held) else np.zeros(dofs.owned)
            with space.pair() as (residual, dilation), space.pair() as (pull, mass_p), space.pair() as total:
                total[0].array[:] = unknown[0].array + values[: dofs.owned]
                unknown[1].copy(total[1])
                space.set_fields(total)
                space.apply(residual, pull, dilation, split.elastic, checked=space is self._fine)
                space.weigh(total[1], mass_p)
                elastic.append(residual.array.copy())
                residuals.append(residual.array + pull.array)
                dilations.append(dilation.array.copy())
                masses.append(c * mass_p.array)
                moved.append((total[0].array.copy(), total[1].array.copy()))
        # a₀(u_i, u_j), b(u_j, p_i), (p_i, p_j)/λ₁.
        products = global_sum(
            dofs.comm,
            np.array([[[u @ k, p @ d, p @ m] for k, d, m in zip(elastic, dilations, masses, strict=True)]
                      for u, p in moved]),
        )  # fmt: skip
        elastic_energy, coupled, compressed = np.moveaxis(products, -1, 0)
        count, mirrored = len(held), self._body.mirrored
        for dead in applied:
            residuals[-1] -= dead.forces / split.unit
        found = sums(dofs, residuals, held)
        beyond = energy_beyond(loads, split.elastic.lame_mu[0], mirrored)
        stationary, energies = elastic_energy + coupled + coupled.T - compressed, np.diag(elastic_energy + compressed)
        response = reaction(loads, stationary[:count, :count] + beyond, found.on_probe[:count], mirrored)
        balance = found.imbalance(energies[:count], loads, mirrored)
        if not applied:
            return replace(response, balance=balance), None
        (dead,) = (load.times(1 / split.unit) for load in applied)
        works = global_sum(dofs.comm, np.array([u @ dead.forces for u, _ in moved]))
        balance = max(balance, imbalance(found, energies, works, dead, loads, mirrored))
        loaded = carried_of(stationary, works, found.on_probe[-1], mirrored, apart=loads.apart)
        return replace(response, balance=balance), loaded

    @stage("spaces, forms")
    def _space(self, degree: int) -> MixedSpace:
        """Return the spaces of elements of ``degree``, made when first asked for; collective."""
        if degree not in self._mixed:
            self._mixed[degree] = MixedSpace(self._body, self._spaces.get(degree, self._conditions))
            self._stack.callback(self._mixed[degree].close)
        return self._mixed[degree]

    @property
    def space(self) -> MixedSpace:
        """The spaces of displacements and pressures."""
        return self._fine

    def saddle(self, *, direct: bool, degree: int | None = None) -> tuple[Saddle, float]:
        """Return the blocks for elements of ``degree``, None for its own, and the seconds of assembly; collective.

        The problem owns the matrices.
        """
        degree = degree or self._degree
        space = self._space(degree)
        degrees = [degree] if direct else range(1, degree + 1)
        levels, seconds = zip(*(self._level(d, blocked=not direct and d > 1) for d in degrees), strict=True)
        moduli = zip(self._elastic.lame_lambda, self._elastic.lame_mu, strict=True)
        stiffness = space.by_region(tuple(lame_lambda + 2 * mu for lame_lambda, mu in moduli))
        saddle = Saddle(list(levels), *space.blocks(entries=direct), stiffness, degree - 1)
        return saddle, space.assembly_seconds + sum(seconds)

    @stage("set-up")
    def _solver(self, degree: int, *, direct: bool) -> tuple[SaddleSolver, float]:
        """Return the solver for elements of ``degree``, and the seconds that its assembly took; collective."""
        saddle, seconds = self.saddle(direct=direct, degree=degree)
        if (degree, direct) not in self._solvers:
            below = self._solvers.get((degree - 1, False))
            solver = SaddleSolver(saddle, direct=direct, below=below)
            self._solvers[degree, direct] = self._set_up.enter_context(solver)
        return self._solvers[degree, direct], seconds

    def _use(self, elastic: MaterialLaw) -> None:
        """Make ``elastic`` the law of K₀: of one material it is always the same, and what is set up serves on."""
        if elastic != self._elastic:
            self._set_up.close()
            self._levels.clear()
            self._solvers.clear()
            self._elastic = elastic

    def _level(self, degree: int, *, blocked: bool) -> tuple[Level, float]:
        """Return K₀ in displacements of ``degree``, and the seconds that its assembly took; collective."""
        if (degree, blocked) not in self._levels:
            space = self._spaces.get(degree, self._conditions)
            operators = space.operators
            law = self._elastic
            lent = operators.lend_for_cycles(law) if blocked else operators.lend(law, blocked=False)
            matrix, seconds = self._set_up.enter_context(lent)
            jumps = not self._elastic.is_uniform
            self._levels[degree, blocked] = Level(space.dofs.space, matrix, space.dofs.prescribed, jumps), seconds
        return self._levels[degree, blocked]


def _times(response: Response, unit: float) -> Response:
    """Return the response in newtons, given that for moduli in a ``unit`` (Pa)."""
    return replace(response, stiffness=unit * response.stiffness, forces=unit * response.forces)
