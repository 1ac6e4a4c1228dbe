"""Coulomb's law at the nodes of a contact: which of them stick, and the traction of those that slide.

With λ the normal reaction, R its tangential part and s the slip since a reference, the trial traction is T = R − c s. A
node sticks (s = 0) if |T| ≤ μ λ; otherwise it slides, with R = μ λ T/|T|. Both are equations for any c > 0, which
Newton's method solves with the tangents of the last iterate (P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng.
92, 353, 1991). Tissue that "sticks" has infinite friction.

The sign of a corner's reaction means nothing (:class:`epsmesh.solve.contact.surface.Neighbours`), nor does its trial
traction: corners slide where most of their neighbours do, in the mean direction of these.
"""

from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.solve.contact.surface import Candidates, Neighbours
from epsmesh.solve.contact_result import Rubbing

# Nodes change between sticking and sliding beyond this share of the largest friction.
_SLACK = 1e-6
_TINY = 1e-300
# Largest share of the force on simplified nodes: friction then changes by about as much, half of the bar on it.
_MOST_SIMPLIFIED = 0.1
# Changes of a node's state after which it is simplified.
_CHANGES = 3
# Least share of a change of directions of slip that is taken.
_LEAST = 0.1


@dataclass(frozen=True, eq=False)
class Slide:
    """Nodes that slide (n), ``directions`` (n, t) of friction on the tissue, and ``sizes`` (n) of trial tractions (N).

    Directions are unit vectors; at corners the mean of their neighbours', which is shorter where these differ.
    """

    sliding: BoolArray
    directions: FloatArray
    sizes: FloatArray

    @staticmethod
    def none(shape: tuple[int, ...]) -> "Slide":
        """Return the state of nodes that do not slide."""
        return Slide(np.zeros(shape[0], dtype=bool), np.zeros(shape), np.zeros(shape[0]))

    def share(self, weights: FloatArray, active: BoolArray) -> float:
        """Return the sliding part of the area of ``active`` nodes (n), whose own areas are ``weights`` (n)."""
        return float(weights[active & self.sliding].sum()) / float(weights[active].sum())

    def unsure(self, facets: IntArray, areas: FloatArray, active: BoolArray) -> float:
        """Return the area of the ``facets`` (m, k) in which sliding begins or ends, at least that of one.

        ``areas`` (m) are theirs. Beside the edge of contact tissue slides wherever friction is finite.
        """
        sticks, touches = (active & ~self.sliding)[facets], active[facets].any(axis=1)
        mixed = sticks.any(axis=1) & ~sticks.all(axis=1)
        return float(max(areas[mixed].sum(), areas[touches].mean()))

    def turning(self, most: FloatArray) -> FloatArray:
        """Return (n, t, t), the change of the unit vector with the trial traction, times ``most`` (n), the friction."""
        along = self.directions
        across = np.eye(along.shape[1]) - along[:, :, None] * along[:, None, :]
        share = np.clip(most / np.maximum(self.sizes, _TINY), 0.0, 1.0)
        return np.asarray(share[:, None, None] * across)

    def towards(self, other: "Slide", fraction: float) -> "Slide":
        """Return ``other`` with directions a ``fraction`` of the way from these, for those that swing to and fro."""
        middle = (1 - fraction) * self.directions + fraction * other.directions
        return replace(other, directions=np.where(self.sliding[:, None], middle, other.directions))

    def following(
        self,
        trial: FloatArray,
        most: FloatArray,
        active: BoolArray,
        neighbours: Neighbours,
        single_of: BoolArray | None = None,
    ) -> "Slide":
        """Return the next guess, from ``trial`` tractions (n, t) and the largest friction ``most`` (n).

        A node whose trial traction reverses would slide back and forth: it sticks. If ``single_of`` (n) are given, only
        the first of these that change does so: neighbours that change together may do so forever.
        """
        size = np.linalg.norm(trial, axis=1)
        reverses = np.einsum("nt,nt->n", trial, self.directions) < 0
        stays = (size > (1 - _SLACK) * most) & ~reverses
        sliding = np.where(self.sliding, stays, exceeds(trial, most)) & active
        if single_of is not None:
            changes = (sliding != self.sliding) & active & single_of & ~neighbours.is_corner
            sliding = np.where(changes & (np.cumsum(changes) > 1), self.sliding, sliding)
        sliding = neighbours.majority(sliding, active) & active
        sums, sizes = neighbours.sums(trial, sliding)
        return Slide(sliding, sums / np.maximum(sizes, _TINY)[:, None], sizes)


class Touching(Protocol):
    """Contact with friction at n nodes."""

    @property
    def active(self) -> BoolArray:
        """Nodes in contact (n)."""

    @property
    def slide(self) -> Slide | None:
        """How they slide."""

    @property
    def friction(self) -> FloatArray:
        """The tangential forces (n, d), N."""


