"""A body, a probe that displaces part of its surface, and the force that this takes, whatever the elements.

    Find u with K u = 0 inside, u = the probe's motion on its footprint (bonded) or its normal part only
    (frictionless), u = 0 on the support.

Where loads f act, w with K w = f and w = 0 on footprint and support is one column more
(:mod:`pipeline.solve.load_response`).
Where the cut face moves with a far field (:mod:`pipeline.solve.far_field`), a unit of that field is one, too. With K
the stiffness of a unit of the tool's movement (0) and a unit of the far field (1), that of what is beyond the cut added
to K₁₁, the energy is stationary where the share s of the field is -K₁₀ / K₁₁. The work of the tool is then that of both
sides of the cut together, F d = 2 (U within + U beyond).

The force is the reaction (:mod:`pipeline.solve.response`). Stress integrated under the probe is wrong by tens of per
cent on the same solution.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any, Self

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.cell_values import CellValues
from pipeline.solve.contact.search import ContactSearch, Tool
from pipeline.solve.crack import Advance, Front
from pipeline.solve.elements import elements_of
from pipeline.solve.elements.base import Column, Elements, Equilibrium, Products, Solver, close_far
from pipeline.solve.elements.displacement import DisplacementElements, DisplacementSolver
from pipeline.solve.estimate import error_bar, stiffness_bars
from pipeline.solve.krylov import LinearSolver, SolveError
from pipeline.solve.load_response import LoadResponse, imbalance, load_response_of, shares
from pipeline.solve.load_steps import LoadSteps, Walk
from pipeline.solve.movement import Motion, Movement
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.response import Response, reaction, sums
from pipeline.solve.rim import plain_share
from pipeline.solve.solution import MOST_ROUNDS, TOLERANCE, Solution, check_balance, rest
from pipeline.solve.spaces import Conditions, Spaces
from pipeline.solve.vectors import global_sum
from pipeline.stages import recorded, stage

# The work of both sides of a cut balances where each motion's does to this share of what is asked of it.
TWO_SIDED = 0.1


class QuasiStaticProblem:
    """Elements on a mesh with conditions: solves for any material and loads. A context manager.

    ``corrections`` are, by motion, the last solution for a unit of it less the prescribed displacements, owned dofs.
    """

    def __init__(
        self,
        spaces: Spaces,
        degree: int,
        conditions: Conditions,
        element: str = "displacement",
        *,
        tool: Tool | None = None,
        reuse: bool = False,
        condense: bool = False,
    ):
        """Prepare elements of a ``degree``, of a kind, "displacement" or "mixed"; collective.

        Where contact is unilateral, what touches of the ``tool`` is found. ``reuse`` begins each solve from the
        solution of the one before: depths of a nonlinear law share one walk. ``condense``: see ``ContactSearch``.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self.elements: Elements = elements_of(spaces, degree, conditions, element)
        self.corrections: dict[Motion, tuple[FloatArray, ...]] = {}
        self.contact: ContactSearch | None = None
        if tool is not None:
            self.contact = ContactSearch(spaces, self.elements, tool, reuse=reuse, condense=condense)
        self._walk: Walk | None = None  # to the last depth in a body of a law that is not linear
        self._reuse = reuse and element == "displacement"
        self._body, self._conditions = spaces.body, conditions
        self._values = CellValues(self._body, self.elements.displacements.forms.displacement)
        self._law: MaterialLaw | None = None  # of the last solution

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.corrections.clear()
        if self.contact is not None:
            self.contact.close()
        self.elements.close()

    @property
    def dofs(self) -> int:
        """Unknowns of the modelled part."""
        return self.elements.dofs

    def solve(
        self,
        law: MaterialLaw,
        movement: Movement,
        *,
        method: str = "auto",
        tolerance: float = TOLERANCE,
        estimate: bool = False,
    ) -> Solution:
        """Solve for each motion of ``movement``, with one set-up, and return forces and checks; collective.

        ``tolerance`` is that of the energy norm of the solver's error. ``estimate`` goes on in elements of one degree
        more, for the solution's ``decrements``, which may be negative for mixed ones, and ``bars``.

        Raises:
            SolveError: if the elements are not for the law, the solver did not converge, or the solution fails a check;
                a ContactError, if contact is not found.
        """
        self._law = law
        with recorded() as times, ExitStack() as stack:
            if self.contact is None:
                found = self._prescribed(law, movement, stack, method=method, tolerance=tolerance)
            else:
                with stage("solve"):
                    found = self.contact.solve(law, movement, stack, method=method, tolerance=tolerance)
            front, tip = self._released(self.elements, found.columns, law, found.movement)
            self.elements.show(found.columns)
            stored = found.solver.stored
            solution = Solution(
                response=found.response,
                load_response=found.load_response,
                contact=found.contact,
                largest=self._values.largest(law, self._conditions.front),
                dofs=self.elements.whole_dofs,
                cells=self._body.cells,
                iterations=found.iterations,
                times=times,
                front=front,
                tip=tip,
                stored=None if stored is None else 2.0 ** len(self._body.mirrored) * stored,
            )
            if estimate:
                solution = self._estimated(solution, found, law)
                self.elements.show(found.columns)
        return solution

    def _prescribed(
        self, law: MaterialLaw, movement: Movement, stack: ExitStack, *, method: str, tolerance: float
    ) -> Equilibrium:
        """Solve for each motion of ``movement``, prescribed on the footprint, and for dead loads; collective."""
        direct = self.elements.is_direct(method)
        # A tool at many places: the same operator, another far field each time.
        keep = self._reuse and movement.far is not None and not direct
        solver = self._set_up(law, movement, stack, direct=direct, keep=keep)
        with stage("assembly"):
            columns = self.elements.columns(movement, stack)
            solver.lift(columns)
        with stage("solve"):
            known = solver.known if keep else {}
            self._guess(columns, movement, known)
            iterations, response, load_response = self._iterate(
                solver, columns, law, movement, known, tolerance=tolerance
            )
            if keep:
                solver.known = {movement.motions[0]: columns[0].unknown[0].array.copy()}
            if movement.far is not None:
                movement = close_far(columns, movement, -float(response.stiffness[1, 0] / response.stiffness[1, 1]))
                response = _balanced(self._response(solver.products(columns), columns, law, movement)[0])
            self.corrections = {
                motion: tuple(part.array.copy() for part in column.unknown)
                for motion, column in zip(movement.motions, columns, strict=False)
            }
        return Equilibrium(solver, columns, movement, iterations, response, load_response)

    def _iterate(
        self,
        solver: Solver,
        columns: list[Column],
        law: MaterialLaw,
        movement: Movement,
        known: Mapping[Motion, FloatArray],
        *,
        tolerance: float,
    ) -> tuple[int, Response, LoadResponse | None]:
        """Solve for ``columns`` until forces balance; return the iterations, and what the solutions do.

        Raises:
            SolveError: if they do not.
        """
        aim = tolerance * min(self.elements.stricter, TWO_SIDED if movement.far is not None else 1.0)
        todo = [column for number, column in enumerate(columns) if _motion(movement, number) not in known]
        iterations = solver.solve(todo, aim)
        for further in range(MOST_ROUNDS + 1):
            response, load_response = self._response(solver.products(columns), columns, law, movement)
            share = rest(response.balance, tolerance)
            if solver.is_exact or share == 1.0 or further == MOST_ROUNDS:
                break
            iterations += solver.improve(columns, share)
        check_balance(response.balance)
        return iterations, response, load_response

    def _guess(self, columns: Sequence[Column], movement: Movement, known: Mapping[Motion, FloatArray]) -> None:
        """Begin with the last solution for each motion, or with one that is ``known``."""
        for motion, column in zip(movement.motions, columns, strict=False):
            if self._reuse and motion in self.corrections:
                for part, values in zip(column.unknown, self.corrections[motion], strict=True):
                    part.array[:] = values
            elif motion in known:
                column.unknown[0].array[:] = known[motion]

    def _response(
        self, found: Products, columns: Sequence[Column], law: MaterialLaw, movement: Movement
    ) -> tuple[Response, LoadResponse | None]:
        """Return the response to the motions, and what dead loads do, of which the last column is; collective."""
        count, mirrored = len(movement.motions), self._body.mirrored
        motions, loaded = columns[:count], columns[count:]
        residuals = [
            residual if column.applied is None else residual - column.applied.forces
            for residual, column in zip(found.residuals, columns, strict=True)
        ]
        total = sums(found.space, residuals, [column.prescribed for column in motions])
        beyond = _energy_beyond(movement, law.lame_mu[0], mirrored)
        response = reaction(movement, found.stationary[:count, :count] + beyond, total.on_probe[:count], mirrored)
        balance = total.imbalance(found.energies[:count], movement, mirrored)
        if not loaded:
            return replace(response, balance=balance), None
        (applied,) = (column.applied for column in loaded)
        assert applied is not None
        works = global_sum(found.space.comm, np.array([u @ applied.forces for u in found.moved]))
        balance = max(balance, imbalance(total, found.energies, works, applied, movement, mirrored))
        load_response = load_response_of(found.stationary, works, total.on_probe[-1], mirrored, apart=movement.apart)
        return replace(response, balance=balance), load_response

    @stage("error bar")
    def _estimated(self, solution: Solution, found: Equilibrium, law: MaterialLaw) -> Solution:
        """Return the last ``solution`` with its bars; collective."""
        elements, columns, movement, whole = (
            self.elements,
            found.columns,
            found.movement,
            2.0 ** len(self._body.mirrored),
        )
        with ExitStack() as stack:
            finer = found.solver.enrich(columns, movement, stack, keep=self._conditions.front is not None)
            form = _form(solution.response, solution.load_response)
            if finer.decrements is None:
                products = finer.elements.products(law, finer.columns, checked=False)
                decrements = form - _form(*self._response(products, finer.columns, law, movement))
            else:
                decrements = whole * finer.decrements
            released = self._released(finer.elements, finer.columns, law, movement) if finer.columns else (None, None)
        plain = plain_share(self._body)
        unseen = None if finer.unseen is None else shares(np.diag(whole * finer.unseen), form)
        relative = finer.relative
        if relative is None:
            rests = np.zeros(len(form)) if unseen is None else unseen
            relative = np.array([
                error_bar(share, elements.degree, elements.element, plain=plain, unseen=rest)
                for share, rest in zip(shares(decrements, form), rests, strict=True)
            ])  # fmt: skip
        solution = solution.with_bars(
            decrements, stiffness_bars(form, relative), elements.element, apart=movement.apart
        )
        front, tip = (
            advance and above and advance.with_finer(above, elements.degree, solution.energy_bar)
            for advance, above in zip((solution.front, solution.tip), released, strict=True)
        )
        return replace(
            solution,
            contact=found.contact and replace(found.contact, bar=finer.area_bar),
            plain=plain,
            unseen=None if unseen is None else unseen[: len(movement.motions)],
            front=front,
            tip=tip,
            estimate_iterations=finer.iterations,
        )

    @stage("energy release")
    def _released(
        self, elements: Elements, columns: Sequence[Column], law: MaterialLaw, movement: Movement
    ) -> tuple[Advance | None, Advance | None]:
        """Return what a slit's front and the blade's tip in the whole body release (J/m)."""

        def of(line: Front | None) -> Advance | None:
            if line is None:
                return None
            release = elements.release(law, line)
            found = release.matrix(len(columns), lambda amounts: elements.show(columns, list(amounts)))
            amounts = np.array([*movement.amounts, *([] if movement.loads is None else [1.0])])
            if (loads := movement.loads) is not None:
                works = elements.works(columns, release.of_forces(lambda: elements.displacements.applied(loads).forces))
                found[:, -1] += works / 2
                found[-1, :] += works / 2
            return Advance(2.0 ** len(self._body.mirrored) * found, amounts, len(movement.motions))

        return of(self._conditions.front), of(self._conditions.tip)

    @contextmanager
    def solver(self, law: MaterialLaw, method: str = "auto") -> Iterator[LinearSolver]:
        """Lend a solver for a material, of displacement elements; collective.

        Raises:
            SolveError: if it cannot be set up.
        """
        elements = self.elements
        assert isinstance(elements, DisplacementElements)
        found = DisplacementSolver(elements, law, direct=elements.is_direct(method))
        try:
            yield found.linear
        finally:
            found.owner.close()

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        assert self._law is not None
        return self.elements.displacements.forms.displacement, self._values.principal_strains(self._law)

    def largest(self, law: MaterialLaw, displacement: PETSc.Vec) -> dict[str, Any]:
        """Return the largest values of ``displacement`` over the cells, by name; collective."""
        self.elements.displacements.set_displacement(displacement)
        return self._values.largest(law, self._conditions.front)

    def _set_up(self, law: MaterialLaw, movement: Movement, stack: ExitStack, *, direct: bool, keep: bool) -> Solver:
        """Return a solver for a law, freed with the ``stack`` unless it is to ``keep``; collective.

        Raises:
            SolveError: if it cannot be set up, or the elements are not for the law.
        """
        if law.is_linear:
            return self.elements.set_up(law, stack, direct=direct, keep=keep)
        if not isinstance(self.elements, DisplacementElements):
            raise SolveError(f"the law {law.name} is for displacement elements")
        walk = self._walk
        if walk is None or not walk.leads_to(law, movement):
            walk = Walk(law, movement.motions[0], np.zeros(self.elements.displacements.owned))
        self._walk = walk if self._reuse else None
        return LoadSteps(self.elements, walk, stack, direct=direct)


def _motion(movement: Movement, number: int) -> Motion | None:
    return movement.motions[number] if number < len(movement.motions) else None


def _form(response: Response, load_response: LoadResponse | None) -> FloatArray:
    """Return the stiffness, with a row more for loads."""
    return response.stiffness if load_response is None else load_response.form


def _energy_beyond(movement: Movement, mu: float, mirrored: Sequence[int]) -> FloatArray | float:
    """Return twice the strain energies (n, n), by pairs of motions, beyond the cut face of the part modelled."""
    if movement.far is None:
        return 0.0
    return np.outer(movement.shares, movement.shares) * movement.far.stiffness(mu) / 2.0 ** len(mirrored)


def _balanced(response: Response) -> Response:
    """Return the response of tool and far field together, its balance with F d = 2 (U within + U beyond).

    Raises:
        SolveError: if that does not hold.
    """
    force, taken = float(response.forces[0, 2]), float(response.stiffness[0, 0])
    balance = max(response.balance, abs(force - taken) / taken)
    check_balance(balance)
    return replace(response, balance=balance)
