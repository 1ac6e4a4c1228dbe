"""Jaws that have closed, and are then pulled along the surface together: force, slip, and work.

The pull is a load path of its own, from the equilibrium of the closed jaws on; a longer pull continues it. Nodes that
stick move with the tool. With a linear law the gaps stay those above the undeformed places: the pull is small beside
the contact.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from math import ceil
from typing import ClassVar

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve import SolveError
from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.contact_steps import (
    ContactPath,
    ContactPathPoint,
    Friction,
    reach_contact,
    reach_contact_with_friction,
)
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.contact.placed import check_edges, placed_tool
from epsmesh.solve.contact.sagged import sagged_body
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool
from epsmesh.solve.contact_result import PullResult, Slip
from epsmesh.solve.estimate import found_again_bar
from epsmesh.solve.movement import Vector
from epsmesh.solve.newton import LargeError

# Rounding of the number of steps.
_SLIVER = 1e-6
# Largest share of the work of a pull that is neither heat nor stored. Steps of a sixteenth leave below a thousandth.
_LOST = 0.02


@dataclass(frozen=True, eq=False)
class PullStep:
    """Jaws that have ``moved`` (m): what has ``touched``, and of each contact the force on the tissue along the pull
    (N, of the modelled part) and the share of its area that slides."""

    moved: float
    touched: ContactSolution
    forces: tuple[float, ...]
    shares: tuple[float, ...]

    @property
    def force(self) -> float:
        """The force (N) of all contacts on the modelled part."""
        return sum(self.forces)

    @property
    def sliding(self) -> BoolArray:
        """The nodes (n) that slide."""
        slide = self.touched.slide
        return self.touched.active & (slide.sliding if slide is not None else False)


@dataclass(frozen=True, eq=False)
class Pull:
    """The ``steps`` of a pull, the first of which is its beginning, where the force on the first jaw is ``closed`` (N).

    Energies (J) are the ``work`` of the jaws, the ``heat`` of friction, and what the tissue has ``stored``, all of the
    modelled part. ``state`` and ``energy`` (J) are those of the tissue at the end.
    """

    steps: tuple[PullStep, ...]
    closed: float
    state: FloatArray
    energy: float
    work: float = 0.0
    heat: float = 0.0
    stored: float = 0.0

    @classmethod
    def begin(cls, body: DeformedBody, tool: Tool, touched: ContactSolution, way: Vector) -> "Pull":
        """Return the beginning, along a ``way``, of jaws that have ``touched`` a ``body`` in its state; collective."""
        step = _step(body, 1 + len(tool.beds), 0.0, touched, _direction(way))
        return cls((step,), force_of(body.part().solution(touched)), body.state, body.energy)

    @property
    def end(self) -> PullStep:
        """The last step."""
        return self.steps[-1]

    def changes(self, other: "Pull") -> tuple[float, ...]:
        """Return the relative change of each jaw's force at the end to that of an ``other`` pull."""
        return tuple(again / own - 1 for own, again in zip(self.end.forces, other.end.forces, strict=True))

    def result(self, body: BodyMesh) -> PullResult:
        """Return that of the whole of a ``body``, of which a part is modelled, with both jaws or one."""
        slid, of_tool = self.steps[0].sliding, 2.0 ** len(body.mirrored)
        begins = self._slip(lambda step: bool((step.sliding & ~slid).any()), body.images)
        whole = self._slip(lambda step: min(step.shares) == 1.0, body.images)
        first, second = (of_tool * force for force in (2 * self.end.forces)[:2])
        work, heat, stored = (body.images * value for value in (self.work, self.heat, self.stored))
        return PullResult((first, second), begins, whole, work, heat, stored, of_tool * self.closed)

    def _slip(self, has_slipped: Callable[[PullStep], bool], images: float) -> Slip | None:
        """Return between which steps slip begins, None if it does not."""
        for before, after in zip(self.steps[:-1], self.steps[1:], strict=True):
            if has_slipped(after):
                ways, forces = (before.moved, after.moved), (images * before.force, images * after.force)
                return Slip(sum(ways) / 2, abs(ways[1] - ways[0]) / 2, sum(forces) / 2, abs(forces[1] - forces[0]) / 2)
        return None


