"""Results of a contact: the force, the area, and the error bar from elements of one degree more.

For the error bar the contact area is fixed: a facet whose nodes, corners aside, are all active keeps its displacement
along the axis. The force of that problem is wrong, because the area is. The share of the energy that the next degree
removes estimates the error of F. F is no bound, so the bar applies to both sides.

If such facets cover too little of the area, elements are as large as the contact. The contact is then solved again in
the next degree, and the bar follows from the change of the force.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import nan

import numpy as np

from epsmesh.arrays import BoolArray, Int32Array
from epsmesh.solve.cell_values import plain_share
from epsmesh.solve.compiled import global_sum, vector
from epsmesh.solve.contact.active_set import Obstacle, SettledContact, find_set
from epsmesh.solve.contact.elements import ContactElements, FreeResponse, SurfaceState
from epsmesh.solve.contact.geometry import Area, contact_area
from epsmesh.solve.contact.levels import HeldOperator, normal_dofs
from epsmesh.solve.contact.sweep import Sweep
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.elements.mixed import MixedSolver
from epsmesh.solve.estimate import error_bar, found_again_bar, found_bar
from epsmesh.solve.hierarchical_estimate import energy_decrements
from epsmesh.solve.linear_solver import LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.response import Response, reaction

# Bounds that differ by at most this share of the depth are equal.
_SAME = 1e-9
# Contact is solved again for the bar where fully active facets cover less than this share of its area.
_COVERED = 0.3
# Relative energy norm of the error of the next degree's solution, for the error bar.
_ESTIMATE_TOLERANCE = 0.1
# Tolerances for contact that is solved again in the next degree: loose first.
_AGAIN = (1e-3, 1e-5)


@dataclass(frozen=True, eq=False)
class FoundContact:
    """Contact ``found`` by the elements of a ``sweep`` with an ``obstacle``; methods are collective.

    ``loaded`` is the response to loads before contact, or None. ``obstacle_above`` is the obstacle of the next degree.
    """

    sweep: Sweep
    obstacle: Obstacle
    found: SettledContact
    loaded: FreeResponse | None
    obstacle_above: Callable[[], Obstacle]

    @property
    def _plug(self) -> Elements:
        return self.sweep.elements.plug

    @property
    def stored(self) -> float | None:
        """The energy (J) of the modelled part; None where a whole face touches and moves by the depth.

        The contact area is then known, and the energy is half the work of the force.
        """
        is_flat = np.ptp(self.obstacle.bounds) <= _SAME * self.obstacle.depth
        return None if self.found.active.all() and is_flat else self.found.state.energy / 2

    @property
    def force(self) -> float:
        """The force (N) on the modelled part of the tool."""
        return _force(self.found)

    def summary(self, sag: float) -> ContactResult:
        """Return the area of the whole contact, and the effect of loads; ``sag`` (m) is that of the first touch."""
        whole = 2.0 ** len(self._plug.body.mirrored)
        energy = nan if self.loaded is None else whole * self.loaded.energy / 2
        return ContactResult(whole * self._area().value, sag=sag, load_energy=energy, is_ended=self._is_ended)

    @property
    def _is_ended(self) -> bool:
        """Whether the contact of this rank reaches the tool's own edge."""
        return bool((self.found.active & self.obstacle.candidates.is_edge).any())

    def response(self, column: Column, movement: Movement) -> Response:
        """Return the force at this depth as a stiffness, F/d; its balance is the largest of all checks."""
        space, state, (depth,) = self._plug.displacements, self.found.state, movement.amounts
        (residual,) = self._plug.products(self.sweep.law, [column]).residuals
        local = depth * residual.reshape(-1, 3)[space.fixed_owned, 2].sum()
        support = float(global_sum(space.comm, np.array([local]))[0])
        work = float(state.reactions[self.found.active] @ state.moved[self.found.active])
        balance = max(abs(support / self.force - 1), abs(work / state.energy - 1))
        per_depth = self.force / depth
        on_probe = np.array([[0.0, 0.0, -per_depth]])
        return reaction(movement, np.array([[per_depth]]), on_probe, self._plug.body.mirrored, balance)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the change of the force in one degree more, and its error bar.

        Each depth has its own bar where loads act, or where the surface is not condensed.
        """
        sweep, depth, at_edge = self.sweep, self.obstacle.depth, self._area().bar
        known = sweep.bar(depth, movement.far) if self.loaded is None else None
        if known is None:
            self._plug.show(columns[:1])
            taken, share = self._estimated(at_edge)
            if self.loaded is None:
                sweep.keep_bar(depth, taken, share, movement.far)
        else:
            taken, share = known
        return HierarchicalEstimate(
            self._plug,
            [],
            decrements=np.array([[taken * self.force / depth]]),
            relative=np.array([share]),
            area_bar=at_edge + share,
            at_edge=at_edge,
        )

    def _estimated(self, area_bar: float) -> tuple[float, float]:
        """Return the share of the energy that one degree more removes, and the share for the bar."""
        candidates, found, elements = self.obstacle.candidates, self.found, self.sweep.elements
        touching = float(candidates.weights[found.active].sum())
        covered = float(candidates.areas[candidates.closed(found.active)].sum())
        if covered < _COVERED * touching:
            return found_again_bar(_found_again(elements, self.obstacle_above(), found), area_bar)
        taken, unseen = _decrement(elements, candidates.held_facets(found.active))
        share, unseen = taken / found.state.energy, unseen / found.state.energy
        if self._is_ended:  # the probe ends there, and the pressure is singular
            degree, element, plain = self._plug.degree, self._plug.element, plain_share(self._plug.body)
            return share, error_bar(share, degree, element, plain=plain, unseen=unseen)
        return share, found_bar(share, unseen, area_bar)

    def _area(self) -> Area:
        """Return the contact area of the modelled part."""
        active, state = self._touching()
        modulus = self.obstacle.candidates.from_regions(self.sweep.law.plane_moduli)
        return contact_area(self.obstacle, active, state, modulus, self._plug.body.mirrored)

    def _touching(self) -> tuple[BoolArray, SurfaceState]:
        """Return the active set, displacements and reactions of the contact."""
        return self.found.active, self.found.state


def _force(found: SettledContact) -> float:
    return float(-found.state.reactions[found.active].sum())


def _decrement(elements: ContactElements, facets: Int32Array) -> tuple[float, float]:
    """Return how much one degree more lowers twice the energy (J) of the modelled part, and N (J).

    N is the energy norm squared of the first correction of mixed elements, zero for others. Collective. The local
    ``facets`` are fixed; the fields are those of the forms of ``elements``.

    Raises:
        SolveError: if the solver does not converge.
    """
    if elements.plug.element == "mixed":
        return _mixed_decrement(elements, facets)
    return _displacement_decrement(elements, facets), 0.0


def _displacement_decrement(elements: ContactElements, facets: Int32Array) -> float:
    finer, law = elements.surface.space(elements.space.degree + 1), elements.law
    with ExitStack() as stack, vector(finer.space) as residual:
        levels = elements.held_levels(facets, stack)
        operator = HeldOperator(finer, law, stack, direct=False, masked=True)
        levels.append(operator.hold(normal_dofs(finer, facets)))
        solver = LinearSolver(levels, direct=False)
        stack.callback(solver.close)
        finer.residual_of(elements.space, law, residual)
        held = levels[-1].prescribed
        residual.array[held[held < finer.owned]] = 0.0
        decrements, *_ = energy_decrements(solver, [residual])
    return float(decrements[0, 0])


def _mixed_decrement(elements: ContactElements, facets: Int32Array) -> tuple[float, float]:
    elements.close()
    with ExitStack() as stack:
        finer = elements.finer(stack)
        finer.hold_facets(facets)
        before = finer.energy()
        finer.approach(np.zeros(len(finer.candidates)), _ESTIMATE_TOLERANCE, None)  # fixed nodes stay
        assert isinstance(finer.solver, MixedSolver)
        return before - finer.energy(), float(finer.solver.first_energies[0])


def _found_again(elements: ContactElements, obstacle: Obstacle, found: SettledContact) -> float:
    """Solve contact again in one degree more: return the share of the force that it removes; collective.

    ``obstacle`` is the obstacle of that degree, without the far field.

    Raises:
        SolveError: if the solver does not converge.
        ContactError: if the contact does not settle.
    """
    elements.close()
    with ExitStack() as stack:
        finer = elements.finer(stack)
        active = elements.candidates.raised(found.active, finer.candidates)
        again = find_set(finer, obstacle, active, _AGAIN, found.state.energy)
    return 1 - _force(again) / _force(found)
