"""Contact at large displacements: load paths to one depth after another.

With friction, contact without it is found first; it gives the error bar of the mesh. The path is then followed in load
steps, and again in half as many: the change of the force is the bar of the steps.
"""

from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from math import isnan
from typing import ClassVar

import numpy as np

from epsmesh.solve.contact.bed import Bed
from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.contact_steps import (
    ContactPath,
    ContactPathPoint,
    Friction,
    reach_contact,
    reach_contact_with_friction,
)
from epsmesh.solve.contact.corrections import Corrections
from epsmesh.solve.contact.floating import check_loose
from epsmesh.solve.contact.large_solution import Beside, LargeContactSolution
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.placed import placed_tool
from epsmesh.solve.contact.pull import Pull, Pulled, PullPaths
from epsmesh.solve.contact.rest import Rest, height_beside, rests_of
from epsmesh.solve.contact.sagged import Sagged, sagged_body
from epsmesh.solve.contact.settle import without_friction
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.elements.base import Elements, Equilibrium
from epsmesh.solve.ended import ended
from epsmesh.solve.movement import Vector
from epsmesh.solve.newton import LargeError
from epsmesh.solve.solution import Request

# Load steps of the tool for one of the loads, under which a body settles with friction.
_OF_SETTLING = 2
# Height (m) of nodes above a support, in depths of the tool: at rest, the tool then comes before them.
_BESIDE = 0.1


