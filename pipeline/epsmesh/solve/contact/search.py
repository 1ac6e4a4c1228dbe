"""Unilateral contact with unknown area, without tension or penetration.

The active set is found on elements of degree 1 first, at little cost, then on higher degrees. F is the sum of the
reactions K u of its nodes. F is no bound: a coarse contact area may be too large or too small.

Loads deform the surface before the probe touches it. The depth counts from the first touch of the deformed surface,
along the axis.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from math import nan

import numpy as np

from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.contact.active_set import ContactError, Obstacle, SettledContact, find_set
from epsmesh.solve.contact.checks import check_edge
from epsmesh.solve.contact.condensed import CondensedElements, suits
from epsmesh.solve.contact.elements import ContactElements, FarShare, FreeResponse
from epsmesh.solve.contact.found import LinearContact
from epsmesh.solve.contact.frictional import rub
from epsmesh.solve.contact.geometry import Touch
from epsmesh.solve.contact.in_time import ToolIndentation
from epsmesh.solve.contact.large import LargeContact
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.sweep import Sweep
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.elements.base import Elements, Equilibrium
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.solution import Request
from epsmesh.solve.spaces import Spaces
from epsmesh.stages import recharge, recorded, stage

# Energy norm of the error for all active sets but the last one, relative to that of the solution.
_LOOSE = 1e-3
# Factor on the tolerance of a prescribed displacement: here F is linear in the solver's error.
_STRICTER = 0.01
# Largest λ/μ for the first active set (ν = 0.3), so that elements of degree 1 do not lock.
_FIRST_RATIO = 1.5
# The first active set are the nodes that the undeformed surface would have so deep in the tool, in units of the depth:
# on a half-space those of a ball are 1/2 deep at the edge of contact, those of a cone 0.36.
_FIRST_DEPTH = 0.5


class ContactSearch:
    """Finds the contact of a tool for any material and depth; ``contact`` is the last one found, or None."""

    def __init__(self, spaces: Spaces, elements: Elements, tool: Tool, *, reuse: bool = False, condense: bool = False):
        """Prepare; collective.

        With ``reuse``, earlier depths of the same material give the initial guess. ``condense`` says that many depths
        of each material follow: the surface of a small body is then condensed for them, and they share error bars.
        """
        self._elements, self._tool = elements, tool
        self._surface, self._touch = Surface(spaces, elements.displacements.conditions), Touch(tool.height, tool.first)
        self.candidates: Candidates = self._surface.of(elements.degree)
        self.contact: LinearContact | None = None
        self._reuse, self._condense = reuse or condense, condense
        self._sweep: Sweep | None = None  # kept from depth to depth of one material
        self._large: LargeContact | None = None

    def close(self) -> None:
        """Free what is kept between solves."""
        self.contact = self._large = None
        if self._sweep is not None:
            self._sweep.close()
            self._sweep = None

    @stage("solve")
    def solve(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Find contact and force at the depth of the movement; the ``stack`` frees what is made; collective.

        Raises:
            SolveError: if a linear solver fails, or the solution fails a check.
            ContactError: if the contact does not settle, reaches the support, or reaches the candidates' edge where
                the probe does not end.
        """
        is_bent = asked.movement.loads is not None and self._tool.friction > 0
        is_large = not asked.law.is_linear or self._tool.normal is not None or self._tool.beds
        # Two jaws with friction have one path, on half of the body and on the whole.
        is_bent |= self._elements.body.is_halved and self._tool.friction > 0
        space = self._elements.displacements
        if is_large or space.terms or space.conditions.deforms or is_bent:
            return self._solve_large(asked, stack)
        law, movement, strict = asked.law, asked.movement, _STRICTER * asked.tolerance
        columns = self._elements.columns(movement, stack)
        sweep = self._sweep_of(law, asked.method, stack)
        elements, depth = sweep.elements, movement.amounts[0]
        self._couple(elements, movement, columns, law.lame_mu[0], strict)
        loaded = None if movement.loads is None else elements.free_response(columns[-1], strict)
        obstacle = self._obstacle(self.candidates, depth, loaded)
        if np.any(obstacle.bounds[elements.is_fixed] < 0):
            raise ContactError("the probe reaches the fixed part of the body: no displacement satisfies both")
        first, found = self._find(sweep, obstacle, (_LOOSE, strict), loaded)
        check_edge(self._tool.ends_at, self.candidates, found.active)
        unknowns = elements.unknowns()
        iterations = first + found.touched.iterations
        contact = LinearContact(
            sweep=sweep,
            tool=self._tool,
            obstacle=obstacle,
            smooth=found,
            unknowns=unknowns,
            loaded=loaded,
            obstacle_above=lambda: self._obstacle(self._surface.of(self._elements.degree + 1), depth, loaded),
            far=None if elements.far is None else columns.pop(1),
            smooth_share=0.0 if elements.far is None else elements.far.share,
        )
        if self._tool.friction:
            contact = rub(contact)
            assert contact.rubbed is not None
            iterations += contact.rubbed.fine.iterations
        self.contact = contact
        contact.put(columns[0])
        if elements.far is not None:
            movement = movement.closed(contact.far_share)
        response = contact.response(columns[0], movement)
        check_balance(response.balance)
        if self._reuse:
            sweep.keep(depth, found, unknowns)
        sag = nan if loaded is None else self._touch.sag(self.candidates, loaded.moved)
        return Equilibrium(contact, columns, movement, iterations, response, contact=contact.summary(sag))

    def _solve_large(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Find contact at large displacements: see :class:`LargeContact`."""
        if self._large is None or not (self._reuse and self._large.can_reach(asked)):
            self._large = LargeContact(self._surface, self._elements, self._tool, asked)
        return self._large.solve(asked, stack)

    def in_time(self, asked: Request, found: Equilibrium, stack: ExitStack) -> ToolIndentation:
        """Return the tissue that the tool presses in time steps; the ``stack`` frees it; collective."""
        (depth, *_), loads = found.movement.amounts, found.movement.loads
        return ToolIndentation(self._surface, self._elements, self._tool, asked.law, depth, loads, stack)

    # ---- far field ------------------------------------------------------------------------------------

    def _couple(
        self, elements: ContactElements, movement: Movement, columns: Sequence[Column], mu: float, tolerance: float
    ) -> None:
        """Couple the far field of ``movement``, if there is one, to the cut face; collective."""
        if movement.far is None:
            elements.couple(None)
            return
        far = columns[1]
        if elements.far is None or elements.far.field != movement.far:
            unit = elements.free_response(far, tolerance)
            beyond = movement.far.stiffness(mu) / 2.0 ** len(self._elements.body.mirrored)
            elements.couple(FarShare(movement.far, unit, beyond))
        else:
            self._elements.put(far, elements.far.unit.unknowns)

    # ---- contact --------------------------------------------------------------------------------------

    def _obstacle(self, candidates: Candidates, depth: float, loaded: FreeResponse | None) -> Obstacle:
        """Return the obstacle above candidates of some degree at a ``depth`` (m), without the far field."""
        return Obstacle(candidates, self._touch.heights(candidates, loaded, self.candidates) - depth, depth)

    def _find(
        self, sweep: Sweep, obstacle: Obstacle, tolerances: tuple[float, float], loaded: FreeResponse | None
    ) -> tuple[int, SettledContact]:
        """Return the number of active sets solved in lower degrees, and the contact found; collective."""
        try:
            found = sweep.find(obstacle, tolerances)
            if found is not None:
                return 0, found
        except SolveError:  # then without the initial guess
            if sweep.elements.is_exact:
                raise
        with ExitStack() as stack:
            first, elements, before = self._first_set(sweep, obstacle.depth, loaded, stack)
            sweep.elements.start_from(elements)
            active = elements.candidates.raised_by(before.active, self.candidates, obstacle.bounds)
        return first, find_set(sweep.elements, obstacle, active, tolerances, before.state.energy, is_guess=True)

    def _first_set(
        self, sweep: Sweep, depth: float, loaded: FreeResponse | None, stack: ExitStack
    ) -> tuple[int, ContactElements, SettledContact]:
        """Return the sets solved, the elements of one degree less, and the contact found on them; collective."""
        sets, found = 0, None
        elements: ContactElements | None = None
        for degree in range(1, self._elements.degree):
            kind = self._elements.element if degree > 1 else "displacement"
            law = sweep.law if kind == "mixed" else sweep.law.softened(_FIRST_RATIO)
            plain = self._surface.elements(degree, kind, stack)
            lower = ContactElements(plain, self._surface, law, sweep.method, stack)
            obstacle = self._obstacle(lower.candidates, depth, loaded)
            if elements is None or found is None:
                reached = obstacle.bounds < 0
                if not reached.any():
                    raise ContactError("the probe reaches no corner of an element: use smaller elements below it")
                deep = obstacle.bounds < -_FIRST_DEPTH * depth
                active = deep if deep.any() else reached
            else:
                lower.start_from(elements)
                active = elements.candidates.raised_by(found.active, lower.candidates, obstacle.bounds)
            energy = None if found is None else found.state.energy
            found = find_set(lower, obstacle, active, (_LOOSE,), energy, roughly=True, is_guess=True)
            lower.show()
            elements, sets = lower, sets + found.touched.iterations
        assert elements is not None
        assert found is not None
        return sets, elements, found

    def _sweep_of(self, law: MaterialLaw, method: str, stack: ExitStack) -> Sweep:
        """Return the sweep kept for a material, or a new one; the ``stack`` frees it unless it is to be kept.

        The surface is condensed if that was requested; collective.
        """
        if self._sweep is not None and (self._sweep.law, self._sweep.method) == (law, method):
            recharge(self._sweep.cost)
            return self._sweep
        self.close()
        with ExitStack() as inner, recorded() as cost:
            if self._condense and suits(self._elements, self.candidates, method):
                elements: ContactElements = CondensedElements(self._elements, self._surface, law, "direct", inner)
            else:
                elements = ContactElements(self._elements, self._surface, law, method, inner)
            sweep = Sweep(law, method, elements, inner.pop_all(), cost)
        if self._reuse:
            self._sweep = sweep
        else:
            stack.callback(sweep.close)
        return sweep
