"""Contact with friction on a condensed surface: the load path of a tool that presses into a linear elastic body.

Friction depends on the way: a node that sticks keeps the place at which it met the tool. The depth therefore grows in
steps, with the square of the step's number, so that the contact of a ball grows by equal widths. Within a step, nodes
slip along one direction. The error is of first order in the step: the difference to half as many steps is its bar.

A new node's reference is where its predicted path meets the tool. The prediction is the solution for the contact area
of the step before.

Of a node at the edge of contact that enters and leaves the active set in turn, friction is left out for that step, and
a node that sticks and slides in turn slides. Both carry little of the force, or the step is halved.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve.contact.active_set import SLACK, ContactError
from epsmesh.solve.contact.coulomb import Damping, Neighbours, Simplified, Slide, largest_friction, most_simplified

# Steps of a load path, and further ones before the first.
STEPS, _BEFORE = 16, (0.25, 0.5, 0.75)
_MOST_ITERATIONS = 60
# Iterations after which changes of the direction of slip are damped.
_SWINGING = 12
# Tolerance on the friction of sliding nodes, in units of the mean normal reaction.
_CLOSE = 1e-7
_MOST_HALVINGS = 6


class Unsettled(ContactError):
    """The contact of a step does not settle."""


@dataclass(frozen=True, eq=False)
class CondensedSurface:
    """A surface under a tool: the ``compliance`` (n, c, n, c) of its nodes, in m/N, and their initial ``heights`` (n).

    Components are the tool's advance, against which reactions count, and c − 1 tangents. ``heights`` (m) are those of
    the tool above the nodes at first touch. ``is_free`` (n, c) is false for components that symmetry fixes.
    """

    compliance: FloatArray
    heights: FloatArray
    is_free: BoolArray
    neighbours: Neighbours

    def __len__(self) -> int:
        return len(self.heights)

    @property
    def penalty(self) -> FloatArray:
        """The parameter c (n) of the trial traction (N/m): the stiffness of a node alone."""
        nodes = np.arange(len(self))
        own = np.max([self.compliance[nodes, axis, nodes, axis] for axis in range(1, self.is_free.shape[1])], axis=0)
        return np.divide(1.0, own, out=np.zeros_like(own), where=own > 0)


@dataclass(frozen=True, eq=False)
class Step:
    """Equilibrium at a ``depth`` (m): ``moved`` (n, c, m), ``reactions`` (n, c, N) and the state of the nodes."""

    depth: float
    moved: FloatArray
    reactions: FloatArray
    active: BoolArray
    slide: Slide
    iterations: int = 0

    @property
    def force(self) -> float:
        """The force (N) on the tool against its advance."""
        return float(self.reactions[self.active, 0].sum())

    @property
    def tangential(self) -> FloatArray:
        """Sizes (n) of the tangential forces (N), with the sign of the normal reaction."""
        return np.asarray(np.sign(self.reactions[:, 0]) * np.linalg.norm(self.reactions[:, 1:], axis=1))

    @property
    def energy(self) -> float:
        """Strain energy (J) of the modelled part."""
        return float(np.einsum("nc,nc->", self.moved, self.reactions)) / 2


@dataclass(frozen=True)
class _Friction:
    """The ``coefficient`` of friction, and the depth (m) at the end of the path."""

    coefficient: float
    deepest: float


def press(surface: CondensedSurface, depth: float, friction: float, steps: int = STEPS) -> Step:
    """Return the equilibrium at a ``depth`` (m), reached in ``steps``; infinite ``friction`` sticks.

    Raises:
        ContactError: if no node touches, or a step does not settle however small it is.
    """
    count, components = surface.is_free.shape
    nothing = np.zeros(count, dtype=bool)
    free = np.zeros((count, components))
    step = Step(0.0, free, free, nothing, Slide(nothing, free[:, 1:]))
    iterations, law = 0, _Friction(friction, depth)
    for number in (*_BEFORE, *range(1, steps + 1)):
        step = _reach(surface, step, depth * (number / steps) ** 2, law, _MOST_HALVINGS)
        iterations += step.iterations
    if not step.active.any():
        raise ContactError("the probe does not touch a single node: use smaller elements below it")
    return replace(step, iterations=iterations)


def _reach(surface: CondensedSurface, before: Step, depth: float, friction: _Friction, halvings: int) -> Step:
    """Return the equilibrium at a ``depth`` (m), in one step or in halves of it."""
    try:
        return _advance(surface, before, depth, friction)
    except Unsettled:
        if not halvings:
            raise
        halfway = _reach(surface, before, (before.depth + depth) / 2, friction, halvings - 1)
        return _reach(surface, halfway, depth, friction, halvings - 1)


def _advance(surface: CondensedSurface, before: Step, depth: float, friction: _Friction) -> Step:
    pressed = depth - surface.heights
    active = before.active
    references = before.moved[:, 1:].copy()
    if active.any():
        law = np.full(len(surface), friction.coefficient)
        _, moved = _solved(surface, pressed, references, law, before)
        gap, closing = surface.heights - before.depth + before.moved[:, 0], before.moved[:, 0] - moved[:, 0]
        closing = closing + depth - before.depth
        share = np.clip(np.divide(gap, closing, out=np.ones_like(gap), where=closing > 0), 0.0, 1.0)
        new = ~active
        references[new] += (share[:, None] * (moved - before.moved)[:, 1:])[new]
    else:
        active = pressed > 0
        active = active | surface.neighbours.enclosed(active) & np.isfinite(pressed)
    if not active.any():
        return replace(before, depth=depth)
    return _settled(surface, replace(before, depth=depth, active=active), pressed, references, friction)


def _settled(
    surface: CondensedSurface, guess: Step, pressed: FloatArray, references: FloatArray, friction: _Friction
) -> Step:
    """Return the equilibrium with the tool ``pressed`` (n, m) below the nodes, and slip from ``references`` (n, t, m).

    Raises:
        Unsettled: if states repeat, or too much of the force is on nodes that are simplified.
    """
    step, simple = replace(guess, iterations=0), Simplified.none(len(surface))
    seen, single, damping = set[bytes](), False, Damping(_SWINGING, swings=True)
    for iteration in range(1, _MOST_ITERATIONS + 1):
        law = simple.law(friction.coefficient)
        step = replace(step, slide=simple.sliding(step.slide, step.active), iterations=iteration)
        reactions, moved = _solved(surface, pressed, references, law, step)
        step = replace(step, reactions=reactions, moved=moved)
        state = step.active.tobytes() + step.slide.sliding.tobytes()
        single = single or state in seen
        after = _following(surface, step, pressed, references, law, simple, single=single)
        moves = after.active != step.active
        turns = (after.slide.sliding != step.slide.sliding) & ~moves
        if not moves.any() and not turns.any() and _is_close(surface, step, after.slide, law, simple):
            if _share(surface, step, simple) > most_simplified(step.depth, friction.deepest):
                break
            return step
        if not after.active.any():
            break
        if moves.any() or turns.any():
            seen.add(state)
        simple = simple.counting(moves, turns) if single else simple
        after = replace(after, slide=simple.steady(step.slide, after.slide))
        step = replace(after, slide=damping.towards(step.slide, after.slide, iteration))
    raise Unsettled("contact with friction does not settle: use smaller elements below the probe, or less friction")


def _share(surface: CondensedSurface, step: Step, simple: Simplified) -> float:
    """Return the share of the force on simplified nodes, without corners, whose state is that of their neighbours."""
    there = step.active & simple.nodes & ~surface.neighbours.is_corner
    return float(np.abs(step.reactions[there, 0]).sum()) / step.force


def _following(
    surface: CondensedSurface,
    step: Step,
    pressed: FloatArray,
    references: FloatArray,
    law: FloatArray,
    simple: Simplified,
    *,
    single: bool,
) -> Step:
    """Return the next guess of the states of the nodes, from the solution for the last one."""
    normal, slips = step.reactions[:, 0], step.moved[:, 1:] - references
    pull = SLACK * float(np.abs(normal[step.active]).mean())
    enters = pressed - step.moved[:, 0] > SLACK * step.depth
    active = np.where(step.active, normal > -pull, enters)
    active = active | surface.neighbours.enclosed(active) & np.isfinite(pressed)
    trial = step.reactions[:, 1:] - surface.penalty[:, None] * slips
    slide = step.slide.following(trial, largest_friction(law, normal), active, surface.neighbours, single=single)
    return replace(step, active=active, slide=simple.sliding(slide, active))


def _is_close(surface: CondensedSurface, step: Step, after: Slide, law: FloatArray, simple: Simplified) -> bool:
    """Return whether the friction of sliding nodes, with the directions ``after``, is Coulomb's."""
    where = step.slide.sliding & after.sliding & ~simple.nodes & ~surface.neighbours.is_corner
    wanted = largest_friction(law, step.reactions[:, 0])[where, None] * after.directions[where]
    off = np.abs(step.reactions[where, 1:] - wanted).max(initial=0.0)
    return bool(off <= _CLOSE * np.abs(step.reactions[step.active, 0]).mean())