@dataclass(eq=False)
class PullPaths:
    """The longest pulls so far of jaws that have closed to a ``depth`` (m), which longer ones continue.

    They are the ``coarse`` one, in half the steps, the ``fine`` one, in all, and the one ``above``, in half the steps
    and elements of one degree more. ``STEPS`` is the number of steps of a pull, of equal lengths. One that continues
    a shorter pull follows the rest in steps of this length or less.
    """

    STEPS: ClassVar[int] = 16

    depth: float
    longest: dict[str, Pull] = field(default_factory=dict)

    @property
    def reached(self) -> float:
        """How far (m) the jaws have been pulled."""
        return max((pull.end.moved for pull in self.longest.values()), default=0.0)

    def steps(self, name: str) -> int:
        """Return the number of steps of a pull so far."""
        return len(self.longest[name].steps) if name in self.longest else 1

    def pull(
        self,
        name: str,
        body: DeformedBody,
        tool: Tool,
        way: Vector,
        friction: Friction,
        close: Callable[[], ContactSolution],
    ) -> Pull:
        """Pull a ``tool`` and its second jaws by ``way`` (m), after ``close`` has closed them; collective.

        The ``body`` is in the state at the end.

        Raises:
            LargeError: if a step becomes too small.
        """
        if name not in self.longest:
            self.longest[name] = Pull.begin(body, tool, close(), way)
        steps = self.STEPS if name == "fine" else self.STEPS // 2
        self.longest[name] = found = _continued(self.longest[name], body, tool, self.depth, way, friction, steps)
        return found


def _continued(
    pull: Pull, body: DeformedBody, tool: Tool, depth: float, way: Vector, friction: Friction, steps: int
) -> Pull:
    """Return a ``pull`` that has gone on to ``way`` (m), in the ``steps`` that the rest has of its whole length.

    Raises:
        LargeError: if a step becomes too small.
    """
    along, length, start = _direction(way), float(np.linalg.norm(way)), pull.end.moved
    count = ceil(steps * (1 - start / length) - _SLIVER)

    def moved_tool(moved: float) -> Tool:
        return tool if body.law.is_linear else tool.moved(moved * along)

    def tool_at(moved: float) -> PlacedTool:
        return placed_tool(body, moved_tool(moved), depth)

    rubs = replace(friction, advance=np.tile(along, (len(body.fixed), 1)), is_at_depth=True)
    path, work, heat = ContactPath(ContactPathPoint(start, pull.state, pull.end.touched)), pull.work, pull.heat
    body.state = pull.state
    found, places = [*pull.steps], body.positions()
    for number in range(1, count + 1):
        path.step, moved = np.inf, start + (length - start) * number / count
        try:
            reach_contact(body, tool_at, path, moved, rubs)
            now = path.last.touched
            assert now is not None
            check_edges(body, moved_tool(moved), now)
            after = _step(body, 1 + len(tool.beds), moved, now, along)
        except SolveError as error:
            raise _ended(error, found, body, depth, length) from error
        before, here = found[-1], body.positions()
        work += (after.moved - before.moved) * (before.force + after.force) / 2
        slips = here - places - (after.moved - before.moved) * along
        normal = before.touched.normal + now.normal
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        slips -= np.einsum("ni,ni->n", slips, normal)[:, None] * normal
        heat -= float(((before.touched.forces + now.forces) * slips).sum()) / 2
        places = here
        found.append(after)
    stored = pull.stored + body.energy - pull.energy
    if not abs(work - heat - stored) <= _LOST * (abs(heat) + abs(stored)):
        raise LargeError(
            f"the work of the pull, {work:.3g} J, is not what friction turns into heat, {heat:.3g} J, and what the "
            f"tissue stores, {stored:.3g} J"
        )
    return Pull(tuple(found), pull.closed, body.state, body.energy, work, heat, stored)


