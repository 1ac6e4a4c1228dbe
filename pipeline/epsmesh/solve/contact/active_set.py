"""The active set of unilateral contact in linear elasticity, found by the loop of :mod:`.deformed`.

    u_z <= b,    r <= 0,    r (u_z - b) = 0    at each candidate node,

where b is the height of the pressed-in probe above the node, and r the reaction (K u along z). Active nodes have
u_z = b: the gap is that along the axis, above the undeformed place of the node.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve import SolveError
from epsmesh.solve.contact.deformed import solve_contact
from epsmesh.solve.contact.elements import ContactElements, SurfaceState
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.touching import ContactSolution, NoTouchError, PlacedTool
from epsmesh.solve.newton import LargeError
from epsmesh.stages import stage


class ContactError(SolveError):
    """Contact not found, or not valid. Another linear solver does not help."""


@dataclass(frozen=True, eq=False)
class SettledContact:
    """A converged active set and its solution: what ``touched``, and the state of all candidates."""

    touched: ContactSolution
    state: SurfaceState

    @property
    def active(self) -> BoolArray:
        """The active set (n)."""
        return self.touched.active


@dataclass(frozen=True, eq=False)
class Obstacle:
    """The obstacle above the ``candidates``: their ``bounds`` (n, m) with the probe pressed in by ``depth`` (m).

    Beside the tool bounds are infinite.
    """

    candidates: Candidates
    bounds: FloatArray
    depth: float

    def placed(self, fixed: BoolArray) -> PlacedTool:
        """Return the tool above nodes that move along the axis only; the support holds those that are ``fixed`` (n)."""

        def distance(points: FloatArray) -> Distance:
            return Distance.along_axis(self.bounds, points)

        def complete(active: BoolArray) -> BoolArray:
            return neighbours.complete(active) & can_touch

        neighbours, can_touch = self.candidates.neighbours, np.isfinite(self.bounds) & ~fixed
        return PlacedTool(distance, complete, neighbours.followers, self.depth)


@stage("contact sets")
def find_set(
    elements: ContactElements,
    obstacle: Obstacle,
    active: BoolArray,
    tolerances: Sequence[float],
    energy: float | None = None,
    *,
    roughly: bool = False,
    is_guess: bool = False,
) -> SettledContact:
    """Return the converged active set from the initial guess ``active`` (n); collective.

    For ``tolerances`` and ``energy`` see :class:`.elements.LinearTissue`. With ``roughly`` a set from a repeating cycle
    is accepted. For ``is_guess`` see :func:`.deformed.solve_contact`.

    Raises:
        SolveError: if the linear solver fails.
        ContactError: if sets repeat, or no node touches.
    """
    tissue = elements.tissue(tolerances, energy)
    tool = obstacle.placed(tissue.fixed[:, 0])
    first = tool.complete(active)  # guessed from larger elements, it may reach beside the tool
    try:
        touched = solve_contact(tissue, tool, first, is_guess=is_guess and bool(first.any()))
    except NoTouchError as error:
        raise ContactError(str(error)) from error
    except LargeError as error:
        if not roughly:
            raise ContactError(f"the contact area does not settle: {error}") from error
        forces = tissue.forces()
        gap = tool.distance(tissue.positions()).gap
        touched = ContactSolution(forces[:, 0] != 0.0, forces, gap, 0, np.full_like(forces, -1.0))
    return SettledContact(touched, elements.state())
