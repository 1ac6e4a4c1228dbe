"""Nearly and fully incompressible bodies: displacement and pressure by Taylor–Hood elements P_k / P_{k-1}.

With λ split into λ₀ = μ, which stays with the displacement, and λ₁ = λ − λ₀, the energy is
½ ∫ λ₀ (div u)² + 2μ ε(u) : ε(u) + λ₁ (Π div u)², Π the projection onto the pressures: p = λ₁ Π div u, and

    a₀(u, v) + b(v, p) = 0,    b(u, q) − (1/λ₁) (p, q) = 0,    b(v, q) = ∫ q div v,

holds for ν = ½, where 1/λ₁ = 0. Divided by μ, all but 1/λ₁ is the same for every material: it is assembled once.

The force is the reaction K₀ u + Bᵀ p on the probe; along the probe's travel it is the value of the functional
a₀(u, u) + 2 b(u, p) − (p, p)/λ₁, which is stationary: its error is the square of the solver's.

F_h is no upper bound, since the constraint is relaxed; s = F_k − F_{k+1} may have either sign, and vanish by chance.
The bar is therefore the larger of what :mod:`pipeline.solve.error` makes of |s|, with the same constants, and of a
share of N, the energy norm squared of the correction that elements of degree k + 1 ask for. N / |s| is 2 to 5 but
where s changes its sign.
"""

import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from pipeline.solve.error import error_bar
from pipeline.solve.forms import mean_strain_form
from pipeline.solve.linear import Level, SolveError
from pipeline.solve.mixed_space import MixedSpace
from pipeline.solve.rim import plain_share
from pipeline.solve.saddle import Pair, Saddle, SaddleSolver
from pipeline.solve.solution import (
    BALANCE_LIMIT,
    TOLERANCE,
    FloatArray,
    Solution,
    global_sum,
    largest_strain,
    needed_tolerance,
    principal_strains,
    rest,
)
from pipeline.solve.space import Contact
from pipeline.solve.spaces import Spaces
from pipeline.stages import stage

# λ₀/μ = 1 (ν = ¼): small enough for the multigrid, large enough for the pressure's mass to be a good preconditioner.
LAME = (1.0, 1.0)
# Dofs up to which a direct solve is faster, measured for degrees 2 and 3 (docs/solvers.md).
DIRECT_LIMIT = 1_500
# Relative energy norm of the error to which the solution of degree k + 1 is found for the error bar.
_ESTIMATE_TOLERANCE = 0.1
# Forces balance at a tenth of the tolerance that F needs: three iterations more, less than to find out and go on.
STRICTER = 0.1


@dataclass(frozen=True)
class _Forces:
    """What a pair of fields gives, for μ = 1 and the whole body; ``work`` is F·d as a stationary value."""

    reaction: FloatArray
    work: float
    balance: float


