"""Contact at large displacements that was found: force, checks, and error bar.

The force is the sum of the reactions. Three checks are independent of the loop: the support carries the same force,
the work of the reactions in a small change of the displacement is the change of the stored energy, and J > 0.

The error bar comes from one degree more, from the same state on and with contact found again: the contact area is the
larger part of the error.
"""

from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.contact.checks import check_energy, check_support
from epsmesh.solve.contact.contact_steps import (
    ContactPath,
    ContactPathPoint,
    check_outside,
    reach_contact,
)
from epsmesh.solve.contact.corrections import Corrections
from epsmesh.solve.contact.deformed import first_set, solve_contact
from epsmesh.solve.contact.estimators import estimate_of, half_the_steps
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.placed import check_edges, placed_tool
from epsmesh.solve.contact.pull import Pulled
from epsmesh.solve.contact.rest import Rest, force_left, overlap, rests_of
from epsmesh.solve.contact.sagged import Sagged, sagged_body
from epsmesh.solve.contact.surface_contact import SurfaceContact, on_surface
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool
from epsmesh.solve.contact_result import ContactResult, RestBars
from epsmesh.solve.elements.base import Equilibrium, HierarchicalEstimate, Rate
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.estimate import found_again_bar
from epsmesh.solve.movement import Loads, Movement
from epsmesh.solve.newton import LargeError
from epsmesh.solve.response import Response, reaction
from epsmesh.stages import stage

# Relative change of the displacement for the check of the work.
_SMALL = 1e-4
# Residual and gaps of one degree more, for the error bar.
_FOUND_AGAIN = 1e-3
# Depth of tissue within that below it which is an error, in units of the tool's depth.
_OVERLAPS = 0.05
# Force beyond the edge of the tissue below which is an error, in units of the tool's; a smaller one is in the bar.
_OVERHANGS = 0.01
# Share of the depth to both sides of it over which the rate by the depth is taken.
_NEARBY = 1e-3


@dataclass(frozen=True, eq=False)
class Beside:
    """Beside contact with friction: that without, ``smooth``, with its ``state``; and the one from half the steps.

    ``closing`` is the number of these steps, and ``rests`` what beds do there. ``pulled`` are jaws that are.
    """

    smooth: "LargeContactSolution"
    state: FloatArray
    coarse: ContactSolution
    closing: int
    rests: tuple[Rest, ...] = ()
    pulled: Pulled | None = None


