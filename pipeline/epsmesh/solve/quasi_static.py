"""The quasi-static problem: a body, a probe that displaces part of its surface, and the reaction force.

    Find u with K u = 0 inside, u = the probe's motion on its footprint (bonded) or its normal part only
    (frictionless), u = 0 on the support.

The tool is a constraint: its motion is prescribed (:mod:`epsmesh.solve.prescribed`), or its contact area is found
(:mod:`epsmesh.solve.contact.search`). Both give an equilibrium. The force is the reaction
(:mod:`epsmesh.solve.response`): stress integrated under the probe is wrong by tens of per cent.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.cell_values import CellValues, plain_share
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.conditions import Conditions, Front
from epsmesh.solve.contact.search import ContactSearch
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact_result import ContactResult, RestBars
from epsmesh.solve.crack import Advance
from epsmesh.solve.elements import elements_of
from epsmesh.solve.elements.base import Elements, Equilibrium, HierarchicalEstimate, rate_of_linear
from epsmesh.solve.elements.displacement import DisplacementElements
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.estimate import error_bar, stiffness_bars
from epsmesh.solve.hold import check_hold
from epsmesh.solve.influence import cell_influence
from epsmesh.solve.linear_solver import LinearSolver
from epsmesh.solve.movement import Motion, Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.points.state import Influence, State
from epsmesh.solve.prescribed import PrescribedMotion, respond
from epsmesh.solve.response import LoadResponse, Response, shares
from epsmesh.solve.solution import Problem, Request, Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.time_steps import Indentation, TimeSteps, follow_course
from epsmesh.solve.unloaded import Unloaded
from epsmesh.stages import recharge, recorded, stage


class Constraint(Protocol):
    """Constraint of the surface under a tool: a prescribed motion, or unilateral contact."""

    def solve(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Find the equilibrium for a movement of the tool; the ``stack`` frees what is made; collective.

        Raises:
            SolveError: if there is none, or it fails a check.
        """

    def in_time(self, asked: Request, found: Equilibrium, stack: ExitStack) -> Indentation:
        """Return the body in time steps up to the equilibrium that was found; collective."""

    def close(self) -> None:
        """Free what is kept between solves."""


