"""Tissue, tools and contacts as the loop of :mod:`.deformed` sees them: nodes of a surface, distances, and forces."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve.contact.bed import Resting
from epsmesh.solve.contact.constraint import Constraint
from epsmesh.solve.contact.coulomb import Slide
from epsmesh.solve.newton import LargeError, Moving

# Tension below this share of the mean reaction, and penetration below this share of the depth, are solver error.
SLACK = 1e-6
# The same for penetration of nodes that stick where they touch: one that leaves carries forces along the bed, too, and
# sets of nodes that hardly press would follow each other forever.
_STICKING = 1e-3
# The same between tissues that stick, or both strain much, where sets repeat: a node that returns may penetrate freely,
# and pull where it pressed before, and no set has neither.
YIELDING = 1e-2
# Sets repeat if one is solved so often.
_REPEATED = 2


class Tissue(Moving, Protocol):
    """A body seen from n nodes of its surface, at its current state. Methods are collective.

    ``fixed`` (n, d) marks prescribed components.
    """

    fixed: BoolArray

    def positions(self) -> FloatArray:
        """Return the nodes' deformed positions (n, d), in m."""

    def forces(self) -> FloatArray:
        """Return the nodal forces (n, d), N, that hold the nodes; zero at prescribed components."""

    def unbalanced(self) -> float:
        """Return the norm (N) of the residual at all other free dofs."""

    def linearise(self, constraint: Constraint) -> FloatArray:
        """Find the increment under a ``constraint``; return the nodal forces (n, d), N, that it predicts.

        Raises:
            SolveError: if the linear solver fails.
        """


class SteppedTissue(Tissue, Protocol):
    """A body on a path: ``state`` are the unknowns of this rank; ``is_sound`` says that J > 0."""

    state: FloatArray

    @property
    def is_sound(self) -> bool: ...  # noqa: D102


@dataclass(frozen=True, eq=False)
class PlacedTool:
    """The tool at one ``depth`` (m): its ``distance`` from points (n, d).

    Reactions of the ``followers`` (n) mean nothing, as those of corners in degree 2. ``complete`` returns an active set
    that nodes may have: without those of the support, and with followers only where all their neighbours are active.
    ``resting`` are those that other surfaces than the tool's may touch, None if there are none.
    """

    distance: Callable[[FloatArray], Distance]
    complete: Callable[[BoolArray], BoolArray]
    followers: BoolArray
    depth: float
    resting: Resting | None = None

    def of_tool(self, chosen: BoolArray) -> BoolArray:
        """Return those of the ``chosen`` nodes (n) that the tool may touch."""
        return chosen if self.resting is None else chosen & ~self.resting.nodes

    @property
    def followers_at_rest(self) -> BoolArray:
        """The followers (n) that a support may touch, or tissue below, and not a jaw."""
        if self.resting is None:
            return np.zeros(len(self.followers), dtype=bool)
        return self.followers & self.resting.nodes & ~np.any([*self.resting.jaws, ~self.resting.nodes], axis=0)

    def touches(self, active: BoolArray) -> bool:
        """Return whether the tool, and each second jaw, touches one of the ``active`` nodes (n)."""
        jaws = () if self.resting is None else self.resting.jaws
        return bool(self.of_tool(active).any()) and all(bool((active & jaw).any()) for jaw in jaws)

    @property
    def slack(self) -> float | FloatArray:
        """The penetration (m) that is solver error, of all or of each node (n)."""
        least = SLACK * self.depth
        return least if self.resting is None else np.where(self.resting.stick, _STICKING * self.depth, least)

    def slack_of(self, repeats: int) -> float | FloatArray:
        """Return the same where the active set repeats for the so-manieth time."""
        if self.resting is None or repeats < _REPEATED:
            return self.slack
        return np.where(self.resting.yields, YIELDING * self.depth, self.slack)

    def start(self) -> BoolArray:
        """Return the nodes (n) that touch at the start of a path."""
        return np.zeros(len(self.followers), dtype=bool) if self.resting is None else self.resting.begin


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """Contact at equilibrium: the ``active`` nodes (n), forces of the tool on the nodes (n, d), N, and gaps (n), m.

    ``normal`` (n, d) are the tool's unit normals at the nodes. ``slide`` is the state of friction, None without.
    """

    active: BoolArray
    forces: FloatArray
    gap: FloatArray
    iterations: int
    normal: FloatArray
    slide: Slide | None = None

    @property
    def pressed(self) -> FloatArray:
        """The normal parts (n) of the forces (N)."""
        return np.asarray(np.einsum("ni,ni->n", self.forces, self.normal))

    @property
    def friction(self) -> FloatArray:
        """The tangential parts (n, d) of the forces (N)."""
        return np.asarray(self.forces - self.pressed[:, None] * self.normal)


class NoTouchError(LargeError):
    """The tool touches no node."""