class MixedBody:
    """The spaces of a mesh, a degree k and a contact: solves for any λ > μ, infinity too, sharing all assembly.

    A context manager, which frees what it made.
    """

    def __init__(self, spaces: Spaces, degree: int, contact: Contact):
        """Prepare; collective. Until its end, nobody else may ask the spaces for an operator.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._spaces, self._body, self._contact = spaces, spaces.body, contact
        self._stack = ExitStack()
        self._mixed: dict[int, MixedSpace] = {}
        self._levels: dict[tuple[int, bool], tuple[Level, float]] = {}
        self._solvers: dict[tuple[int, bool], SaddleSolver] = {}
        self._degree = degree
        self._fine = self._space(degree)
        fine = self._fine.displacements
        self._strain = mean_strain_form(fine.space, fine.forms.displacement)
        self.dofs = self._fine.dofs

    def __enter__(self) -> "MixedBody":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def solve(
        self, lame: tuple[float, float], *, method: str = "auto", tolerance: float = TOLERANCE, estimate: bool = False
    ) -> Solution:
        """Solve for Lamé's λ, which may be infinite, and μ (Pa); return force, energy and checks; collective.

        ``tolerance`` is that of the energy norm of the solver's error. ``estimate`` goes on with elements of one
        degree more, for ``decrement``, which may be negative, and ``bar``.

        Raises:
            SolveError: if λ <= μ, the solver did not converge, or the solution fails a check.
        """
        lame_lambda, mu = lame
        if not lame_lambda > mu:
            raise SolveError("mixed elements are for Poisson's ratios above 0.25; use displacement elements")
        tolerance = STRICTER * needed_tolerance(self._contact.travel, tolerance)
        c = 0.0 if lame_lambda == inf else 1 / (lame_lambda / mu - LAME[0])
        direct = method == "direct" or (method == "auto" and self.dofs <= DIRECT_LIMIT)
        solver, assemble = self._solver(self._degree, direct=direct)
        start = time.perf_counter()
        with self._fine.pair() as unknown:
            iterations = self._correct(self._fine, solver, c, unknown, tolerance)
            forces = self._forces(self._fine, c, unknown)
            if (share := rest(forces.balance, tolerance)) < 1:
                self._fine.release(unknown)
                iterations += self._correct(self._fine, solver, c, unknown, share)
                forces = self._forces(self._fine, c, unknown)
        seconds = time.perf_counter() - start - (solver.setup_seconds if direct else 0.0)
        if forces.balance > BALANCE_LIMIT:
            raise SolveError(f"forces do not balance: relative error {forces.balance:.1e}, allowed {BALANCE_LIMIT:.0e}")
        x, y, z = (mu * float(component) for component in forces.reaction)
        solution = Solution(
            (x, y, z), mu * forces.work / 2, largest_strain(self._strain, self._body), forces.balance,
            self._fine.whole_dofs, iterations,
            assemble, solver.setup_seconds, seconds,
        )  # fmt: skip
        return self._estimate(solution, forces.work, c) if estimate else solution

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        return self._fine.displacements.forms.displacement, principal_strains(self._strain, self._body)

    @stage("error bar")
    def _estimate(self, solution: Solution, work: float, c: float) -> Solution:
        """Return ``solution``, whose F·d is ``work`` for μ = 1, with its error bar; collective."""
        start = time.perf_counter()
        solver, _ = self._solver(self._degree + 1, direct=False)
        finer = self._space(self._degree + 1)
        with finer.pair() as unknown:
            finer.start_from(self._fine, unknown)
            iterations = self._correct(finer, solver, c, unknown, _ESTIMATE_TOLERANCE)
            forces = self._forces(finer, c, unknown)
        decrement = (work - forces.work) / work
        unseen = self._multiplicity * solver.first_energy / work
        plain = plain_share(self._body)
        return replace(
            solution, decrement=decrement, plain=plain, estimate_iterations=iterations,
            bar=error_bar(decrement, self._degree, "mixed", plain=plain, unseen=unseen),
            time_estimate=time.perf_counter() - start,
        )  # fmt: skip

    @stage("iterations")
    def _correct(self, space: MixedSpace, solver: SaddleSolver, c: float, unknown: Pair, tolerance: float) -> int:
        """Solve for what is zero where displacements are prescribed, then add those; return the iterations."""
        with space.pair() as rhs:
            space.lift(rhs, LAME)
            iterations = solver.solve(c, rhs, unknown, tolerance)
        unknown[0].array[:] += space.displacements.held[: space.displacements.owned]
        space.set_fields(unknown)
        return iterations

    def _forces(self, space: MixedSpace, c: float, unknown: Pair) -> _Forces:
        """Return the force on the probe, for μ = 1, and how well it balances."""
        fine = space.displacements
        u, p = unknown
        with space.pair() as (residual, dilation), space.pair() as (pull, mass_p):
            space.apply(residual, pull, dilation, LAME)
            space.mass.mult(p, mass_p)
            elastic, coupled, compressed = residual.dot(u), dilation.dot(p), c * mass_p.dot(p)
            residual.axpy(1.0, pull)
            r = residual.array
            on_probe, on_support = (
                global_sum(fine.comm, r.reshape(-1, 3)[dofs].sum(axis=0))
                for dofs in (fine.probe_owned, fine.fixed_owned)
            )
            held = fine.held[: fine.owned]
            work = float(global_sum(fine.comm, np.array([r[fine.prescribed_owned] @ held[fine.prescribed_owned]]))[0])
        # Of a half or quarter model: its images double what lies in the plane and cancel what is across it.
        whole = np.full(3, self._multiplicity)
        whole[list(self._body.mirrored)] = 0.0
        on_probe, on_support = whole * on_probe, whole * on_support
        stationary, energy = elastic + 2 * coupled - compressed, elastic + compressed
        size = float(np.linalg.norm(on_probe))
        if not (np.isfinite(stationary) and np.isfinite(size) and stationary > 0 and size > 0):
            raise SolveError(f"the solution is not a number or has no energy (2U/μ = {stationary:g} m³)")
        balance = max(abs(work - energy) / energy, float(np.linalg.norm(on_probe + on_support)) / size)
        travel = np.array(self._contact.travel) if self._contact.bonded else self._contact.travel[2] * np.eye(3)[2]
        on_probe += self._multiplicity * (stationary - work) * travel / (travel @ travel)
        return _Forces(-on_probe, self._multiplicity * stationary, balance)

    @property
    def _multiplicity(self) -> float:
        """How many times the modelled part makes up the whole body."""
        return 2.0 ** len(self._body.mirrored)

    @stage("spaces, forms")
    def _space(self, degree: int) -> MixedSpace:
        """Return the spaces of elements of ``degree``, made when first asked for; collective."""
        if degree not in self._mixed:
            self._mixed[degree] = MixedSpace(self._body, self._spaces.get(degree, self._contact))
            self._stack.callback(self._mixed[degree].close)
        return self._mixed[degree]

    @property
    def space(self) -> MixedSpace:
        """The spaces of displacements and pressures."""
        return self._fine

    def saddle(self, *, direct: bool, degree: int | None = None) -> tuple[Saddle, float]:
        """Return the blocks for elements of ``degree``, None for its own, and the seconds of assembly; collective.

        The body owns the matrices.
        """
        degree = degree or self._degree
        space = self._space(degree)
        degrees = [degree] if direct else range(1, degree + 1)
        levels, seconds = zip(*(self._level(d, blocked=not direct and d > 1) for d in degrees), strict=True)
        saddle = Saddle(list(levels), space.coupling, space.mass, LAME[0] + 2 * LAME[1], degree - 1)
        return saddle, space.assembly_seconds + sum(seconds)

    @stage("set-up")
    def _solver(self, degree: int, *, direct: bool) -> tuple[SaddleSolver, float]:
        """Return the solver for elements of ``degree``, and the seconds that its assembly took; collective."""
        saddle, seconds = self.saddle(direct=direct, degree=degree)
        if (degree, direct) not in self._solvers:
            self._solvers[degree, direct] = self._stack.enter_context(SaddleSolver(saddle, direct=direct))
        return self._solvers[degree, direct], seconds

    def _level(self, degree: int, *, blocked: bool) -> tuple[Level, float]:
        """Return K₀ for μ = 1 in displacements of ``degree``, and the seconds that its assembly took; collective."""
        if (degree, blocked) not in self._levels:
            space = self._spaces.get(degree, self._contact)
            matrix, seconds = space.operator(LAME, shared=False, blocked=blocked)
            self._levels[degree, blocked] = Level(space.space, matrix, space.prescribed), seconds
        return self._levels[degree, blocked]
