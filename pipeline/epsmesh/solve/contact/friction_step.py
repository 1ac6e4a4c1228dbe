"""Friction of contact, as a term of the loop of :mod:`epsmesh.solve.contact.deformed`.

Nodes that stick are held at a place of the tool, their reference; those that slide carry friction along the tool's
surface, which the next iteration corrects. The law is that of :mod:`epsmesh.solve.contact.coulomb`. Of a new node, the
reference is the place at which its predicted path meets the tool.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve.contact.constraint import Constraint, Sliding
from epsmesh.solve.contact.coulomb import Damping, Simplified, Slide, exceeds, largest_friction, shortened
from epsmesh.solve.contact.surface import Neighbours

# Iterations from which changes of the directions of slip are damped, and of Newton's method in linear tissue.
_SWINGING, _SWINGING_LINEAR = 4, 12
# Share of the force below which friction is no part of it.
_NO_PART = 1e-6


@dataclass(frozen=True, eq=False)
class FrictionStep:
    """Friction between n nodes and what they touch at one depth: the coefficient ``friction``, infinite for tissue
    that sticks, of all or of each (n).

    ``references`` (n, d) are places on the tool at this depth (m); ``penalty`` (n) is the parameter c (N/m). ``slide``
    and ``normal`` (n, N) are the state and the normal reactions at the equilibrium before. ``fixed`` (n, d) are the
    components that symmetry or the support fixes. ``simplified`` is the largest share of the force on nodes that do not
    settle. ``is_linear``: the tissue is, and solves for friction and reactions together.
    """

    friction: float | FloatArray
    references: FloatArray
    penalty: FloatArray
    neighbours: Neighbours
    slide: Slide
    normal: FloatArray
    fixed: BoolArray
    simplified: float
    is_linear: bool = False


class FrictionIteration:
    """The state of friction during the iterations of one equilibrium."""

    def __init__(self, friction_step: FrictionStep):
        self._with, self.slide, self.normal = friction_step, friction_step.slide, friction_step.normal
        self._wanted = self.slide  # by the law, undamped
        self._simple = Simplified.none(len(friction_step.normal))
        self.is_linear = friction_step.is_linear
        self._damping = Damping(_SWINGING_LINEAR if self.is_linear else _SWINGING)
        self._seen, self._single = set[bytes](), False
        self.is_judged = False  # with reactions of this step

    def update(self, iteration: int, place: "Placed", predicted: FloatArray, before: BoolArray, now: BoolArray) -> None:
        """Take the next state from ``predicted`` forces (n, d) N; active sets (n) are those ``before`` and ``now``."""
        self.normal = np.einsum("ni,ni->n", predicted, place.normal)
        friction_step, law = self._with, self._simple.law(self._with.friction)
        across = predicted - self.normal[:, None] * place.normal
        trial = across - friction_step.penalty[:, None] * place.slips(friction_step.references)
        most = largest_friction(law, self.normal)
        state = before.tobytes() + self.slide.sliding.tobytes()
        self._single = self._single or state in self._seen
        others = ~self._simple.nodes if self._single else None
        following = self.slide.following(trial, most, now, friction_step.neighbours, others)
        is_free = np.equal(self._with.friction, 0.0) & now
        after = self._simple.sliding(replace(following, sliding=following.sliding | is_free), now)
        moves = before != now
        turns = (after.sliding != self.slide.sliding) & ~moves
        if moves.any() or turns.any():
            self._seen.add(state)
        self._simple = self._simple.counting(moves, turns) if self._single else self._simple
        self.is_judged = True
        self._wanted = self._simple.steady(self.slide, after)
        self.slide = self._damping.towards(self.slide, self._wanted, iteration)

    def is_sound(self, active: BoolArray) -> bool:
        """Return whether nodes whose state was simplified carry little of the force, or friction no part of it."""
        if not active.any():
            return True
        simple = active & self._simple.nodes & ~self._with.neighbours.is_corner
        pressed = np.abs(self.normal)
        share = float(pressed[simple].sum()) / float(pressed[active].sum())
        return share <= self._with.simplified or float(np.max(self._with.friction)) * share <= _NO_PART

    def _friction(self, place: "Placed", slide: Slide) -> FloatArray:
        """Return the friction (n, d) N on nodes that ``slide``, zero on others.

        At corners, whose normal reactions may have any sign, it has that of the reaction: the sum then obeys the law.
        """
        law = self._simple.law(self._with.friction)
        most = largest_friction(law, self.normal)
        limited = np.less(self._with.friction, np.inf)
        most = np.where(limited & self._with.neighbours.is_corner, np.where(limited, law, 0.0) * self.normal, most)
        most = np.where(slide.sliding & (most < np.inf), most, 0.0)
        return np.where(self._with.fixed, 0.0, most[:, None] * _within(place, slide).directions)

    def exerted(self, place: "Placed", forces: FloatArray, active: BoolArray) -> FloatArray:
        """Return the friction (n, d) N that the law wants of nodes with these ``forces`` (n, d), N.

        It is the trial traction, shortened to the largest friction: nodes that stick beyond it, that slide and should
        stick, and directions that damping holds back are residuals. Corners and simplified nodes follow their state.
        """
        across = forces - np.einsum("ni,ni->n", forces, place.normal)[:, None] * place.normal
        trial = across - self._with.penalty[:, None] * self.slips(place)
        most = largest_friction(self._simple.law(self._with.friction), self.normal)
        is_given, sticks = self._with.neighbours.is_corner | self._simple.nodes, self.sticks(active)
        slides = np.where(is_given, ~sticks, exceeds(trial, most))
        sliding = np.where(is_given[:, None], self._friction(place, self._wanted), shortened(trial, most))
        wanted = np.where(slides[:, None], sliding, trial)
        return np.where(active[:, None] & ~self._with.fixed, wanted, 0.0)

    def constrain(self, constraint: Constraint, place: "Placed", active: BoolArray) -> Constraint:
        """Return a ``constraint`` with the tangents of sticking nodes held, and the friction on sliding ones."""
        held, values = constraint.held.copy(), constraint.values.copy()
        sticks = self.sticks(active)
        along = -np.einsum("nji,nj->ni", constraint.frames, self.slips(place))
        held[sticks, :-1] = True
        values[sticks, :-1] = along[sticks, :-1]
        sliding = self._sliding(place, active & ~sticks)
        return replace(constraint, held=held, values=values, forces=self._friction(place, self.slide), sliding=sliding)

    def _sliding(self, place: "Placed", nodes: BoolArray) -> Sliding:
        """Return the friction of ``nodes`` (n) that slide, linearised: that of corners and of simplified nodes is not
        turned by their own tractions."""
        law, slide = np.where(nodes, self._simple.law(self._with.friction), 0.0), _within(place, self.slide)
        is_given = self._with.neighbours.is_corner | self._simple.nodes
        most = np.where(is_given, 0.0, largest_friction(law, self.normal))
        penalty, slips = self._with.penalty, self.slips(place)
        return Sliding(nodes, law[:, None] * slide.directions, slide.turning(most), penalty, slips)

    def sticks(self, active: BoolArray) -> BoolArray:
        """Return a mask (n) of the nodes that stick."""
        law = self._simple.law(self._with.friction)
        return active & (~self.slide.sliding | (law == np.inf)) & np.greater(self._with.friction, 0.0)

    def slips(self, place: "Placed") -> FloatArray:
        """Return the slips (n, d) since the references, m."""
        return place.slips(self._with.references)


@dataclass(frozen=True, eq=False)
class Placed:
    """Deformed ``positions`` (n, d) of the nodes, and unit normals (n, d) of the tool there."""

    positions: FloatArray
    normal: FloatArray

    def slips(self, references: FloatArray) -> FloatArray:
        """Return the vectors (n, d) from ``references`` (n, d), along the tool's surface."""
        moved = self.positions - references
        return np.asarray(moved - np.einsum("ni,ni->n", moved, self.normal)[:, None] * self.normal)


def _within(place: Placed, slide: Slide) -> Slide:
    """Return a state with its directions turned along the tool's surface."""
    along = slide.directions
    return replace(slide, directions=along - np.einsum("ni,ni->n", along, place.normal)[:, None] * place.normal)


def meeting_places(
    gap: Callable[[FloatArray, float], FloatArray],
    paths: tuple[FloatArray, FloatArray],
    depths: tuple[float, float],
    advance: FloatArray,
) -> FloatArray:
    """Return the places (n, d) on the tool, at the second depth, which nodes meet on straight ``paths``.

    The tool moves along the unit vector ``advance``; ``gap`` returns distances (n) of places to it at a depth.
    """
    first, second = (gap(place, depth) for place, depth in zip(paths, depths, strict=True))
    share = np.clip(np.divide(first, first - second, out=np.ones_like(first), where=first - second > 0), 0.0, 1.0)
    moved = paths[1] - paths[0] - (depths[1] - depths[0]) * advance  # relative to the tool
    return np.asarray(paths[0] + (depths[1] - depths[0]) * advance + share[:, None] * moved)
