"""Load steps of contact: the whole depth at once, or as many steps as the loop needs.

The initial guess of a step continues the last one linearly, and is dropped where it turns tissue inside out. Without
friction the equilibrium does not depend on the path: steps on the way are solved roughly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.contact.coulomb import Slide, most_simplified
from epsmesh.solve.contact.deformed import continue_linear, first_set, solve_contact
from epsmesh.solve.contact.friction_step import FrictionStep, meeting_places
from epsmesh.solve.contact.parts import TOOL
from epsmesh.solve.contact.surface import Neighbours
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool, SteppedTissue
from epsmesh.solve.newton import LargeError
from epsmesh.solve.path import Path, PathPoint, follow

# Larger steps than this share, without friction, are given up soon.
_LARGE = 1 / 8
# Residual and gaps of steps on the way to the depth, without friction.
_ON_THE_WAY = 1e-2
# Depth of inactive nodes inside the tool, in units of the depth at the end, at large displacements. A corner beside
# active nodes is less deep, but where only a few nodes touch.
_INSIDE = 0.25
# The first step ends where the tool's normals at the nodes that it penetrates have this mean part along its way, after
# so many halvings at most: nodes beside the flank of a ball do not stay in contact, and would fold the tissue.
_FACING, _FIRST_HALVINGS = 0.7, 2
# A step was easy if it took at most so many iterations.
_EASY = 8


@dataclass(frozen=True, eq=False)
class ContactPathPoint(PathPoint):
    """Equilibrium at a depth (m) with its contact, None without any."""

    touched: ContactSolution | None = None


class ContactPath(Path[ContactPathPoint]):
    """A load path of contact; amounts are depths (m)."""

    def guess(self, depth: float) -> FloatArray:
        """Return the last state, continued linearly to a ``depth`` (m) if there was contact at the point before."""
        count = sum(point.touched is not None for point in self.points[-2:])
        return self.continued(depth, max(count, 1))


@dataclass(frozen=True, eq=False)
class Friction:
    """Coulomb's ``coefficient`` (infinite: it sticks) for a tool that moves along the unit vector ``advance``.

    Where nodes above a bed are among all, both are given for each node: (n), and (n, d), zero on a support.
    ``penalty`` (n), N/m: see :mod:`.coulomb`. ``deepest`` (m) is the depth at the end of the path. ``is_linear``: the
    tissue is, and the initial guess of a step is its solution for the contact before. ``is_at_depth``: it is
    at that depth, and the amounts of the path are those of another way.
    """

    coefficient: float | FloatArray
    advance: FloatArray
    penalty: FloatArray
    neighbours: Neighbours
    deepest: float
    is_linear: bool = False
    is_at_depth: bool = False

    @classmethod
    def on(cls, body: DeformedBody, tool: Tool, depth: float) -> "Friction":
        """Return the friction of a ``tool`` that advances along −z to a ``depth`` (m) on a ``body``; collective."""
        coefficients, penalties = [tool.friction, *(bed.friction for bed in tool.beds)], list[float]()
        parts = [body.part(number) for number in range(len(coefficients))]
        for part in parts:
            width = float(np.median(part.candidates.widths[part.candidates.widths > 0]))
            modulus = part.candidates.of_facets(body.moduli(len(penalties)))
            penalties.append(float(np.mean(modulus)) * width)
        coefficient: float | FloatArray = tool.friction
        advance, penalty = np.array([0.0, 0.0, -1.0]), penalties[TOOL] + body.stiffness_of_terms()
        if tool.beds:
            coefficient, penalty = np.zeros(len(body.fixed)), body.stiffness_of_terms()
            for part, own, of_part in zip(parts, coefficients, penalties, strict=True):
                coefficient[part.nodes] = own
                penalty[part.nodes] += of_part
            ways, advance = [advance, *(bed.advance for bed in tool.beds)], np.zeros(body.fixed.shape)
            for part, way in zip(parts, ways, strict=True):
                advance[part.nodes] = way
        return cls(coefficient, advance, penalty, body.candidates.neighbours, depth)


def reach_contact(
    tissue: SteppedTissue,
    tool_at: Callable[[float], PlacedTool],
    path: ContactPath,
    depth: float,
    friction: Friction | None = None,
) -> int:
    """Continue a load ``path`` to a ``depth`` (m); return Newton's iterations; collective.

    Raises:
        LargeError: if a step becomes too small; the path keeps the steps that converged.
    """
    iterations, deepest, start = 0, depth if friction is None else friction.deepest, path.last
    tissue.state = start.state
    if start.touched is None and path.step == inf and friction is None:
        path.step = _first_step(tissue, tool_at, start.amount, depth)

    def solve_at(amount: float) -> tuple[ContactPathPoint, bool]:
        nonlocal iterations
        is_patient = friction is not None or amount - path.reached <= _LARGE * depth
        limit = _ON_THE_WAY if friction is None and amount < depth else 0.0
        try:
            touched = _step(tissue, tool_at, path, amount, friction, is_patient=is_patient, limit=limit)
        except SolveError as error:
            raise LargeError(str(error)) from error
        if friction is None or not friction.is_linear:  # small displacements go round no tool
            check_outside(tissue, tool_at(amount), touched, deepest)
        iterations += touched.iterations
        return ContactPathPoint(amount, tissue.state, touched), touched.iterations <= _EASY

    try:
        follow(path, solve_at, depth)
    except LargeError:
        _end(tissue, tool_at, path, start, friction)
        raise
    return iterations


def check_outside(tissue: SteppedTissue, tool: PlacedTool, touched: ContactSolution, deepest: float) -> None:
    """Check that no tissue is left inside the tool: such an equilibrium goes round a tool that is ``deepest`` (m) deep.

    Followers on a support, as far below it as weight flattens facets between their neighbours, go round nothing.

    Raises:
        LargeError: if nodes that are not of the support are inside.
    """
    if touched.gap[~(tissue.fixed.all(axis=1) | tool.followers_at_rest)].min() < -_INSIDE * deepest:
        raise LargeError("tissue is left inside the tool")


def _first_step(tissue: SteppedTissue, tool_at: Callable[[float], PlacedTool], start: float, depth: float) -> float:
    """Return the first step (m) from ``start`` towards a ``depth`` (m); collective."""
    step, nothing = depth - start, np.zeros(len(tissue.fixed), dtype=bool)
    for _ in range(_FIRST_HALVINGS):
        tool = tool_at(start + step)
        through = tool.of_tool(first_set(tissue, tool, nothing))
        if not through.any() or -tool.distance(tissue.positions()).normal[through, -1].mean() >= _FACING:
            break
        step /= 2
    return step


def _end(
    tissue: SteppedTissue,
    tool_at: Callable[[float], PlacedTool],
    path: ContactPath,
    start: ContactPathPoint,
    friction: Friction | None,
) -> None:
    """Leave the tissue in equilibrium at the end of a ``path`` that goes no farther than from ``start``; collective."""
    last = path.last
    tissue.state = last.state
    if last.touched is None or friction is not None:
        return
    try:
        touched = solve_contact(tissue, tool_at(last.amount), last.touched.active)
    except SolveError:  # settled roughly, but no better
        path.return_to(start)
        tissue.state = start.state
        return
    path.points[-1] = ContactPathPoint(last.amount, tissue.state, touched)


def reach_contact_with_friction(
    tissue: SteppedTissue,
    tool_at: Callable[[float], PlacedTool],
    path: ContactPath,
    depth: float,
    friction: Friction,
    steps: int,
) -> int:
    """Continue a new load ``path`` to a ``depth`` (m) with friction; return Newton's iterations; collective.

    There are at least so many ``steps``, whose depths go with the square of their numbers. At the first ones, the tool
    may touch no node, or too few for the contact to settle: the next one then continues from the last equilibrium.

    Raises:
        LargeError: if a step in the second half becomes too small; the path keeps the steps that converged.
    """
    iterations = 0
    for number in range(1, steps + 1):
        amount, last = depth * (number / steps) ** 2, path.last
        tissue.state, tool = last.state, tool_at(amount)
        before = tool.start() if last.touched is None else last.touched.active
        if number < steps and not tool.touches(first_set(tissue, tool, before)):
            path.add(ContactPathPoint(amount, last.state, last.touched))
            continue
        path.step = inf
        try:
            iterations += reach_contact(tissue, tool_at, path, amount, friction)
        except LargeError:
            if number > steps // 2:
                raise
    return iterations


def friction_step(
    tissue: SteppedTissue,
    tool_at: Callable[[float], PlacedTool],
    last: ContactPathPoint,
    depth: float,
    friction: Friction,
) -> FrictionStep:
    """Return the friction of a step from the ``last`` point to a ``depth`` (m), whose state is predicted."""
    after, guess = tissue.positions(), tissue.state
    tissue.state = last.state
    before = tissue.positions()
    tissue.state = guess

    def gap(points: FloatArray, amount: float) -> FloatArray:
        return tool_at(amount).distance(points).gap

    references = meeting_places(gap, (before, after), (last.amount, depth), friction.advance)
    touched = last.touched
    if touched is not None:
        carried = before + (depth - last.amount) * friction.advance
        references = np.where(touched.active[:, None], carried, references)
    normal = np.zeros(len(before)) if touched is None else touched.pressed
    slide = None if touched is None else touched.slide
    return FrictionStep(
        friction.coefficient,
        references,
        friction.penalty,
        friction.neighbours,
        slide or Slide.none(before.shape),
        normal,
        tissue.fixed,
        most_simplified(friction.deepest if friction.is_at_depth else depth, friction.deepest),
        friction.is_linear,
    )


def _step(
    tissue: SteppedTissue,
    tool_at: Callable[[float], PlacedTool],
    path: ContactPath,
    depth: float,
    friction: Friction | None,
    *,
    is_patient: bool,
    limit: float,
) -> ContactSolution:
    tool, last = tool_at(depth), path.last
    active = tool.start() if last.touched is None else last.touched.active
    tissue.state = path.guess(depth)
    if not tissue.is_sound:
        tissue.state = last.state
    of_step = None if friction is None else friction_step(tissue, tool_at, last, depth, friction)
    if friction is not None and of_step is not None and friction.is_linear and last.touched is not None:
        continue_linear(tissue, tool, last.touched, of_step)
        of_step = friction_step(tissue, tool_at, last, depth, friction)
    return solve_contact(tissue, tool, first_set(tissue, tool, active), of_step, is_patient=is_patient, limit=limit)