def _solved(
    surface: CondensedSurface,
    pressed: FloatArray,
    references: FloatArray,
    law: FloatArray,
    step: Step,
) -> tuple[FloatArray, FloatArray]:
    """Return reactions (n, c) and displacements (n, c) for the states of the nodes in ``step``; one Newton iteration.

    Active nodes move with the tool along its advance. Along tangents, those that stick keep their ``references``; those
    that slide have the friction of the coefficient ``law`` (n), linearised at the reactions of ``step``.
    """
    active, slide, normal = step.active, step.slide, step.reactions[:, 0]
    count, components = surface.is_free.shape
    held = np.flatnonzero(active)
    compliance = surface.compliance[held][:, :, held]
    rows = compliance.copy()
    right = np.column_stack([pressed[held], references[held]])
    (sliding,) = np.nonzero(slide.sliding[held] & (law[held] < inf))
    if len(sliding):
        nodes, places = held[sliding], np.arange(len(sliding))
        turning = slide.turning(largest_friction(law, normal))[nodes]
        turning[surface.neighbours.is_corner[nodes]] = 0.0
        pull = surface.penalty[nodes][:, None, None] * turning
        own = np.eye(components - 1) - turning
        equations = np.einsum("kij,kjlm->kilm", pull, compliance[sliding, 1:])
        equations[places, :, sliding, 1:] += own
        friction = law[nodes, None] * slide.directions[nodes]
        equations[places, :, sliding, 0] -= friction
        rows[sliding, 1:] = equations
        right[sliding, 1:] = np.einsum("kij,kj->ki", pull, references[nodes])
    free = np.flatnonzero(surface.is_free[held])
    size = len(held) * components
    solved: FloatArray = np.zeros(size)
    matrix = rows.reshape(size, size)
    solved[free] = np.linalg.solve(matrix[np.ix_(free, free)], right.ravel()[free])
    reactions = np.zeros((count, components))
    reactions[held] = solved.reshape(-1, components)
    moved = surface.compliance[:, :, held].reshape(count * components, size) @ solved
    return reactions, moved.reshape(count, components)