@dataclass(frozen=True, eq=False)
class LargeContactSolution:
    """Contact at a ``depth`` (m) with the state of a ``body``; methods are collective.

    ``sagged`` is the body before, from whose first touch the depth counts. ``corrections`` are those of the path.
    ``beside`` is given with friction.
    """

    surface: Surface
    body: DeformedBody
    tool: Tool
    touched: ContactSolution
    depth: float
    sagged: Sagged
    corrections: Corrections
    beside: Beside | None = None

    @property
    def placed(self) -> Tool:
        """The tool whose depth counts from there."""
        return self.sagged.placed(self.tool, self.body)

    @property
    def stored(self) -> float:
        """The energy (J) of the modelled part that is due to the depth."""
        return self.body.energy - self.sagged.energy

    @cached_property
    def surface_contact(self) -> SurfaceContact:
        """The contact as the tool has it."""
        return on_surface(self.body, self.tool, self.touched, None if self.beside is None else self.beside.coarse)

    @property
    def force(self) -> float:
        """The force (N) on the modelled part of the tool, along its axis."""
        return self.surface_contact.force

    @cached_property
    def shortening(self) -> float:
        """How far (m) a tool that deforms gives way on its axis; NaN of a rigid one."""
        return self.body.shortening(self.tool.foot)

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        """What the beds do to the modelled part."""
        return rests_of(self.body, self.tool.beds, self.touched)

    def equilibrium(self, movement: Movement, iterations: int, stack: ExitStack) -> Equilibrium:
        """Return the checked equilibrium of a ``movement``; the ``stack`` frees its columns."""
        columns, elements, body = self.body.elements.columns(movement, stack), self.body.elements, self.body
        elements.put(columns[0], body.split(body.state - self.sagged.state), self.depth)
        for of_loads in columns[1:]:
            elements.put(of_loads, body.split(self.sagged.state))
        self.check()
        return Equilibrium(self, columns, movement, iterations, self.response(movement), contact=self.summary())

    def summary(self) -> ContactResult:
        """Return the whole contact, with the effects of loads."""
        stored = 2.0 ** len(self.body.elements.body.mirrored) * self.sagged.stored
        found = self.surface_contact.result(self.sagged.sag, stored)
        rests = tuple(rest.result() for rest in self.rests) or found.rests  # or the image of the tool
        found = replace(found, rests=rests, shortening=self.shortening)
        if self.beside is None or self.beside.pulled is None:
            return found
        return replace(found, pull=self.beside.pulled.fine.result(self.body.elements.body))

    def check(self) -> None:
        """Check the work, and that contact ends within the candidates.

        Raises:
            LargeError: if the work of the reactions is not the change of the energy, or loose tissue has gone far.
            ContactError: if contact reaches the support or the edge of the candidates.
        """
        tool = self.body.part()
        check_support(tool.of(self.body.fixed), tool.of(self.touched.gap))
        check_edges(self.body, self.tool, self.touched)
        if not self.body.law.is_linear and overlap(self.body, self.tool.beds, self.touched) > _OVERLAPS * self.depth:
            raise LargeError(
                "tissue that has lifted off the tissue below comes to another place of it: use a smaller depth"
            )
        if self._overhang > _OVERHANGS:
            raise LargeError(
                "loose tissue slides beyond the edge of the tissue below and presses there: use a smaller depth, or "
                "let it end before that edge"
            )
        check_energy(self.body, self.touched, _SMALL)

    @property
    def _overhang(self) -> float:
        """The force with which loose tissue presses beyond the edge of that below, in units of the tool's."""
        return self.body.overhang(self.touched.forces) / self.force

    def response(self, movement: Movement) -> Response:
        """Return the force at this depth as a stiffness, F/d."""
        balance = float(np.linalg.norm(force_left(self.body, self.tool.beds, self.touched))) / self.force
        if self.body.elements.displacements.conditions.deforms:
            balance = max(balance, abs(self.body.mount_force / self.force - 1))
        check_balance(balance)
        on_probe = self.surface_contact.touched.forces.sum(axis=0)[None] / self.depth
        return reaction(movement, -on_probe[:, 2:], on_probe, self.body.elements.body.mirrored, balance)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the change of the force in one degree more, where contact is found again, and its bar.

        With friction the change is that of contact without, and the bar has the bars of friction, too.

        Raises:
            LargeError: if the next degree does not converge.
        """
        if self.beside is not None:
            smooth, state = self.beside.smooth, self.body.state
            self.body.state = self.beside.state
            found = smooth.hierarchical_estimate(columns, movement, stack, keep=keep)
            self.body.state = state
            found = half_the_steps(found, self.surface_contact, smooth.force)
            more = found.friction_bar * self.shortening
            both = zip(self.rests, found.rests, self.beside.rests, smooth.rests, strict=True)
            of_tool = found.friction_bar
            rests = tuple(rest.half_the_steps(bars, coarse, without, of_tool) for rest, bars, coarse, without in both)
            found = replace(found, rests=rests, shortening_bar=found.shortening_bar + more)
            if (pulled := self.beside.pulled) is None:
                return found
            assert found.relative is not None
            at_edge = max([self.surface_contact.area.bar, *(rest.area.bar for rest in self.rests)])
            of_jaws = [float(found.relative[0]), *(rest.force for rest in found.rests)]
            bars = of_jaws, at_edge
            above = (self.body, self.surface, smooth.tool, self.beside.closing)
            return replace(found, pull=pulled.with_bars(*above, bars, stack))
        finer, here = self._found_again(movement.loads, stack), self.surface_contact
        # The edge at which the body lifts off a bed is found, too.
        share, at_edge = 1 - finer.force / self.force, max([here.area.bar, *(rest.area.bar for rest in self.rests)])
        of_end = fitted.AT_SHARP_END_LINEAR if self.body.law.is_linear else fitted.AT_SHARP_END
        at_end = of_end * max([here.at_sharp_end, *(rest.at_sharp_end for rest in self.rests)])
        degree = self.body.elements.degree
        decrement, bar = found_again_bar(share, at_edge, fitted.AT_EDGE_LARGE[degree], at_end=at_end)
        unresolved = [rest.unresolved for rest in self.rests]
        bar = max([bar, *unresolved]) + self._overhang
        if any(share > fitted.MOST_UNRESOLVED for share in unresolved):
            raise LargeError("the contact with the support is smaller than elements there: use a smaller `fine`")
        # F is nearly stationary with respect to the area, which has a bar of its own. Where the tool ends, tissue
        # beside it may come below the tool: it is no candidate, and how much the area lacks is unknown.
        of_area = nan if here.is_ended else bar + abs(finer.surface_contact.whole_area / here.whole_area - 1)
        found = estimate_of(finer.body.elements, here, self.depth, (decrement, bar), of_area)
        of_tool = bar * self.shortening + abs(finer.shortening - self.shortening)
        found = replace(found, shortening_bar=of_tool, least=max([at_end, *unresolved]))
        of_rests = (
            RestBars(
                area=bar + rest.bar + abs(again.area.value / rest.area.value - 1),
                force=rest.force_bar(again, degree, at_edge, at_end),
                slip=bar * rest.slip + abs(again.slip - rest.slip),
            )
            for rest, again in zip(self.rests, finer.rests, strict=True)
        )
        return replace(found, rests=tuple(of_rests))

    def rate(self, columns: Sequence[Column], movement: Movement) -> Rate:
        """Return the rate with the same nodes in contact."""
        return Rate([column.amount for column in columns], self._show_rate)

    def _show_rate(self) -> None:
        body, state, active, found = self.body, self.body.state, self.touched.active, list[FloatArray]()
        for change in (_NEARBY * self.depth, -_NEARBY * self.depth):
            body.state = state
            tool = placed_tool(body, self.placed.advanced(change), self.depth)
            solve_contact(body, replace(tool, complete=lambda _: active), active)
            found.append(body.state)
        body.state = (found[0] - found[1]) / (2 * _NEARBY * self.depth)
        body.show()
        body.state = state

    @stage("contact sets")
    def _found_again(self, loads: Loads | None, stack: ExitStack) -> "LargeContactSolution":
        coarse, degree = self.body.elements, self.body.elements.degree + 1
        finer = self.surface.elements(degree, coarse.element, stack)
        applied, state = None if loads is None else finer.displacements.applied(loads), self.body.state
        body = DeformedBody(finer, self.surface, self.body.law, self.body.method, stack, applied)
        try:
            self.body.state = self.sagged.state
            self.body.show()
            body.interpolate(coarse)
            sagged = sagged_body(body, self.tool, loads, body.state)
            self.body.state = state
            self.body.show()
            body.interpolate(coarse)
            interpolated, correction = body.state, self.corrections.at(self.depth)
            if correction is not None:
                body.state = interpolated + correction
                if not body.is_sound:
                    body.state = interpolated
            touched = self._settled_on(body, sagged)
            self.corrections.add(self.depth, body.state - interpolated)
        except SolveError as error:
            raise LargeError(f"no error bar: elements of degree {degree} fail ({error})") from error
        return replace(self, body=body, touched=touched, sagged=sagged)

    def _settled_on(self, body: DeformedBody, sagged: Sagged) -> ContactSolution:
        """Return contact on a ``body`` of another degree: from its state, or along a load path where that fails.

        Raises:
            SolveError: if both fail.
        """

        def tool_at(depth: float) -> PlacedTool:
            return placed_tool(body, tool, depth)

        tool = sagged.placed(self.tool, body)
        placed = tool_at(self.depth)
        active = self.body.candidates.raised(self.touched.active, body.candidates)
        if body.is_sound:
            with suppress(SolveError):
                first = first_set(body, placed, active)
                touched = solve_contact(body, placed, first, is_patient=False, limit=_FOUND_AGAIN)
                check_outside(body, placed, touched, self.depth)
                return touched
        path = ContactPath(ContactPathPoint(0.0, sagged.state))
        reach_contact(body, tool_at, path, self.depth)
        assert path.last.touched is not None
        return path.last.touched
