"""The body before contact at large displacements: as it is, or sagged under dead loads.

The tool then touches another place of the surface first. The depth counts from that touch, along the axis.
"""

from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.contact.contact_steps import Friction
from epsmesh.solve.contact.geometry import Touch
from epsmesh.solve.contact.settle import settle
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution
from epsmesh.solve.dead_loads import sag
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import Loads
from epsmesh.solve.relaxing import crept

# Search for the first touch beside the axis: most steps, and the last one, in units of the surface's displacement.
_MOST, _CLOSE = 30, 1e-9


@dataclass(frozen=True, eq=False)
class Sagged:
    """The ``state`` (owned dofs) of a body before the tool touches it, and its ``energy`` (J).

    ``sag`` (m) is how much farther the tool moves to the first touch, ``stored`` (J) the strain energy; both NaN
    without loads. Energies are those of the modelled part. ``begins`` (n) are the nodes that then rest on a bed, None
    for all next to one. ``touched`` is the contact with beds that have dragged it, None without friction.
    """

    state: FloatArray
    applied: Applied | None = None
    energy: float = 0.0
    stored: float = np.nan
    sag: float = np.nan
    begins: BoolArray | None = None
    touched: ContactSolution | None = None

    def placed(self, tool: Tool, body: DeformedBody) -> Tool:
        """Return a tool whose depths count from the first touch of the sagged surface of a ``body``.

        With a linear law its gaps are those above the body at rest.
        """
        if body.law.is_linear:
            tool = tool.at_rest(body.part().candidates.points)
        if np.isnan(self.sag):
            return tool
        return replace(tool, distance=lambda points, depth: tool.distance(points, depth + self.sag), begins=self.begins)


def sagged_body(
    body: DeformedBody,
    tool: Tool,
    loads: Loads | None,
    guess: FloatArray | None = None,
    *,
    has_crept: bool = False,
    friction: Friction | None = None,
    steps: int = 1,
) -> Sagged:
    """Return a body under its loads, whose state is then that; ``guess`` is an initial guess of it; collective.

    ``has_crept``: relaxing tissue has carried them for long, and the energy of the ``body`` is then what is left.
    ``friction`` is that with which it settles on beds, in so many ``steps`` at least.

    Raises:
        SolveError: see :func:`epsmesh.solve.dead_loads.sag`.
    """
    if loads is None and not body.elements.displacements.is_loaded:
        return Sagged(np.zeros(body.elements.unknowns))
    settled = None
    if tool.beds:
        settled = settle(body, tool, guess, friction, steps)
    else:
        body.state = sag(body.elements, body.law, loads, guess, has_crept=has_crept)
    if has_crept:
        body.hyperelastic.impose(crept(body.hyperelastic.points, body.law))
    energy = body.energy
    return Sagged(
        body.state,
        body.applied,
        energy,
        energy + body.work_of_loads,
        _sag_of(tool, body),
        None if settled is None else settled.active,
        None if friction is None else settled,
    )


def _sag_of(tool: Tool, body: DeformedBody) -> float:
    """Return how much farther (m) a tool moves to touch a ``body`` in its state, with the gaps of the law."""
    touch, part = Touch(tool.height, tool.first), body.part()
    positions = part.of(body.positions())
    if not body.law.is_linear:
        return touch.sag_at(part.candidates, positions)
    if tool.normal is not None:
        return _sag_along(tool, np.array(tool.normal), body)
    return touch.sag(part.candidates, (positions - part.of(body.places))[:, 2])


def _sag_along(tool: Tool, normal: FloatArray, body: DeformedBody) -> float:
    """Return the same where gaps are along a ``normal`` that is not the axis: their least one is that at rest.

    Raises:
        SolveError: if no depth is found.
    """
    part = body.part()
    candidates, moved = part.candidates, part.of(body.positions() - body.places) @ normal

    def gap(depth: float, risen: FloatArray) -> float:
        return Touch(lambda points: tool.heights_along(normal, points, depth)).least(candidates, risen)

    sag, at_rest, size = 0.0, gap(0.0, np.zeros_like(moved)), float(np.abs(moved).max(initial=0.0))
    for _ in range(_MOST):  # the tool comes nearer by about the cosine of its way
        change = (gap(sag, moved) - at_rest) / normal[2]
        sag += change
        if abs(change) <= _CLOSE * size:
            return sag
    raise SolveError("no depth is found at which the tool first touches the surface that loads move")