class LargeContact:
    """Contact of a tool with a hyperelastic body of one law under loads; a load path continues to larger depths.

    With friction each depth has a path of its own, which longer pulls at that depth continue. ``STEPS`` is the number
    of its load steps: enough for a bar of some tenths of a per cent where tissue sticks.
    """

    STEPS: ClassVar[int] = 8

    def __init__(self, surface: Surface, elements: Elements, tool: Tool, asked: Request):
        """Prepare for law and loads of a request."""
        self._surface, self._elements, self._tool = surface, elements, tool
        self._law, self._loads = asked.law, asked.movement.loads
        space, is_loaded = elements.displacements, self._loads is not None
        for number, bed in enumerate(tool.beds, start=1):
            check_loose(surface, elements.degree, bed)
            _check_apart(surface.of(elements.degree), number, bed)
        self._smooth = without_friction(space, tool, is_loaded=is_loaded) if tool.rubs else tool
        self._applied = None if self._loads is None else elements.displacements.applied(self._loads)
        self._sagged: Sagged | None = None
        self._settled = dict[int, Sagged]()  # with friction, by the number of load steps
        self._path: ContactPath | None = None
        self._pulls = PullPaths(0.0)
        self._corrections = Corrections()

    def can_reach(self, asked: Request) -> bool:
        """Return whether the load path can be continued to a request; collective."""
        loads, depth, pull = asked.movement.loads, asked.movement.amounts[0], asked.movement.pull
        reached = 0.0 if self._path is None else self._path.reached
        is_same = loads is None
        if self._applied is not None:
            is_same = loads is not None and self._applied.is_same(self._elements.displacements.applied(loads))
        is_ahead = depth > self._pulls.depth or np.linalg.norm(pull or 0.0) >= self._pulls.reached
        return is_same and asked.law == self._law and reached <= depth and bool(is_ahead)

    def solve(self, asked: Request, stack: ExitStack) -> Equilibrium:
        """Find equilibrium and contact at the depth of the movement; the ``stack`` frees what is made; collective.

        Raises:
            LargeError: if the load steps end before the depth, or the solution fails a check.
            ContactError: if contact reaches the support or the edge of the candidates.
        """
        found, iterations = self._without_friction(asked, stack)
        if self._tool.rubs:
            found, more = self._with_friction(found, asked.movement.pull)
            iterations += more
        return found.equilibrium(asked.movement, iterations, stack)

    def _without_friction(self, asked: Request, stack: ExitStack) -> tuple[LargeContactSolution, int]:
        """Return contact at the depth of the movement, and Newton's iterations; see :meth:`solve`."""
        (depth,) = asked.movement.amounts
        body = DeformedBody(self._elements, self._surface, self._law, asked.method, stack, self._applied)
        if self._sagged is None:
            self._sagged = sagged_body(body, self._smooth, self._loads)
        tool = self._sagged.placed(self._smooth, body)
        if self._path is None:
            self._path = ContactPath(ContactPathPoint(0.0, self._sagged.state))
        try:
            iterations = reach_contact(body, lambda amount: placed_tool(body, tool, amount), self._path, depth)
        except LargeError as error:
            raise stopped(body, self._path, depth, error, self._tool) from error
        touched = self._path.last.touched
        assert touched is not None
        body.state = self._path.last.state
        return LargeContactSolution(
            self._surface, body, self._smooth, touched, depth, self._sagged, self._corrections
        ), iterations

    def _with_friction(self, smooth: LargeContactSolution, way: Vector | None) -> tuple[LargeContactSolution, int]:
        """Return contact with friction, beside that without, ``smooth``, and Newton's iterations; see :meth:`solve`.

        Jaws that have closed are pulled by ``way`` (m).
        """
        body, depth, state = smooth.body, smooth.depth, smooth.body.state
        friction, iterations = Friction.on(body, self._tool, depth), 0
        if depth != self._pulls.depth:
            self._pulls = PullPaths(depth)

        def close(sagged: Sagged, steps: int) -> ContactSolution:
            nonlocal iterations
            tool, path = (
                sagged.placed(self._tool, body),
                ContactPath(ContactPathPoint(0.0, sagged.state, sagged.touched)),
            )
            try:
                above = partial(placed_tool, body, tool)
                iterations += reach_contact_with_friction(body, above, path, depth, friction, steps)
            except LargeError as error:
                raise stopped(body, path, depth, error, self._tool, self._tool.friction) from error
            assert path.last.touched is not None
            body.state = path.last.state
            return path.last.touched

        found, pulls, rests = list[ContactSolution](), list[Pull](), list[tuple[Rest, ...]]()
        for name, steps in (("coarse", self.STEPS // 2), ("fine", self.STEPS)):
            sagged = self._settled_with_friction(smooth, friction, steps)
            if way is None:
                found.append(close(sagged, steps))
            else:
                tool, before = sagged.placed(self._tool, body), self._pulls.steps(name)
                pulls.append(self._pulls.pull(name, body, tool, way, friction, partial(close, sagged, steps)))
                found.append(pulls[-1].end.touched)
                iterations += sum(step.touched.iterations for step in pulls[-1].steps[before:])
            rests.append(rests_of(body, self._tool.beds, found[-1]))
        coarse, fine = found
        pulled = None if way is None else Pulled(way, pulls[0], pulls[1], self._pulls)
        beside = Beside(smooth, state, coarse, self.STEPS // 2, rests[0], pulled)
        there = self._tool if way is None or self._law.is_linear else self._tool.moved(np.array(way))
        return replace(smooth, tool=there, touched=fine, sagged=sagged, beside=beside), iterations

    def _settled_with_friction(self, smooth: LargeContactSolution, friction: Friction, steps: int) -> Sagged:
        """Return the body under its loads before the tool touches it, where the path of the tool has so many ``steps``.

        Loads are followed in half as many: what presses a body on mostly does so everywhere in proportion.
        """
        if isnan(smooth.sagged.sag) or not self._tool.drags:
            return smooth.sagged
        if steps not in self._settled:
            fewest = steps // _OF_SETTLING
            self._settled[steps] = sagged_body(smooth.body, self._tool, self._loads, friction=friction, steps=fewest)
        return self._settled[steps]


def _check_apart(candidates: Candidates, number: int, bed: Bed) -> None:
    """Check that what a tool may touch ends before the border of the loose tissue on a ``bed`` with this ``number``.

    Raises:
        LargeError: if they share nodes.
    """
    if bed.tissue is None or candidates.contacts is None:
        return
    others = np.unique(candidates.facets[candidates.contacts != number])
    if len(np.intersect1d(others, candidates.facets[candidates.contacts == number])):
        raise LargeError(
            f'the tissue that a tool may touch reaches the border of "{bed.tissue.name}", which lies loose: there one '
            "place has two contacts. Move the tool, or use a smaller depth or tool"
        )


def stopped(
    body: DeformedBody, path: ContactPath, depth: float, why: LargeError, tool: Tool, friction: float = 0.0
) -> LargeError:
    """Return the error of a ``path`` of a ``tool`` that ends before ``depth`` (m)."""
    last, whole = path.last, 2.0 ** len(body.elements.body.mirrored)
    force = 0.0 if last.touched is None else whole * force_of(body.part().solution(last.touched))
    if not force and (above := height_beside(body, tool.beds)) > _BESIDE * depth:
        return LargeError(
            f"the nodes next to the support that may press on it are {1e3 * above:.2g} mm above it at rest: use "
            "smaller elements there, or a support of a larger radius"
        )
    return ended(why, body.law, (last.amount, force), depth, is_found=True, friction=friction)
