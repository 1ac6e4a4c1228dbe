"""Found contact: where a probe touches, without friction, tension or penetration.

The active set is found on elements of degree 1 first, which costs little, then on those of higher degrees. F is the sum
of the reactions K u on its nodes. It is no bound: a coarse contact area may be too large or too small.

Loads bend the surface before the probe touches it: the depth counts from the first touch of that surface, along the
axis.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import nan

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve import SolveError
from pipeline.solve.balance import check_balance
from pipeline.solve.contact.active_set import ContactError, Found, Obstacle, find_set
from pipeline.solve.contact.condensed import CondensedElements, suits
from pipeline.solve.contact.elements import ContactElements, FarShare, FreeResponse
from pipeline.solve.contact.found import FoundContact
from pipeline.solve.contact.geometry import Touch
from pipeline.solve.contact.levels import Numbering, Surface
from pipeline.solve.contact.surface import Candidates
from pipeline.solve.contact.sweep import Sweep
from pipeline.solve.elements.base import Column, Elements, Equilibrium, close_far
from pipeline.solve.movement import Movement
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.solution import Request
from pipeline.solve.spaces import Spaces
from pipeline.stages import recharge, recorded, stage

# Energy norm of the error to which each set but the last one is solved, relative to that of the solution.
_LOOSE = 1e-3
# Stricter than what serves a prescribed displacement: F is linear in the solver's error here.
_STRICTER = 0.01
# The first set is looked for in a material that elements of degree 1 do not lock in: λ/μ at most (ν = 0.3).
_FIRST_RATIO = 1.5


@dataclass(frozen=True)
class Tool:
    """A probe's surface, to be pushed in along -z.

    ``height`` gives, at points (n, 3) of the undeformed surface (m), how far above each the probe's surface is before
    it moves, infinite where there is no probe. ``ends_at`` tells of points (n, 3) on the candidates' edge whether the
    probe itself ends there: elsewhere contact must not reach that edge. ``first`` (m) is the least height, none where
    it touches on its axis first.
    """

    height: Callable[[FloatArray], FloatArray]
    ends_at: Callable[[FloatArray], BoolArray]
    first: float = 0.0


class ContactSearch:
    """Finds what touches of a tool, for any material and depth; ``contact`` is what was found last, None before."""

    def __init__(self, spaces: Spaces, elements: Elements, tool: Tool, *, reuse: bool = False, condense: bool = False):
        """Prepare; collective.

        With ``reuse``, a depth begins with what is known of others of the same material. ``condense`` says that many
        depths of each material are to come: where the body is small, its surface is condensed for them, and they share
        error bars.
        """
        self._elements, self._tool = elements, tool
        self._surface, self._touch = Surface(spaces), Touch(tool.height, tool.first)
        self.candidates: Candidates = self._surface.of(elements.degree)
        self._supported = self._held_by_support()
        self.contact: FoundContact | None = None
        self._reuse, self._condense = reuse or condense, condense
        self._sweep: Sweep | None = None  # what is kept of a material

    def close(self) -> None:
        """Free what is kept from solve to solve."""
        self.contact = None
        if self._sweep is not None:
            self._sweep.close()
            self._sweep = None

    @stage("solve")
    def solve(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Find the contact at the depth of the movement, and the force; collective. The ``stack`` frees what is made.

        Raises:
            SolveError: if a linear solver fails, or the solution a check.
            ContactError: if the contact does not settle, reaches the candidates' edge where the probe does not end, or
                what is held of the body.
        """
        law, movement, strict = asked.law, asked.movement, _STRICTER * asked.tolerance
        columns = self._elements.columns(movement, stack)
        sweep = self._sweep_of(law, asked.method, stack)
        elements, depth = sweep.elements, movement.amounts[0]
        self._couple(elements, movement, columns, law.lame_mu[0], strict)
        loaded = None if movement.loads is None else elements.free_response(columns[-1], strict)
        obstacle = self._obstacle(self.candidates, depth, loaded)
        if np.any(obstacle.bounds[self._supported] < 0):
            raise ContactError("the probe runs into what is held of the body: no displacement satisfies both")
        first, found = self._find(sweep, obstacle, (_LOOSE, strict), loaded)
        self._check_edge(found.active)
        unknowns = elements.unknowns()
        self._elements.put(columns[0], unknowns, depth)
        if elements.far is not None:
            movement = close_far(columns, movement, elements.far.share / depth)
        self.contact = contact = FoundContact(
            sweep=sweep,
            obstacle=obstacle,
            found=found,
            loaded=loaded,
            obstacle_above=lambda: self._obstacle(self._surface.of(self._elements.degree + 1), depth, loaded),
        )
        response = contact.response(columns[0], movement)
        check_balance(response.balance)
        if self._reuse:
            sweep.keep(depth, found, unknowns)
        sag = nan if loaded is None else self._touch.sag(self.candidates, loaded)
        iterations = first + found.sets
        return Equilibrium(contact, columns, movement, iterations, response, contact=contact.summary(sag))

    # ---- what acts besides the probe ------------------------------------------------------------------

    def _couple(
        self, elements: ContactElements, movement: Movement, columns: Sequence[Column], mu: float, tolerance: float
    ) -> None:
        """Let the far field of ``movement``, if there is one, act on the cut face; collective."""
        if movement.far is None:
            elements.couple(None)
            return
        far = columns[1]
        if elements.far is None or elements.far.field != movement.far:
            unit = elements.free_response(far, tolerance)
            beyond = movement.far.stiffness(mu) / 2.0 ** len(self._elements.body.mirrored)
            elements.couple(FarShare(movement.far, unit, unit.energy + beyond))
        else:
            self._elements.put(far, elements.far.unit.unknowns)

    # ---- contact --------------------------------------------------------------------------------------

    def _obstacle(self, candidates: Candidates, depth: float, loaded: FreeResponse | None) -> Obstacle:
        """Return what is in the way of candidates of some degree at a ``depth`` (m), far field aside."""
        return Obstacle(candidates, self._touch.heights(candidates, loaded, self.candidates) - depth, depth)

    def _find(
        self, sweep: Sweep, obstacle: Obstacle, tolerances: tuple[float, float], loaded: FreeResponse | None
    ) -> tuple[int, Found]:
        """Return how many sets of lower degrees were solved, and what was found; collective."""
        try:
            found = sweep.find(obstacle, tolerances)
            if found is not None:
                return 0, found
        except SolveError:  # afresh, then
            if sweep.elements.is_exact:
                raise
        with ExitStack() as stack:
            first, elements, before = self._first_set(sweep, obstacle.depth, loaded, stack)
            sweep.elements.start_from(elements)
            active = elements.candidates.raised(before.active, self.candidates)
        return first, find_set(sweep.elements, obstacle, active, tolerances, before.state.energy)

    def _first_set(
        self, sweep: Sweep, depth: float, loaded: FreeResponse | None, stack: ExitStack
    ) -> tuple[int, ContactElements, Found]:
        """Return sets solved, the elements of one degree less, and what was found on them; collective."""
        sets, found = 0, None
        elements: ContactElements | None = None
        for degree in range(1, self._elements.degree):
            kind = self._elements.element if degree > 1 else "displacement"
            law = sweep.law if kind == "mixed" else sweep.law.softened(_FIRST_RATIO)
            plain = self._surface.elements(degree, kind, stack)
            lower = ContactElements(plain, self._surface, law, sweep.method, stack)
            obstacle = self._obstacle(lower.candidates, depth, loaded)
            if elements is None or found is None:
                active = obstacle.bounds < 0
                if not active.any():
                    raise ContactError("the probe reaches no corner of an element: use smaller elements below it")
            else:
                lower.start_from(elements)
                active = elements.candidates.raised(found.active, lower.candidates)
            energy = None if found is None else found.state.energy
            found = find_set(lower, obstacle, active, (_LOOSE,), energy, roughly=True)
            lower.show()
            elements, sets = lower, sets + found.sets
        assert elements is not None
        assert found is not None
        return sets, elements, found

    def _sweep_of(self, law: MaterialLaw, method: str, stack: ExitStack) -> Sweep:
        """Return what is kept of a material, or new elements, which are freed with the ``stack`` if not to be kept.

        Where the surface is to be condensed, it is; collective.
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

    def _held_by_support(self) -> BoolArray:
        """Tell which candidates (n) are held by the support; collective. Of them none is ever found to touch."""
        space = self._elements.displacements
        is_held = np.zeros(space.owned)
        is_held[3 * space.fixed_owned + 2] = 1.0
        return np.asarray(Numbering(space.space, self.candidates.numbers).gather(is_held) > 0)

    def _check_edge(self, active: BoolArray) -> None:
        points = self.candidates.points[active & self.candidates.is_edge]
        if not np.all(self._tool.ends_at(points)):
            raise ContactError(
                "the contact reaches the edge of the part of the surface where it is looked for: "
                "press the probe in less far, or set it up straighter"
            )