def rubbing_of(candidates: Candidates, coefficient: float, fine: Touching, coarse: Touching) -> Rubbing:
    """Return the friction on ``candidates``, and its change to that of half as many load steps, ``coarse``.

    At an infinite ``coefficient`` tissue slides nowhere, by definition.
    """
    force, before = (candidates.size_of(each.friction) for each in (fine, coarse))
    change = abs(force - before)
    uneven = float(np.linalg.norm(fine.friction, axis=1).sum()) - force
    if coefficient == inf:
        return Rubbing(0.0, force, 0.0, change, 0.0, uneven)
    assert fine.slide is not None
    assert coarse.slide is not None
    share = fine.slide.share(candidates.weights, fine.active)
    other = coarse.slide.share(candidates.weights, coarse.active)
    unsure = fine.slide.unsure(candidates.facets, candidates.areas, fine.active)
    return Rubbing(share, force, abs(share - other), change, unsure, uneven)


@dataclass(frozen=True, eq=False)
class Simplified:
    """Nodes (n) that do not settle, by how often they ``entered`` or left the active set, or ``turned`` to sliding.

    Beyond a few times, friction is left out of the former, and the latter slide.
    """

    entered: IntArray
    turned: IntArray

    @staticmethod
    def none(count: int) -> "Simplified":
        """Return zero counts of ``count`` nodes."""
        nothing = np.zeros(count, dtype=np.int64)
        return Simplified(nothing, nothing)

    @property
    def nodes(self) -> BoolArray:
        """Mask of the nodes that slide whatever their traction."""
        return np.maximum(self.entered, self.turned) >= _CHANGES

    def counting(self, moves: BoolArray, turns: BoolArray) -> "Simplified":
        """Return the counts after an iteration in which these nodes (n) change."""
        return Simplified(self.entered + moves, self.turned + turns)

    def law(self, friction: float | FloatArray) -> FloatArray:
        """Return the coefficient of friction of each node."""
        return np.where(self.entered >= _CHANGES, 0.0, friction)

    def sliding(self, slide: Slide, active: BoolArray) -> Slide:
        """Return ``slide`` with these nodes sliding, if they are ``active``."""
        return replace(slide, sliding=(slide.sliding | self.nodes) & active)

    def steady(self, before: Slide, after: Slide) -> Slide:
        """Return the state ``after``, in which these nodes slide as ``before``: next to sticking, they reverse."""
        kept = self.nodes & before.sliding
        directions = np.where(kept[:, None], before.directions, after.directions)
        return replace(after, directions=directions, sizes=np.where(kept, before.sizes, after.sizes))


class Damping:
    """Shorter changes of the directions of slip, from some iteration on, where these do not settle.

    If q times a change follows it, 1 - s (1 - q) times it follows a share s of it: the share is the one after which
    nothing would have, 1 / (1 - q), in the mean of all nodes (B. Irons and R. Tuck, Int. J. Numer. Methods Eng. 1, 275,
    1969). Directions that creep are not hastened.
    """

    def __init__(self, begins: int):
        """Begin after ``begins`` iterations."""
        self._begins, self._share, self._before, self._slid = begins, 1.0, np.zeros(0), np.zeros(0, dtype=bool)

    def towards(self, before: Slide, after: Slide, iteration: int) -> Slide:
        """Return the next state: ``after``, with its directions some of the way from those ``before``."""
        slid, self._slid = self._slid, before.sliding & after.sliding
        change = after.directions - before.directions
        if iteration > self._begins:
            kept = (slid & self._slid)[:, None]
            last = np.where(kept, self._before, 0.0)
            lost = last - np.where(kept, change, 0.0)
            if (size := float(np.vdot(lost, lost))) > 0:
                self._share = min(max(self._share * float(np.vdot(last, lost)) / size, _LEAST), 1.0)
        self._before = change
        return before.towards(after, self._share)


def most_simplified(depth: float, deepest: float) -> float:
    """Return the largest share of the force on simplified nodes at a ``depth`` of a path to the ``deepest`` one (m).

    At a smaller depth, where few nodes touch, the share may be larger, since that force is smaller.
    """
    return _MOST_SIMPLIFIED * deepest / depth if depth else inf


def largest_friction(law: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the largest friction (n) in N, from coefficients ``law`` (n) and ``normal`` reactions (n)."""
    sticks = law == inf
    return np.where(sticks, inf, np.where(sticks, 0.0, law) * np.maximum(normal, 0.0))


def exceeds(traction: FloatArray, most: FloatArray) -> BoolArray:
    """Return whether each ``traction`` (n, t) is certainly larger than the largest friction ``most`` (n), N."""
    return np.asarray(np.linalg.norm(traction, axis=1) > (1 + _SLACK) * most)


def shortened(traction: FloatArray, most: FloatArray) -> FloatArray:
    """Return each ``traction`` (n, t), at most as large as the largest friction ``most`` (n), N."""
    return np.asarray(traction * np.minimum(most / np.maximum(np.linalg.norm(traction, axis=1), _TINY), 1.0)[:, None])
