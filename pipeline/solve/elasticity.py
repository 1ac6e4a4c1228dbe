"""A body, a probe that displaces part of its surface, and the force that this takes.

    find u with K u = 0 inside, u = travel on the probe's footprint (bonded) or its normal part only
    (frictionless), u = 0 on the support; K = λ A_λ + μ A_μ.

The force is the reaction: the residual K u of the *unmodified* operator, summed over the probe's dofs.
Stress integrated under the probe is wrong by tens of per cent on the same solution.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from pipeline.solve.enrich import energy_decrement
from pipeline.solve.error import error_bar
from pipeline.solve.forms import mean_strain_form
from pipeline.solve.linear import Level, LinearSolver, SolveError, is_direct
from pipeline.solve.rim import plain_share
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
from pipeline.solve.space import ConstrainedSpace, Contact
from pipeline.solve.spaces import Spaces
from pipeline.stages import stage


class ElasticBody:
    """The spaces of a mesh, a degree and a contact: solves for any λ and μ. A context manager."""

    def __init__(self, spaces: Spaces, degree: int, contact: Contact, *, shared: bool = False, reuse: bool = False):
        """Prepare; ``shared`` assembles A_λ and A_μ apart, once, for many pairs of λ and μ. Collective.

        ``reuse`` begins each solve from the solution of the one before. What the spaces hold is freed with them.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._shared, self._reuse = shared, reuse
        self.correction: FloatArray | None = None  # the last solution less the prescribed displacements, owned dofs
        self._spaces, self._body, self._contact = spaces, spaces.body, contact
        self._fine = spaces.get(degree, contact)
        self._strain = mean_strain_form(self._fine.space, self._fine.forms.displacement)
        self.dofs = self._fine.dofs

    def __enter__(self) -> "ElasticBody":
        return self

    def __exit__(self, *_: object) -> None:
        self.correction = None

    def solve(
        self, lame: tuple[float, float], *, method: str = "auto", tolerance: float = TOLERANCE, estimate: bool = False
    ) -> Solution:
        """Solve for Lamé's λ and μ (Pa) and return force, energy and checks; collective.

        ``estimate`` goes on in the space of one degree more, for :attr:`Solution.decrement`.

        Raises:
            SolveError: if the solver did not converge, or the solution fails a check.
        """
        fine = self._fine
        direct = is_direct(method, self.dofs, fine.degree)
        with ExitStack() as stack:
            start = time.perf_counter()
            rhs, unknown = (stack.enter_context(fine.vector()) for _ in range(2))
            fine.lift(rhs, lame)
            if self._reuse and self.correction is not None:
                unknown.array[:] = self.correction
            assemble = time.perf_counter() - start
            levels, seconds = self._hierarchy(lame, direct=direct)
            assemble += seconds
            tolerance = needed_tolerance(self._contact.travel, tolerance)
            solver = LinearSolver(levels, direct=direct, tolerance=tolerance)
            stack.callback(solver.close)
            start = time.perf_counter()
            iterations = solver.solve(rhs, unknown)
            reaction, energy, balance = self._reaction(unknown, lame)
            if not direct and (share := rest(balance, tolerance)) < 1:
                iterations += solver.solve(rhs, unknown, share * tolerance)
                reaction, energy, balance = self._reaction(unknown, lame)
            if balance > BALANCE_LIMIT:
                raise SolveError(f"forces do not balance: relative error {balance:.1e}, allowed {BALANCE_LIMIT:.0e}")
            self.correction = unknown.array.copy()
            seconds = time.perf_counter() - start
            solution = Solution(
                reaction, energy, largest_strain(self._strain, self._body), balance, fine.whole_dofs, iterations,
                assemble, solver.setup_seconds, seconds,
            )  # fmt: skip
            if not estimate:
                return solution
            solver.close()  # what the next degree takes is the most memory of all
            start = time.perf_counter()
            found, more = self._decrement(lame, levels, stack)
            plain = plain_share(self._body)
        decrement = found / (2 * energy)
        return replace(
            solution, decrement=decrement, bar=error_bar(decrement, fine.degree, plain=plain), plain=plain,
            estimate_iterations=more, time_estimate=time.perf_counter() - start,
        )  # fmt: skip

    @contextmanager
    def solver(self, lame: tuple[float, float], method: str = "auto") -> Iterator[LinearSolver]:
        """Lend the solver for Lamé's λ and μ (Pa); collective.

        Raises:
            SolveError: if it cannot be set up.
        """
        direct = is_direct(method, self.dofs, self.space.degree)
        with ExitStack() as stack:
            levels, _ = self._hierarchy(lame, direct=direct)
            for level in levels:  # the next solve's operators would take their place
                self._spaces.get(level.degree, self._contact).disown(level.matrix)
                stack.callback(level.matrix.destroy)
            solver = LinearSolver(levels, direct=direct, tolerance=0.5)
            stack.callback(solver.close)
            yield solver

    @property
    def space(self) -> ConstrainedSpace:
        """The space of displacements."""
        return self._fine

    @property
    def multiplicity(self) -> float:
        """How many times the modelled part makes up the whole body."""
        return 2.0 ** len(self._body.mirrored)

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        return self._fine.forms.displacement, principal_strains(self._strain, self._body)

    def largest_strain(self, displacement: PETSc.Vec) -> float:
        """Return the largest principal strain of ``displacement``; collective."""
        self._fine.set_displacement(displacement)
        return largest_strain(self._strain, self._body)

    def _hierarchy(self, lame: tuple[float, float], *, direct: bool) -> tuple[list[Level], float]:
        """Return the levels of multigrid, or the one of a direct solve, and the seconds that one assembly takes."""
        spaces = [self._fine] if direct else [*self._coarser(), self._fine]
        found = [self._level(space, lame, blocked=not direct) for space in spaces]
        return [level for level, _ in found], sum(seconds for _, seconds in found)

    def _coarser(self) -> list[ConstrainedSpace]:
        """Return the spaces of lower degree; collective."""
        return [self._spaces.get(degree, self._contact) for degree in range(1, self._fine.degree)]

    def _level(self, space: ConstrainedSpace, lame: tuple[float, float], *, blocked: bool) -> tuple[Level, float]:
        blocked = blocked and space.degree > 1
        matrix, seconds = space.operator(lame, shared=self._shared, blocked=blocked)
        return Level(space.space, matrix, space.prescribed), seconds

    @stage("error bar")
    def _decrement(self, lame: tuple[float, float], levels: list[Level], stack: ExitStack) -> tuple[float, int]:
        """Return the energy, of the whole body, that one degree more takes away from the last solution."""
        fine = self._fine
        finer = self._spaces.get(fine.degree + 1, self._contact)
        if len(levels) == 1:
            levels = [*(self._level(space, lame, blocked=True)[0] for space in self._coarser()), *levels]
        level, _ = self._level(finer, lame, blocked=True)
        solver = LinearSolver([*levels, level], direct=False, tolerance=0.5)
        stack.callback(solver.close)
        finer.forms.displacement.interpolate(fine.forms.displacement)
        with finer.vector() as residual:
            finer.apply(residual, lame)
            residual.scale(-1.0)
            residual.array[finer.prescribed_owned] = 0.0
            energy, iterations = energy_decrement(solver, residual)
        return self.multiplicity * energy, iterations

    def _reaction(
        self, unknown: PETSc.Vec, lame: tuple[float, float]
    ) -> tuple[tuple[float, float, float], float, float]:
        """Return the force on the probe, the strain energy, and how well they balance.

        ``unknown`` is the displacement less what is prescribed of it.
        """
        fine = self._fine
        with fine.vector() as residual, fine.vector() as displacement:
            displacement.array[:] = unknown.array + fine.held[: fine.owned]
            fine.set_displacement(displacement)
            fine.apply(residual, lame)
            r, u = residual.array, displacement.array.copy()
            on_probe = global_sum(fine.comm, r.reshape(-1, 3)[fine.probe_owned].sum(axis=0))
            on_support = global_sum(fine.comm, r.reshape(-1, 3)[fine.fixed_owned].sum(axis=0))
            twice_energy = float(global_sum(fine.comm, np.array([r @ u]))[0])
            held = fine.held[: fine.owned]
            work = float(global_sum(fine.comm, np.array([r[fine.prescribed_owned] @ held[fine.prescribed_owned]]))[0])
        # Of a half or quarter model: its images double what lies in the plane and cancel what is across it.
        whole = np.full(3, self.multiplicity)
        whole[list(self._body.mirrored)] = 0.0
        on_probe, on_support = whole * on_probe, whole * on_support
        work, twice_energy = self.multiplicity * work, self.multiplicity * twice_energy
        size = float(np.linalg.norm(on_probe))
        if not (np.isfinite(twice_energy) and np.isfinite(size) and twice_energy > 0 and size > 0):
            raise SolveError(f"the solution is not a number or has no energy (2U = {twice_energy:g} J)")
        # A frictionless probe takes no force across its axis, a bonded one balances in every direction.
        balance = max(abs(work - twice_energy) / twice_energy, float(np.linalg.norm(on_probe + on_support)) / size)
        # Along the travel, force is what makes the work 2U: an energy is stationary, its error the solver's squared.
        travel = np.array(self._contact.travel) if self._contact.bonded else self._contact.travel[2] * np.eye(3)[2]
        on_probe += (twice_energy - work) * travel / (travel @ travel)
        x, y, z = (-float(component) for component in on_probe)
        return (x, y, z), twice_energy / 2, balance