@dataclass(frozen=True, eq=False)
class Pulled:
    """Jaws that have been pulled by ``way`` (m): in half the steps, ``coarse``, and in all of them, ``fine``.

    ``paths`` are those that both are on.
    """

    way: Vector
    coarse: Pull
    fine: Pull
    paths: PullPaths

    def with_bars(
        self,
        body: DeformedBody,
        surface: Surface,
        tool: Tool,
        closing: int,
        bars: tuple[Sequence[float], float],
        stack: ExitStack,
    ) -> PullResult:
        """Return the pull in all steps with its 95 % bars; collective.

        They are from the change by half the steps, and the change of these in elements of one degree more, in which
        the jaws of a ``tool`` close in so many steps, ``closing``. Of the relative ``bars`` the first are those on the
        normal forces: after whole slip, forces along the pull are in proportion to them. The last is that on the areas
        by the size of elements. The ``stack`` frees what is made.

        Raises:
            LargeError: if the next degree fails.
        """
        elements, depth = body.elements, self.paths.depth
        try:
            above = surface.elements(elements.degree + 1, elements.element, stack)
            finer = DeformedBody(above, surface, body.law, body.method, stack)
            placed = sagged_body(finer, tool, None).placed(tool, finer)
            friction = Friction.on(finer, placed, depth)

            def close() -> ContactSolution:
                path = ContactPath(ContactPathPoint(0.0, finer.state))
                reach_contact_with_friction(
                    finer, lambda amount: placed_tool(finer, placed, amount), path, depth, friction, closing
                )
                assert path.last.touched is not None
                finer.state = path.last.state
                return path.last.touched

            again = self.paths.pull("above", finer, placed, self.way, friction, close)
        except SolveError as error:
            raise LargeError(f"no error bar: elements of degree {elements.degree + 1} fail ({error})") from error
        (pressed, at_edge), least = bars, fitted.AT_EDGE_LARGE[elements.degree]
        of_degree = [found_again_bar(share, at_edge, least)[1] for share in self.coarse.changes(again)]
        of_steps = map(abs, self.fine.changes(self.coarse))
        bar = float(np.max([*pressed, *(sum(both) for both in zip(of_degree, of_steps, strict=True))]))
        half, whole, finest = (pull.result(elements.body) for pull in (self.coarse, self.fine, again))
        found = whole.with_bar(bar).with_change(whole, half).with_change(half, finest)
        # Slip begins at one node, at the edge of contact: where the pressure falls to zero there, with the pull.
        return replace(found, begins=found.begins and found.begins.from_zero())


def _direction(way: Vector) -> FloatArray:
    """Return the unit vector of a ``way``."""
    return np.array(way) / float(np.linalg.norm(way))


def _step(body: DeformedBody, contacts: int, moved: float, touched: ContactSolution, along: FloatArray) -> PullStep:
    """Return what each of so many ``contacts`` does."""
    forces, shares = [], []
    for number in range(contacts):
        part = body.part(number)
        own = part.solution(touched)
        if not own.active.any():
            raise LargeError("a jaw has lost contact")
        forces.append(float((own.forces @ along).sum()))
        shares.append(0.0 if own.slide is None else own.slide.share(part.candidates.weights, own.active))
    return PullStep(moved, touched, tuple(forces), tuple(shares))


def _ended(why: SolveError, steps: list[PullStep], body: DeformedBody, depth: float, length: float) -> LargeError:
    """Return the error of a pull that goes no farther than the last of its ``steps``, with the force before."""
    mesh, last = body.elements.body, steps[-1]
    pressed = 2.0 ** len(mesh.mirrored) * force_of(body.part().solution(steps[0].touched))
    return LargeError(
        f"the pull reached {1e3 * last.moved:.3g} mm of {1e3 * length:.3g} mm, where the force along it is "
        f"{mesh.images * last.force:.4g} N ({why}); use a smaller pull, smaller elements below the jaws, or less "
        "friction",
        (depth, pressed),
    )
