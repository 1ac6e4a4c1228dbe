"""Found contact: where a probe touches, without friction, tension or penetration.

The active set is found on elements of degree 1 first, which costs little, then on those of higher degrees. F is the sum
of the reactions K u on its nodes. It is no bound: a coarse contact area may be too large or too small.

Loads bend the surface before the probe touches it: the depth counts from the first touch of that surface, along the
axis.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve import SolveError
from pipeline.solve.balance import check_balance
from pipeline.solve.cell_values import plain_share
from pipeline.solve.compiled import global_sum
from pipeline.solve.contact.active_set import ContactError, Found, Obstacle, find_set
from pipeline.solve.contact.condensed import CondensedElements, suits
from pipeline.solve.contact.elements import ContactElements, FarShare, FreeResponse
from pipeline.solve.contact.error import decrement, found_again
from pipeline.solve.contact.geometry import Area, Touch, contact_area
from pipeline.solve.contact.levels import Numbering, Surface
from pipeline.solve.contact.surface import Candidates
from pipeline.solve.contact.sweep import Sweep
from pipeline.solve.elements.base import Column, Elements, Enriched, Equilibrium, close_far
from pipeline.solve.estimate import error_bar, found_again_bar, found_bar
from pipeline.solve.movement import Movement
from pipeline.solve.physics import MaterialLaw, of_regions
from pipeline.solve.response import Contact, Response, reaction
from pipeline.solve.solution import Request
from pipeline.solve.spaces import Spaces
from pipeline.stages import recharge, recorded, stage

# Energy norm of the error to which each set but the last one is solved, relative to that of the solution.
_LOOSE = 1e-3
# Stricter than what serves a prescribed displacement: F is linear in the solver's error here.
_STRICTER = 0.01
# Bounds that differ by no more than this share of the depth are the same.
_SAME = 1e-9
# The first set is looked for in a material that elements of degree 1 do not lock in: λ/μ at most (ν = 0.3).
_FIRST_RATIO = 1.5
# Where facets with all nodes in contact cover less than this share of its area, contact is found again for the bar.
_COVERED = 0.3


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
    """Finds what touches of a tool, for any material and depth.

    ``obstacle`` is what was in the way last, ``found`` what was found of it, None before. ``stored`` is the energy (J)
    of the modelled part then, None where the tool moved all of a face.
    """

    def __init__(self, spaces: Spaces, elements: Elements, tool: Tool, *, reuse: bool = False, condense: bool = False):
        """Prepare; collective.

        With ``reuse``, a depth begins with what is known of others of the same material. ``condense`` says that many
        depths of each material are to come: where the body is small, its surface is condensed for them, and they share
        error bars.

        """
        self._elements, self._tool, self._body = elements, tool, spaces.body
        self._surface, self._touch = Surface(spaces), Touch(tool.height, tool.first)
        self.candidates: Candidates = self._surface.of(elements.degree)
        self._supported = self._held_by_support()
        self.obstacle: Obstacle | None = None
        self.found: Found | None = None
        self._reuse, self._condense = reuse or condense, condense
        self._sweep: Sweep | None = None  # what is kept of a material
        self._last: tuple[Sweep, FreeResponse | None] | None = None  # what the last contact was found with
        self.stored: float | None = None

    def close(self) -> None:
        """Free what is kept from solve to solve."""
        self._last = None
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
        elements = sweep.elements
        self._couple(elements, movement, columns, law.lame_mu[0], strict)
        loaded = None if movement.loads is None else elements.free_response(columns[-1], strict)
        depth = movement.amounts[0]
        heights = self._touch.heights(self.candidates, loaded)
        self.obstacle = Obstacle(self.candidates, heights - depth, depth)
        if np.any(self.obstacle.bounds[self._supported] < 0):
            raise ContactError("the probe runs into what is held of the body: no displacement satisfies both")
        first, found = self._find(sweep, (_LOOSE, strict), loaded)
        self._check_edge(found.active)
        self.found, self._last = found, (sweep, loaded)
        unknowns = elements.unknowns()
        self._elements.put(columns[0], unknowns, depth)
        if elements.far is not None:
            movement = close_far(columns, movement, elements.far.share / depth)
        response = self._response(columns[0], found, law, movement)
        check_balance(response.balance)
        if self._reuse:
            sweep.keep(depth, found, unknowns)
        self.stored = None if self._is_as_prescribed(found) else found.state.energy / 2
        area = self._area_of(found, law).value
        contact = Contact(self._whole * area)
        if loaded is not None:
            sag = self._touch.sag(self.candidates, loaded)
            contact = replace(contact, sag=sag, load_energy=self._whole * loaded.energy / 2)
        return Equilibrium(self, columns, movement, first + found.sets, response, contact=contact)

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
            beyond = movement.far.stiffness(mu) / self._whole
            elements.couple(FarShare(movement.far, unit, unit.energy + beyond))
        else:
            self._elements.put(far, elements.far.unit.unknowns)

    # ---- contact --------------------------------------------------------------------------------------

    def _find(self, sweep: Sweep, tolerances: tuple[float, float], loaded: FreeResponse | None) -> tuple[int, Found]:
        """Return how many sets of lower degrees were solved, and what was found; collective."""
        assert self.obstacle is not None
        try:
            found = sweep.find(self.obstacle, tolerances)
            if found is not None:
                return 0, found
        except SolveError:  # afresh, then
            if sweep.elements.is_exact:
                raise
        with ExitStack() as stack:
            first, elements, before = self._first_set(sweep, loaded, stack)
            sweep.elements.start_from(elements)
            active = elements.candidates.raised(before.active, self.candidates)
        return first, find_set(sweep.elements, self.obstacle, active, tolerances, before.state.energy)

    def _first_set(
        self, sweep: Sweep, loaded: FreeResponse | None, stack: ExitStack
    ) -> tuple[int, ContactElements, Found]:
        """Return sets solved, the elements of one degree less, and what was found on them; collective."""
        sets, found = 0, None
        elements: ContactElements | None = None
        for degree in range(1, self._elements.degree):
            kind = self._elements.element if degree > 1 else "displacement"
            law = sweep.law if kind == "mixed" else sweep.law.softened(_FIRST_RATIO)
            plain = self._surface.elements(degree, kind, stack)
            lower = ContactElements(plain, self._surface, law, sweep.method, stack)
            obstacle = self._obstacle_of(lower.candidates, loaded)
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

    def _obstacle_of(self, candidates: Candidates, loaded: FreeResponse | None) -> Obstacle:
        """Return what is in the way of candidates of another degree, far field aside."""
        assert self.obstacle is not None
        heights = self._touch.heights(candidates, loaded, self.candidates)
        return Obstacle(candidates, heights - self.obstacle.depth, self.obstacle.depth)

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

    # ---- error bar ------------------------------------------------------------------------------------

    def enrich(self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool) -> Enriched:
        """Return what one degree more makes of the force that was found last, and its bar; collective.

        Where loads act each depth has its own, as it has where the surface is not condensed.
        """
        assert self.obstacle is not None
        assert self.found is not None
        assert self._last is not None
        (sweep, loaded), depth, iterations = self._last, self.obstacle.depth, 0
        at_edge = self._area_of(self.found, sweep.law).bar
        known = sweep.bar(depth, movement.far) if loaded is None else None
        if known is None:
            self._elements.show(columns[:1])
            taken, share, iterations = self._estimated(sweep, loaded, at_edge)
            if loaded is None:
                sweep.keep_bar(depth, taken, share, movement.far)
        else:
            taken, share = known
        decrements = np.array([[taken * self._force / depth]])
        return Enriched(
            self._elements, [], iterations, decrements=decrements, relative=np.array([share]), area_bar=at_edge + share
        )

    def _estimated(self, sweep: Sweep, loaded: FreeResponse | None, area_bar: float) -> tuple[float, float, int]:
        """Return the share of the energy that one degree more takes away, that of the bar, and the iterations."""
        assert self.found is not None
        candidates, found, elements = self.candidates, self.found, sweep.elements
        touching = float(candidates.weights[found.active].sum())
        covered = float(candidates.areas[candidates.closed(found.active)].sum())
        if covered < _COVERED * touching:
            finer = self._obstacle_of(self._surface.of(self._elements.degree + 1), loaded)
            share, more = found_again(elements, finer, found)
            return *found_again_bar(share, area_bar), more
        taken, unseen, more = decrement(elements, candidates.held_facets(found.active))
        share, unseen = taken / found.state.energy, unseen / found.state.energy
        if (found.active & candidates.is_edge).any():  # the probe ends there, and the pressure is singular
            degree, element = self._elements.degree, self._elements.element
            return share, error_bar(share, degree, element, plain=plain_share(self._body), unseen=unseen), more
        return share, found_bar(share, unseen, area_bar), more

    # ---- the force ------------------------------------------------------------------------------------

    @property
    def _whole(self) -> float:
        """How many times what is modelled makes the body."""
        return 2.0 ** len(self._body.mirrored)

    @property
    def _force(self) -> float:
        """The force (N) on the part of the tool that is modelled."""
        assert self.found is not None
        return float(-self.found.state.reactions[self.found.active].sum())

    def _is_as_prescribed(self, found: Found) -> bool:
        """Tell whether all of a face touches and moves by the depth: the area of contact was no question."""
        assert self.obstacle is not None
        return bool(found.active.all() and np.ptp(self.obstacle.bounds) <= _SAME * self.obstacle.depth)

    def _area_of(self, found: Found, law: MaterialLaw) -> Area:
        """Return the area of contact of the part that is modelled."""
        assert self.obstacle is not None
        return contact_area(self.obstacle, found.active, found.state, self._modulus(law), self._body.mirrored)

    def _modulus(self, law: MaterialLaw) -> FloatArray:
        """Return E / (1 - ν²) (Pa) of the tissue below each candidate (n)."""
        of_facets = of_regions(law.values("plane_modulus"), self.candidates.regions, len(self.candidates.facets))
        found = np.empty(len(self.candidates))
        found[self.candidates.facets] = of_facets[:, None]
        return found

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

    def _response(self, column: Column, found: Found, law: MaterialLaw, movement: Movement) -> Response:
        """Return the force for the depth, as if it were proportional to it; its balance is that of all checks."""
        space, state, (depth,) = self._elements.displacements, found.state, movement.amounts
        force = self._force
        (residual,) = self._elements.products(law, [column]).residuals
        local = depth * residual.reshape(-1, 3)[space.fixed_owned, 2].sum()
        support = float(global_sum(space.comm, np.array([local]))[0])
        work = float(state.reactions[found.active] @ state.moved[found.active])
        balance = max(abs(support / force - 1), abs(work / state.energy - 1))
        per_depth = force / depth
        return reaction(
            movement, np.array([[per_depth]]), np.array([[0.0, 0.0, -per_depth]]), self._body.mirrored, balance
        )
