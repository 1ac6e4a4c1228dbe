"""A body, a probe that displaces part of its surface, and the force that this takes, by displacement elements.

    find u with K u = 0 inside, u = the probe's motion on its footprint (bonded) or its normal part only
    (frictionless), u = 0 on the support; K = λ A_λ + μ A_μ;

and, where loads f act, w with K w = f, w = 0 on footprint and support (:mod:`pipeline.solve.carried`).

The force is the reaction (:mod:`pipeline.solve.reaction`). Stress integrated under the probe is wrong by tens of per
cent on the same solution.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any, Self

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.carried import Carried, carried_of, imbalance, shares
from pipeline.solve.closure import TWO_SIDED, balanced, energy_beyond, far_share
from pipeline.solve.conditions import Conditions
from pipeline.solve.dead_loads import Applied
from pipeline.solve.earlier import Earlier
from pipeline.solve.enrich import energy_decrements
from pipeline.solve.error import error_bar, stiffness_bars
from pipeline.solve.forms import mean_strain_form
from pipeline.solve.hierarchy import Hierarchy, SetUp
from pipeline.solve.linear import LinearSolver, is_direct
from pipeline.solve.loads import Loads, Motion
from pipeline.solve.material import MaterialLaw
from pipeline.solve.reaction import Response, reaction, sums
from pipeline.solve.release import Front, Release, Released
from pipeline.solve.rim import plain_share
from pipeline.solve.solution import MOST_ROUNDS, TOLERANCE, Solution, check_balance, rest
from pipeline.solve.spaces import ElasticSpace, Spaces
from pipeline.solve.strain import largest_strain, principal_strains
from pipeline.solve.vectors import global_sum, vector
from pipeline.stages import stage


class DisplacementProblem:
    """The spaces of a mesh, a degree and conditions: solves for any material and loads. A context manager."""

    def __init__(
        self, spaces: Spaces, degree: int, conditions: Conditions, *, shared: bool = False, reuse: bool = False
    ):
        """Prepare; ``shared`` assembles A_λ and A_μ apart, once, for many pairs of λ and μ. Collective.

        ``reuse`` begins each solve from the solution of the one before. What the spaces hold is freed with them.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._reuse = reuse
        # By motion, the last solution for a unit of it less the prescribed displacements, owned dofs.
        self.corrections: dict[Motion, FloatArray] = {}
        self._earlier: Earlier | None = None  # of a tool and the far fields of its places
        self._loaded: FloatArray | None = None  # the last solution for dead loads, owned dofs
        self._body, self._conditions = spaces.body, conditions
        self._hierarchy = Hierarchy(spaces, degree, conditions, shared=shared)
        self._fine = self._hierarchy.fine
        self._strain = mean_strain_form(self._fine.dofs.space, self._fine.forms.displacement)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.corrections.clear()
        self._earlier = None
        self._hierarchy.let_go()

    @property
    def dofs(self) -> int:
        """Unknowns of the modelled part."""
        return self._fine.dofs.dofs

    @property
    def space(self) -> ElasticSpace:
        """The space of displacements."""
        return self._fine

    def solve(
        self, law: MaterialLaw, loads: Loads, *, method: str = "auto", tolerance: float = TOLERANCE,
        estimate: bool = False,
    ) -> Solution:  # fmt: skip
        """Solve for each motion of ``loads``, with one set-up, and return forces and checks; collective.

        ``tolerance`` is that of the energy norm of the solver's error. ``estimate`` goes on in the space of one degree
        more, for the solution's ``decrements`` and ``bars``.

        Raises:
            SolveError: if the solver did not converge, or the solution fails a check.
        """
        fine, asked = self._fine, tolerance
        direct = is_direct(method, self.dofs, fine.degree)
        tolerance *= TWO_SIDED if loads.far is not None else 1.0
        held = [fine.dofs.held(motion) for motion in loads.motions]
        applied = fine.applied(loads.dead)
        earlier = self._solved_with(law) if self._reuse and loads.far is not None and not direct else None
        with ExitStack() as stack:
            start = time.perf_counter()
            columns = [*held, *applied]
            rhs, unknowns = ([stack.enter_context(vector(fine.dofs.space)) for _ in columns] for _ in range(2))
            for motion, values, load, unknown in zip(loads.motions, held, rhs, unknowns, strict=False):
                fine.lift(load, values, law)
                self._guess(motion, load, unknown, earlier)
            for dead in applied:
                fine.put(rhs[-1], dead)
            assemble = time.perf_counter() - start
            found = self._hierarchy.set_up(law, stack, direct=direct, keep=earlier is not None)
            solver, assemble = found.solver, assemble + found.seconds
            start = time.perf_counter()
            new = [earlier is None or motion not in earlier.known for motion in loads.motions] + [True] * len(applied)
            iterations = sum(solver.solve(rhs[n], unknowns[n], tolerance) for n in np.flatnonzero(new))
            response, carried = self._response(unknowns, held, applied, law, loads)
            for _ in range(MOST_ROUNDS):
                if direct or (share := rest(response.balance, asked)) == 1.0:
                    break
                tolerance *= share
                iterations += sum(solver.solve(*pair, tolerance) for pair in zip(rhs, unknowns, strict=True))
                response, carried = self._response(unknowns, held, applied, law, loads)
            check_balance(response.balance)
            if loads.far is not None:
                if earlier is not None:
                    earlier.remember(loads.motions, solver, rhs, unknowns)
                loads, held = self._close(response, unknowns, held)
                response = balanced(self._response(unknowns, held, applied, law, loads)[0])
            self.corrections = {m: u.array.copy() for m, u in zip(loads.motions, unknowns, strict=False)}
            self._loaded = unknowns[-1].array.copy() if applied else None
            self._move(held, loads)
            seconds = time.perf_counter() - start
            released, pushed = self._released(law, held, loads)
            solution = Solution(
                response, self._largest_strain(), fine.dofs.whole_dofs, self._body.cells,
                iterations, assemble, solver.setup_seconds, seconds, released=released, pushed=pushed,
                carried=carried,
            )  # fmt: skip
            return self._estimated(solution, law, held, loads, found, stack) if estimate else solution

    def _estimated(
        self, solution: Solution, law: MaterialLaw, held: list[FloatArray], loads: Loads, below: SetUp, stack: ExitStack
    ) -> Solution:
        """Return the last ``solution`` with its bars."""
        fine = self._fine
        if not below.solver.is_single and fine.degree > 1:
            below.solver.close()  # what the next degree takes is the most memory of all
        start = time.perf_counter()
        gained, (released_finer, pushed_finer), more = self._decrements(law, held, loads, below, stack)
        plain = plain_share(self._body)
        form = solution.response.stiffness if solution.carried is None else solution.carried.form
        relative = np.array([error_bar(share, fine.degree, plain=plain) for share in shares(gained, form)])
        return replace(
            solution.with_bars(gained, stiffness_bars(form, relative), "displacement", apart=loads.apart), plain=plain,
            estimate_iterations=more, released_finer=released_finer, pushed_finer=pushed_finer,
            time_estimate=time.perf_counter() - start,
        ).with_release_bar(fine.degree)  # fmt: skip

    def _guess(self, motion: Motion, load: PETSc.Vec, unknown: PETSc.Vec, earlier: Earlier | None) -> None:
        """Begin an ``unknown`` with the last solution for its motion, or with what ``earlier`` ones tell of it."""
        if self._reuse and motion in self.corrections:
            unknown.array[:] = self.corrections[motion]
        elif earlier is not None:
            unknown.array[:] = earlier.known[motion] if motion in earlier.known else earlier.guess(load.array)

    def _solved_with(self, law: MaterialLaw) -> Earlier:
        """Return what was solved with a law: of one at a time it is kept."""
        if self._earlier is None or self._earlier.law != law:
            self._earlier = Earlier(self._fine.dofs.comm, self._fine.dofs.owned, law)
        return self._earlier

    @staticmethod
    def _close(response: Response, unknowns: list[PETSc.Vec], held: list[FloatArray]) -> tuple[Loads, list[FloatArray]]:
        """Make one motion, with its share of the far field, of two: return it and what it prescribes."""
        share = far_share(response)
        unknowns[0].axpy(share, unknowns[1])
        del unknowns[1]
        return response.loads.closed(share), [held[0] + share * held[1]]

    @contextmanager
    def solver(self, law: MaterialLaw, method: str = "auto", *, linear: bool = True) -> Iterator[LinearSolver]:
        """Lend a solver for a material; collective. ``linear``: its preconditioner is, to the last digit.

        Raises:
            SolveError: if it cannot be set up.
        """
        direct = is_direct(method, self.dofs, self._fine.degree)
        with ExitStack() as stack:
            levels, _ = self._hierarchy.levels(law, stack, direct=direct, entries=linear)
            solver = LinearSolver(levels, direct=direct, tolerance=0.5, linear=linear)
            stack.callback(solver.close)
            yield solver

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        return self._fine.forms.displacement, principal_strains(self._strain, self._body)

    def largest_strain(self, displacement: PETSc.Vec) -> float:
        """Return the largest principal strain of ``displacement``; collective."""
        self._fine.set_displacement(displacement)
        return self._largest_strain()

    def _largest_strain(self) -> float:
        return largest_strain(self._strain, self._body, self._conditions.front)

    def _unit(self, motion: Motion, held: FloatArray) -> FloatArray:
        """Return the last solution for a unit of ``motion``, owned dofs."""
        return np.asarray(self.corrections[motion] + held[: self._fine.dofs.owned])

    def _move(self, held: list[FloatArray], loads: Loads) -> None:
        """Make the sum of the motions the displacement of the forms; collective."""
        with vector(self._fine.dofs.space) as displacement:
            for motion, values, amount in zip(loads.motions, held, loads.amounts, strict=True):
                displacement.array[:] += amount * self._unit(motion, values)
            if loads.dead is not None and self._loaded is not None:
                displacement.array[:] += self._loaded
            self._fine.set_displacement(displacement)

    @stage("error bar")
    def _decrements(
        self, law: MaterialLaw, held: list[FloatArray], loads: Loads, below: SetUp, stack: ExitStack
    ) -> tuple[FloatArray, Released, int]:
        """Return what one degree more takes away from the last stiffness of the whole body, and the iterations.

        Between them is what it makes of the energy that a slit's front, and the blade's tip, release.
        """
        fine = self._fine
        finer, solver = self._hierarchy.above(below, stack)
        moved = fine.forms.displacement.x.array.copy()
        applied = finer.applied(loads.dead)
        units = [([values], Loads((motion,), (1.0,))) for motion, values in zip(loads.motions, held, strict=True)]
        units += [([], Loads((), (), dead=loads.dead)) for _ in applied]
        residuals = [stack.enter_context(vector(finer.dofs.space)) for _ in units]
        for unit, residual in zip(units, residuals, strict=True):
            self._move(*unit)
            finer.forms.displacement.interpolate(fine.forms.displacement)
            finer.apply(residual, law, checked=False)
            residual.scale(-1.0)
            residual.array[finer.dofs.prescribed_owned] = 0.0
        for dead in applied:
            finer.put(residuals[-1], dead)
        decrements, corrections, iterations = energy_decrements(solver, residuals, keep=self._has_slit)
        released = self._released(law, held, loads, finer, corrections)
        fine.forms.displacement.x.array[:] = moved
        return 2.0 ** len(self._body.mirrored) * decrements, released, iterations

    @property
    def _has_slit(self) -> bool:
        return self._conditions.front is not None

    @stage("energy release")
    def _released(
        self, law: MaterialLaw, held: list[FloatArray], loads: Loads, finer: ElasticSpace | None = None,
        corrections: Sequence[FloatArray] = (),
    ) -> Released:  # fmt: skip
        """Return what a slit's front and the blade's tip in the whole body release (J/m), by pairs of motions.

        They are those of the last solution, or of its ``corrections`` in a ``finer`` space; collective.
        """
        space = finer or self._fine
        space.forms.set_law(law)

        def put(amounts: FloatArray) -> None:
            self._move(held, Loads(loads.motions, tuple(amounts)))
            if finer is None:
                return
            with vector(space.dofs.space) as displacement:
                space.forms.displacement.interpolate(self._fine.forms.displacement)
                displacement.array[:] = space.forms.displacement.x.array[: space.dofs.owned] + amounts @ corrections
                space.set_displacement(displacement)

        def of(line: Front | None) -> FloatArray | None:
            if line is None:
                return None
            release = Release(self._body, line, space.forms.displacement, space.forms.lame)
            found = 2.0 ** len(self._body.mirrored) * release.matrix(len(held), put)
            self._move(held, loads)
            return found

        return of(self._conditions.front), of(self._conditions.tip)

    def _response(
        self, unknowns: list[PETSc.Vec], held: list[FloatArray], applied: list[Applied], law: MaterialLaw, loads: Loads
    ) -> tuple[Response, Carried | None]:
        """Return the response to the motions whose solutions, less the prescribed displacements, are ``unknowns``.

        The last of them is that of loads that are ``applied``, if any are: what they do comes after the response.
        """
        fine, owned, mirrored, count = self._fine, self._fine.dofs.owned, self._body.mirrored, len(held)
        units = [unknown.array + values[:owned] for unknown, values in zip(unknowns, held, strict=False)]
        units += [unknown.array.copy() for unknown in unknowns[count:]]
        residuals = []
        for unit in units:
            with vector(fine.dofs.space) as residual, vector(fine.dofs.space) as displacement:
                displacement.array[:] = unit
                fine.set_displacement(displacement)
                fine.apply(residual, law)
                residuals.append(residual.array.copy())
        stationary = global_sum(fine.dofs.comm, np.array([[u @ r for r in residuals] for u in units]))
        for dead in applied:
            residuals[-1] -= dead.forces
        found = sums(fine.dofs, residuals, held)
        beyond = energy_beyond(loads, law.lame_mu[0], mirrored)
        response = reaction(loads, stationary[:count, :count] + beyond, found.on_probe[:count], mirrored)
        balance = found.imbalance(np.diag(stationary)[:count], loads, mirrored)
        if not applied:
            return replace(response, balance=balance), None
        works = global_sum(fine.dofs.comm, np.array([u @ applied[0].forces for u in units]))
        balance = max(balance, imbalance(found, np.diag(stationary), works, applied[0], loads, mirrored))
        loaded = carried_of(stationary, works, found.on_probe[-1], mirrored, apart=loads.apart)
        return replace(response, balance=balance), loaded