class QuasiStaticProblem(Problem):
    """Elements on a mesh with conditions, ready for any material and movement. A context manager."""

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
        shape: Unloaded | None = None,
    ):
        """Prepare elements of a ``degree``, of the kind "displacement" or "mixed"; collective.

        Unilateral contact needs the ``tool``. With ``reuse`` the last solution is the initial guess of the next solve;
        ``condense``: see ``ContactSearch``. The ``spaces`` of a ``shape`` without load are closed with the problem.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both; or if nothing holds the
                body.
        """
        self.elements: Elements = elements_of(spaces, degree, conditions, element)
        beds = () if tool is None else tuple(bed for bed in tool.beds if not bed.is_tissue)
        check_hold(self.elements.displacements, [(np.array(bed.normal), bed.drags or bed.sticks) for bed in beds])
        self.constraint: Constraint = PrescribedMotion(self.elements, reuse=reuse)
        if tool is not None:
            self.constraint = ContactSearch(spaces, self.elements, tool, reuse=reuse, condense=condense)
        self._body, self._conditions, self.spaces, self._shape = spaces.body, conditions, spaces, shape
        space = self.elements.displacements
        self._values = CellValues(
            self._body, space.forms.displacement, is_mixed=element == "mixed", factors=space.means
        )
        self._law: MaterialLaw | None = None  # of the last solution
        self._influence: Influence | None = None
        # The fields of the last solution in elements of one degree more, if they were requested and are known.
        self.finer_state: State | None = None

    def close(self) -> None:
        """Free what is kept between solves."""
        self.constraint.close()
        self.elements.close()
        if self._shape is not None:
            self.spaces.close()

    @property
    def corrections(self) -> dict[Motion, tuple[FloatArray, ...]]:
        """The last solution per unit of each prescribed motion: see ``PrescribedMotion``; empty if contact is found."""
        return self.constraint.corrections if isinstance(self.constraint, PrescribedMotion) else {}

    @property
    def dofs(self) -> int:
        """Number of unknowns of the modelled part."""
        return self.elements.dofs

    def answer(self, asked: Request) -> Solution:
        """Solve for each motion of the movement, with one set-up, and return forces and checks; collective.

        An error estimate also solves in elements of one degree more, for ``bars`` and ``decrements``; the latter may
        be negative in mixed elements.

        Raises:
            SolveError: if the elements do not support the law, the solver does not converge, or the solution fails a
                check; a ContactError, if contact is not found.
        """
        self._law, self.finer_state, self._influence = asked.law, None, None
        law, of_shape = asked.law, {} if self._shape is None else self._shape.found
        with recorded() as times, ExitStack() as stack:
            if self._shape is not None:
                recharge(self._shape.times)
            found = self.constraint.solve(asked, stack)
            front, tip = self._released(self.elements, found.columns, law, found.movement)
            self.elements.show(found.columns)
            stored = found.solver.stored
            if stored is None and self._body.is_halved:  # both jaws work
                stored = 2 * found.response.energy / self._body.images
            solution = Solution(
                response=found.response,
                load_response=found.load_response,
                contact=found.contact,
                largest=self._values.largest(law, self._conditions.front) | of_shape,
                dofs=self.elements.whole_dofs,
                cells=self._body.cells,
                iterations=found.iterations,
                times=times,
                front=front,
                tip=tip,
                stored=None if stored is None else self._body.images * stored,
            )
            if asked.estimate:
                solution = self._estimated(solution, found, asked)
            if asked.influence:
                self._influence = self._cell_influence(found, law)
            if asked.course is not None:
                solution = self._followed(solution, found, asked, stack)
            self.elements.show(found.columns)
        return solution

    @stage("error bar")
    def _cell_influence(self, found: Equilibrium, law: MaterialLaw) -> Influence | None:
        """Return the influence on owned cells, None where terms act at rest, or the rate fails; collective."""
        if self.elements.displacements.is_loaded:
            return None
        rate = found.solver.rate(found.columns, found.movement)
        try:
            return cell_influence(self.elements, law, found.columns, rate, found.response.force[2])
        except SolveError:
            return None

    def _followed(self, solution: Solution, found: Equilibrium, asked: Request, stack: ExitStack) -> Solution:
        """Return the ``solution`` with the history of the course; collective.

        Raises:
            LargeError: if the time steps do not reach its end.
        """
        assert asked.course is not None
        self.elements.set_law(asked.law)

        def begin() -> TimeSteps:
            indentation = self.constraint.in_time(asked, found, stack)
            return TimeSteps(asked.law, indentation, found.movement.amounts[0], stack, mirrored=self._body.mirrored)

        history, iterations = follow_course(begin, asked.course)
        return replace(solution, history=history, iterations=solution.iterations + iterations)

    @stage("error bar")
    def _estimated(self, solution: Solution, found: Equilibrium, asked: Request) -> Solution:
        """Return the last ``solution`` with its error bars; collective."""
        elements, columns, movement, law = self.elements, found.columns, found.movement, asked.law
        whole = 2.0 ** len(self._body.mirrored)
        with ExitStack() as stack:
            finer = found.solver.hierarchical_estimate(
                columns, movement, stack, keep=asked.keep or self._conditions.front is not None
            )
            if asked.keep and finer.columns:
                amounts = [column.amount for column in columns]
                finer.elements.show(finer.columns, amounts)
                self.finer_state = finer.elements.state(law)
                if asked.influence:
                    rate = rate_of_linear(finer.elements, finer.columns, movement)
                    above = cell_influence(finer.elements, law, finer.columns, rate)
                    self.finer_state = replace(self.finer_state, influence=above)
            form = _form(solution.response, solution.load_response)
            if finer.decrements is None:
                products = finer.elements.products(law, finer.columns, checked=False)
                decrements = form - _form(*respond(products, finer.columns, law, movement))
            else:
                decrements = whole * finer.decrements
            released = self._released(finer.elements, finer.columns, law, movement) if finer.columns else (None, None)
        plain = plain_share(self._body)
        unseen = None if finer.unseen is None else shares(np.diag(whole * finer.unseen), form)
        relative = finer.relative
        if relative is None:
            rests = np.zeros(len(form)) if unseen is None else unseen
            relative = np.array(
                [
                    error_bar(share, elements.degree, elements.element, plain=plain, unseen=rest)
                    for share, rest in zip(shares(decrements, form), rests, strict=True)
                ]
            )
        relative = relative + self._unresolved(found.columns, law)
        solution = solution.with_bars(
            decrements, stiffness_bars(form, relative), elements.element, decoupled=movement.decoupled
        )
        front, tip = (
            advance and above and advance.with_finer(above, elements.degree, solution.energy_bar)
            for advance, above in zip((solution.front, solution.tip), released, strict=True)
        )
        return replace(
            solution,
            contact=found.contact and _with_bars(found.contact, finer, relative, is_halved=self._body.is_halved),
            plain=plain,
            is_solved=finer.is_solved,
            unseen=None if unseen is None else unseen[: len(movement.motions)],
            front=front,
            tip=tip,
        )

    def _unresolved(self, columns: Sequence[Column], law: MaterialLaw) -> float:
        """Return the relative change of F by what elements do not resolve of a varying stiffness; collective.

        Of a laminate of moduli with a variance v, relative to the square of their mean, the stiffness is between the
        mean and 1 - v of it. Elements of degree 1 resolve means alone, others what is linear in a cell.
        """
        space = self.elements.displacements
        if space.factors is None:
            return 0.0
        self.elements.show(columns)
        energies = self._values.cells(law).energies
        unresolved = space.factors.rests if space.forms.is_sampled else space.factors.variances
        sums = np.array([energies @ unresolved[: len(energies)], energies.sum()])
        rest, whole = global_sum(self._body.comm, sums)
        return float(rest / whole)

    @stage("energy release")
    def _released(
        self, elements: Elements, columns: Sequence[Column], law: MaterialLaw, movement: Movement
    ) -> tuple[Advance | None, Advance | None]:
        """Return the energy (J/m) that a slit's front, and the blade's tip, release in the whole body."""

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
        found = elements.solver(law, direct=elements.is_direct(method))
        try:
            yield found.linear
        finally:
            found.close()

    def state(self) -> State:
        """Return a copy of the last solution's fields, which outlives the problem; collective."""
        assert self._law is not None
        return replace(self.elements.state(self._law), influence=self._influence)

    def largest(self, law: MaterialLaw, displacement: PETSc.Vec) -> dict[str, Any]:
        """Return the cell maxima of ``displacement`` by name; collective."""
        self.elements.displacements.set_displacement(displacement)
        return self._values.largest(law, self._conditions.front)


def _form(response: Response, load_response: LoadResponse | None) -> FloatArray:
    """Return the stiffness, with one more row and column for loads."""
    return response.stiffness if load_response is None else load_response.form


def _with_bars(
    contact: ContactResult, finer: HierarchicalEstimate, relative: FloatArray, *, is_halved: bool
) -> ContactResult:
    """Return a contact with its bars; the second jaw has those of the tool, ``relative`` on F, if it is its image."""
    found = replace(contact, bar=finer.area_bar, friction_bar=finer.friction_bar, at_edge=finer.at_edge)
    found = replace(found, least=finer.least)
    bars = (RestBars(finer.area_bar, float(relative[0])),) if is_halved else finer.rests
    rests = tuple(rest.with_bars(own) for rest, own in zip(contact.rests, bars, strict=False))
    found = replace(found, rests=rests, shortening_bar=finer.shortening_bar)
    if finer.pull is not None:
        found = replace(found, pull=finer.pull)
    if contact.rubbing is None or finer.relative is None:
        return found
    of_slip, of_force = contact.rubbing.bars(contact.area, float(finer.relative[0]), finer.area_bar)
    return replace(found, slip_area_bar=of_slip, friction_force_bar=of_force)
