"""Contact of a tool with a linear body, with friction or without: response, energy and error bar.

The error bar is that of contact without friction, plus that of friction. Where the area is fixed for it, a facet whose
nodes, corners aside, are all active keeps its displacement along the axis. The force of that problem is wrong, because
the area is. The share of the energy that the next degree removes estimates the error of F. F is no bound, so the bar
applies to both sides.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve.cell_values import plain_share
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.active_set import Obstacle, SettledContact
from epsmesh.solve.contact.elements import FreeResponse, Unknowns
from epsmesh.solve.contact.estimators import area_fixed, estimate_of, found_again, half_the_steps
from epsmesh.solve.contact.surface_contact import SurfaceContact
from epsmesh.solve.contact.sweep import Sweep
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate, Rate
from epsmesh.solve.elements.fields import Column, add_far
from epsmesh.solve.estimate import error_bar, found_again_bar, found_bar
from epsmesh.solve.movement import Movement
from epsmesh.solve.response import Response, reaction

# Bounds that differ by at most this share of the depth are equal.
_SAME = 1e-9
# Energy norm of the error of the rate by the depth, relative to that of the solution.
_RATE = 1e-8


@dataclass(frozen=True, eq=False)
class Rubbed:
    """Contact with friction on all candidates: ``fine``, which ``moved`` them (n, 3), m, and its ``unknowns``.

    ``coarse`` is that from half as many load steps, ``far_share`` the amplitude of the far field.
    """

    fine: ContactSolution
    coarse: ContactSolution
    moved: FloatArray
    unknowns: Unknowns
    far_share: float


@dataclass(frozen=True, eq=False)
class LinearContact:
    """Contact of a ``tool``, above as an ``obstacle``, with the elements of a ``sweep``; methods are collective.

    ``smooth`` is that without friction, with the ``unknowns`` of the elements, ``rubbed`` that with friction, or None.
    ``loaded`` is the response to loads before contact, or None. ``obstacle_above`` is the obstacle of the next degree.
    ``far`` is the column of the far field, or None, and ``smooth_share`` its amplitude without friction.
    """

    sweep: Sweep
    tool: Tool
    obstacle: Obstacle
    smooth: SettledContact
    unknowns: Unknowns
    loaded: FreeResponse | None
    obstacle_above: Callable[[], Obstacle]
    far: Column | None = None
    smooth_share: float = 0.0
    rubbed: Rubbed | None = None

    @property
    def _plug(self) -> Elements:
        return self.sweep.elements.plug

    @cached_property
    def surface(self) -> SurfaceContact:
        """The contact as the tool has it."""
        candidates, rubbed = self.obstacle.candidates, self.rubbed
        return SurfaceContact(
            candidates,
            self.smooth.touched if rubbed is None else rubbed.fine,
            self.tool,
            candidates.from_regions(self.sweep.law.plane_moduli),
            self._plug.body.mirrored,
            None if rubbed is None else rubbed.coarse,
            self._plug.body.is_halved,
        )

    @property
    def stored(self) -> float | None:
        """The energy (J) of the modelled part; None where a whole face touches, without friction, by the depth.

        The contact area is then known, and the energy is half the work of the force, of which friction dissipates some.
        """
        if self.rubbed is not None:
            return float((self.rubbed.moved * self.rubbed.fine.forces).sum()) / 2
        is_flat = np.ptp(self.obstacle.bounds) <= _SAME * self.obstacle.depth
        return None if self.smooth.active.all() and is_flat else self.smooth.state.energy / 2

    @property
    def far_share(self) -> float:
        """The amplitude of the far field per depth; zero without one."""
        share = self.smooth_share if self.rubbed is None else self.rubbed.far_share
        return share / self.obstacle.depth

    def put(self, column: Column) -> None:
        """Make the contact, with its far field, the solution of a unit of the ``column``.

        Raises:
            SolveError: if the amplitude of the far field is not finite.
        """
        unknowns = self.unknowns if self.rubbed is None else self.rubbed.unknowns
        self._plug.put(column, unknowns, self.obstacle.depth)
        if self.far is not None:
            column.prescribed = np.zeros_like(column.prescribed)
            add_far(column, self.far, self.far_share)

    def summary(self, sag: float) -> ContactResult:
        """Return the whole contact; ``sag`` (m) is that of the first touch; collective."""
        if self.loaded is None:
            return self.surface.result(sag, nan)
        energy = 2.0 ** len(self._plug.body.mirrored) * self.loaded.energy / 2
        return self.surface.result(sag, energy, self._shift(self.loaded))

    def _shift(self, loaded: FreeResponse) -> float:
        """Return how far (m) loads move the nodes in contact across the axis, in the mean of the whole body."""
        weights = np.where(self.surface.touched.active, self.obstacle.candidates.weights, 0.0)
        moved = weights @ self.sweep.elements.numbering.gather_vectors(loaded.unknowns[0]) / weights.sum()
        return float(np.linalg.norm([moved[axis] for axis in (0, 1) if axis not in self._plug.body.mirrored]))

    def response(self, column: Column, movement: Movement) -> Response:
        """Return the force at this depth as a stiffness, F/d; its balance is the largest of all checks."""
        space, (depth,), force = self._plug.displacements, movement.amounts, self.surface.force
        products = self._plug.products(self.sweep.law, [column])
        (moved,), (residual,) = products.moved, products.residuals
        local = np.array([residual.reshape(-1, 3)[space.bearing_owned, 2].sum(), moved @ residual])
        support, energy = global_sum(space.comm, depth * local * (1.0, depth))
        touched, across = self.surface.touched, np.zeros(2)
        if self.rubbed is None:
            state, active = self.smooth.state, touched.active
            work, energy = float(state.reactions[active] @ state.moved[active]), state.energy
        else:
            work, across = float((self.rubbed.moved * touched.forces).sum()), touched.forces[:, :2].sum(axis=0)
            if (far := self.sweep.elements.far) is not None:
                energy += self.rubbed.far_share**2 * far.beyond
        balance = max(abs(support / force - 1), abs(work / energy - 1))
        on_probe = np.array([[*across, -force]]) / depth
        return reaction(movement, np.array([[force / depth]]), on_probe, self._plug.body.mirrored, balance)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the change of the force in one degree more, and its error bar.

        Each depth has its own bar where loads act, or where the surface is not condensed.
        """
        depth = self.obstacle.depth
        if self.rubbed is not None:
            smooth = replace(self, rubbed=None)
            smooth.put(columns[0])
            found = smooth.hierarchical_estimate(columns, movement, stack, keep=keep)
            self.put(columns[0])
            return half_the_steps(found, self.surface, smooth.surface.force)
        known = self.sweep.bar(depth, movement.far) if self.loaded is None else None
        if known is None:
            self._plug.show(columns[:1])
            known = self._estimated()
            if self.loaded is None:
                self.sweep.keep_bar(depth, *known, movement.far)
        return estimate_of(self._plug, self.surface, depth, known, known[1])

    def rate(self, columns: Sequence[Column], movement: Movement) -> Rate:
        """Return the rate with the same nodes in contact."""
        return Rate([column.amount for column in columns], self._show_rate)

    def _show_rate(self) -> None:
        elements, depth, smooth = self.sweep.elements, self.obstacle.depth, self.smooth
        elements.start_at(self.unknowns)
        elements.hold(smooth.active)
        elements.improve(self.obstacle.bounds - depth, _RATE, smooth.state.energy)
        for field, before in zip(elements.fields, self.unknowns, strict=True):
            field.array[:] = (field.array - before) / depth
        elements.show()
        elements.start_at(self.unknowns)

    def _estimated(self) -> tuple[float, float]:
        """Return the share of the energy that one degree more removes, and the relative bar."""
        candidates, found, elements = self.obstacle.candidates, self.smooth, self.sweep.elements
        touching, area_bar = float(candidates.weights[found.active].sum()), self.surface.area.bar
        covered = float(candidates.areas[candidates.closed(found.active)].sum())
        if covered < fitted.FOUND_COVERED * touching:
            return found_again_bar(found_again(elements, self.obstacle_above(), found), area_bar)
        removed, unseen = area_fixed(elements, candidates.held_facets(found.active))
        share, unseen = removed / found.state.energy, unseen / found.state.energy
        if self.surface.is_ended:  # the probe ends there, and the pressure is singular
            degree, element, plain = self._plug.degree, self._plug.element, plain_share(self._plug.body)
            return share, error_bar(share, degree, element, plain=plain, unseen=unseen)
        return share, found_bar(share, unseen, area_bar)
