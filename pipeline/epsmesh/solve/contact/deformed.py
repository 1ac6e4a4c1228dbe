"""Unilateral contact, of linear and other tissue: one Newton loop for the law and the active set together.

With the tissue's nodal forces R(w), and the tool's signed distance g and outward normal n at the deformed nodes,

    R(w) = λ n,    g >= 0,    λ >= 0,    λ g = 0    at the nodes that the tool may touch.

A step holds the normal displacement of active nodes at -g, and takes the turn of the normals into account: the tangent
is K - Σ λ H with H = ∂n/∂x. An active node whose predicted reaction pulls leaves the set, a node that penetrates enters
it. This is a semismooth Newton method (M. Hintermüller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 865, 2002).

The loop knows only nodes of a surface: a body in three dimensions and one in the half plane have the same interface.
Nodes that rest on a bed (:mod:`.bed`) are among them, with the distance of that.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from math import hypot, inf
from typing import NamedTuple

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve.contact.constraint import LEFT, Constraint
from epsmesh.solve.contact.friction_step import FrictionIteration, FrictionStep, Placed
from epsmesh.solve.contact.touching import SLACK, ContactSolution, NoTouchError, PlacedTool, Tissue
from epsmesh.solve.contact.turned import turned_frames
from epsmesh.solve.newton import HALVINGS, LargeError, Newton, advance, is_less

# Gap of active nodes at the end, in units of the depth.
_CLOSED = 1e-8
# A residual below this that no longer falls is the rounding error of a body that is large compared with the contact.
_ROUNDING = 1e-6
# With friction: the residual of nodes that slide, where their friction is that of the iteration before, and of others.
_LEFT_WITH_FRICTION, _LEFT_BESIDE = 1e-4, 1e-7
# The same in steps of time: where tissue relaxes while the tool is held, nodes slide and stick by turns, next to the
# limit of friction. The bar of the steps is larger by an order of magnitude.
_LEFT_IN_TIME = 3e-4
# A decrease below this share of the energy is rounding.
_NO_SLOPE = 1e-11
# Most iterations of a load step, and most times that one active set is solved.
_MOST, _MOST_REPEATS = 40, 7
# Most iterations with friction on linear tissue, where directions of slip settle last, and each is a small solve.
_MOST_LINEAR = 60
# Without patience: the least share of the first increment that may be taken, and the number of iterations after which
# gaps of active nodes are at most so large, in units of the depth.
_WHOLE, _SOON, _NEARLY_CLOSED = 0.5, 10, 1e-3
# A node certainly pulls or penetrates if it does so this many times as much as a step's prediction was wrong.
_CERTAIN = 10.0
# A set that is tried so often ends changes of many nodes at once.
_ONE_BY_ONE = 3


class Residual(NamedTuple):
    """Norms (N) of the residual inside the body, and at the nodes that the tool may touch."""

    inside: float
    on_surface: float

    @property
    def size(self) -> float:
        """The norm (N) of all."""
        return hypot(self.inside, self.on_surface)


def first_set(tissue: Tissue, tool: PlacedTool, active: BoolArray) -> BoolArray:
    """Return an initial active set: ``active`` nodes and all that the tool penetrates; collective."""
    through = tool.distance(tissue.positions()).gap < -tool.slack
    return tool.complete(active | through)


def solve_contact(
    tissue: Tissue,
    tool: PlacedTool,
    active: BoolArray,
    friction_step: FrictionStep | None = None,
    *,
    is_patient: bool = True,
    is_guess: bool = False,
    limit: float = 0.0,
    scale: float | None = None,
) -> ContactSolution:
    """Find equilibrium and contact from the tissue's state and an initial ``active`` set (n); collective.

    The set is corrected by what penetrates the tool in that state, unless it ``is_guess``, for the first step.
    Without ``friction_step`` there is no friction. Without patience, the loop ends where smaller load steps need fewer
    iterations. A residual and gaps below ``limit`` are enough, in units of the forces and the depth; nodes that pull or
    penetrate less may then still change the set. The tool must touch a node, unless the ``scale`` (N) of the contact
    forces is known, to which the residual is then compared.

    Raises:
        LargeError: if the loop does not converge; a NoTouchError, if the tool touches no node.
        SolveError: if a linear solver fails.
    """
    loop = _InContact(
        tissue, tool, active, friction_step, is_patient=is_patient, is_guess=is_guess, limit=limit, scale=scale
    )
    return loop.solve(_MOST_LINEAR if friction_step is not None and friction_step.is_linear else _MOST)


def continue_linear(tissue: Tissue, tool: PlacedTool, touched: ContactSolution, friction_step: FrictionStep) -> None:
    """Move linear tissue on to a ``tool``, with the contact and the states of friction before; collective.

    Raises:
        SolveError: if a linear solver fails.
    """
    place, placed = _placed(tissue, tool)
    constraint = _constraint(place, placed.normal, touched.pressed, touched.active)
    tissue.linearise(FrictionIteration(friction_step).constrain(constraint, placed, touched.active))
    tissue.advance(1.0)


class _InContact(Newton[ContactSolution]):
    """The iterations of :func:`solve_contact`: the ``active`` set, what was predicted, and the sets seen."""

    def __init__(
        self,
        tissue: Tissue,
        tool: PlacedTool,
        active: BoolArray,
        friction_step: FrictionStep | None,
        *,
        is_patient: bool,
        is_guess: bool,
        limit: float,
        scale: float | None,
    ):
        self._tissue, self._tool, self._active = tissue, tool, active
        self._friction = None if friction_step is None else FrictionIteration(friction_step)
        self._is_patient, self._is_guess, self._limit, self._scale = is_patient, is_guess, limit, scale
        self._predicted, self._reactions = np.zeros(tissue.fixed.shape), np.full(len(active), np.inf)
        self._before, self._repeats, self._seen = inf, 0, Counter([active.tobytes()])
        self._refuted = set[bytes]()

    def judge(self, iteration: int) -> ContactSolution | None:
        """Evaluate the state and take the next set; return the solution if that is one; collective.

        Raises:
            LargeError: if the loop will not converge.
        """
        tissue, tool, before = self._tissue, self._tool, self._active
        self._place, self._there = _placed(tissue, tool)
        normal, forces = self._there.normal, tissue.forces()
        is_first = self._is_guess and iteration == 0
        slack = tool.slack_of(self._repeats)
        following = before if is_first else _next_set(tool, before, self._reactions, self._place.gap, slack)
        along = np.einsum("ni,ni->n", forces, normal)
        if iteration and self._is_refuted(before, following, along):
            self._refuted.add(before.tobytes())
        self._active = active = self._with_care(before, following)
        if self._floats:
            raise NoTouchError("a jaw, or a support, does not touch a single node: use smaller elements next to it")
        is_same, is_rough = np.array_equal(active, before), self._limit > 0
        self._is_tried = iteration == 0 or not is_same
        # A rough solution has the next set: forces of nodes that leave it are residuals.
        pressing = before & active if is_rough else before
        self._pressed = np.where(pressing, along, 0.0)
        exerted = self._exerted(iteration, forces, before)
        if is_same and self._scale is None and not tool.touches(active):
            raise NoTouchError("the probe does not touch a single node: use smaller elements below it")
        residual = Residual(tissue.unbalanced(), float(np.linalg.norm(forces - exerted)))
        enough = max(self._limit, _ROUNDING) if residual.size > self._before / 2 else self._limit
        self._before = residual.size
        # An initial guess may be an equilibrium whose tool pulls: no reaction was predicted yet.
        pulls = iteration == 0 and (is_rough or _pulls(tool, active, self._pressed))
        if (is_same or is_rough) and not pulls and self._is_converged(residual, enough):
            return self._solution(iteration, forces)
        self._check_patience(iteration)
        if not is_same:
            self._count()
        return None

    def step(self, iteration: int) -> None:
        """Take Newton's step with the set; collective.

        Raises:
            LargeError: if it turns tissue inside out.
            SolveError: if a linear solver fails.
        """
        active, normal = self._active, self._there.normal
        constraint = _constraint(self._place, normal, np.where(active, self._pressed, 0.0), active)
        resting = self._tool.resting
        if resting is not None:
            constraint = replace(constraint, resting=resting.nodes)
        constraint = replace(constraint, is_there=self._is_closed, is_tried=self._is_tried, left=max(LEFT, self._limit))
        if self._friction is not None:
            constraint = self._friction.constrain(constraint, self._there, active)
        elif resting is not None:
            constraint = constraint.sticking(resting.stick & active, resting.anchors - self._there.positions)
        self._predicted = np.where(self._tissue.fixed, 0.0, self._tissue.linearise(constraint))
        self._reactions = np.einsum("ni,ni->n", self._predicted, normal)
        if advance(self._tissue, HALVINGS, self._descent()) < _WHOLE and iteration == 0 and not self._is_patient:
            raise LargeError("the load step turns tissue inside out")

    def _with_care(self, active: BoolArray, following: BoolArray) -> BoolArray:
        """Return the ``following`` set with single changes where sets repeat, and without followers that alternate.

        A follower that enters may push its neighbours out, leave with them, and enter when they return: followers enter
        only if the set with them is not refuted, and was not tried too often. There is an end to that. Between such
        entries, the sets are those of a linear complementarity problem at each linearisation, in which single changes,
        the first one each, cannot repeat (K. G. Murty, Opsearch 11, 42, 1974).
        """
        tool, followers = self._tool, self._tool.followers
        if self._repeats >= _ONE_BY_ONE:
            changes = np.flatnonzero((active != following) & ~followers)
            following = active.copy()
            following[changes[:1]] ^= True
            following = tool.complete(following)
        key = following.tobytes()
        if key in self._refuted or self._seen[key] >= _ONE_BY_ONE:
            following = following & (active | ~followers)
        return following

    def _is_refuted(self, before: BoolArray, following: BoolArray, along: FloatArray) -> bool:
        """Return whether a step shows that its set ``before`` is not that of contact, with normal forces ``along`` (n).

        A node certainly pulls or penetrates: by much more than what the step did not foresee, or left unsolved. On
        linear tissue it foresees all.
        """
        changed = (before != following) & ~self._tool.followers
        leaving, entering, gap = changed & before, changed & following, self._place.gap
        missed = np.abs(along - self._reactions)[leaving] + self._tissue.unbalanced()
        pull = -self._reactions[leaving]
        left_open = np.abs(gap[before]).max(initial=0.0)
        return bool((pull > _CERTAIN * missed).any() or (-gap[entering] > _CERTAIN * left_open).any())

    def _descent(self) -> Callable[[float], bool] | None:
        """Return what tells whether a share of the increment reduces the energy enough; None if that is not compared.

        With the predicted reactions λ, it is the energy less λ·g: its slope is that of the linear system. Forces of
        friction have no energy.
        """
        tissue, tool, slope = self._tissue, self._tool, self._tissue.slope
        if slope is None or self._friction is not None or not self._is_closed:
            return None
        reactions = np.where(self._active, self._reactions, 0.0)
        gained = float(reactions @ self._place.gap)
        stored, slope = tissue.energy - gained, slope - gained
        if slope <= _NO_SLOPE * abs(tissue.energy):
            return None

        def falls(fraction: float) -> bool:
            gap = tool.distance(tissue.positions()).gap
            return is_less(tissue.energy - float(reactions @ gap), stored, fraction, slope)

        return falls

    def _exerted(self, iteration: int, forces: FloatArray, before: BoolArray) -> FloatArray:
        """Return the forces (n, d) of the tool on nodes of the set ``before``; the state of friction follows."""
        exerted = self._pressed[:, None] * self._there.normal
        if self._friction is None:
            if (resting := self._tool.resting) is not None:
                exerted = np.where((resting.stick & before)[:, None], forces, exerted)
            return exerted
        if iteration:
            self._friction.update(iteration, self._there, self._predicted, before, self._active)
        return np.asarray(exerted + self._friction.exerted(self._there, forces, before))

    def _is_converged(self, residual: Residual, limit: float) -> bool:
        most = max(float(np.linalg.norm(self._pressed)), self._scale or 0.0)
        if not self._open <= max(_CLOSED, limit) * self._tool.depth:
            return False
        if self._friction is None:
            return residual.size <= max(LEFT, limit) * most
        on_surface = _LEFT_WITH_FRICTION if self._scale is None else _LEFT_IN_TIME
        on_surface = _LEFT_BESIDE if self._friction.is_linear else on_surface
        is_close = residual.inside <= _LEFT_BESIDE * most and residual.on_surface <= on_surface * most
        return is_close and self._friction.is_judged

    @property
    def _open(self) -> float:
        """The largest gap (m) of active nodes, and the largest slip of those that are held where they stick."""
        found, resting = float(np.abs(self._place.gap[self._active]).max(initial=0.0)), self._tool.resting
        if resting is not None and self._friction is None:
            held = self._active & resting.stick
            slips = self._there.slips(resting.anchors)[held]
            found = max(found, float(np.linalg.norm(slips, axis=1).max(initial=0.0)))
        return found

    @property
    def _floats(self) -> bool:
        """Whether nothing would hold the body in the next step: a jaw or a support touches no node."""
        resting = self._tool.resting
        return resting is not None and not all(bool((self._active & own).any()) for own in resting.holds)

    @property
    def _is_closed(self) -> bool:
        """Whether active nodes are next to the tool."""
        return self._open <= _NEARLY_CLOSED * self._tool.depth

    def _solution(self, iteration: int, forces: FloatArray) -> ContactSolution:
        active, friction = self._active, self._friction
        if friction is not None and not friction.is_sound(active):
            raise LargeError("the states of nodes with friction repeat")
        exerted, slide = np.where(active[:, None], forces, 0.0), None if friction is None else friction.slide
        return ContactSolution(active, exerted, self._place.gap, iteration, self._there.normal, slide)

    def _check_patience(self, iteration: int) -> None:
        if not self._is_patient and iteration >= _SOON and not self._is_closed:
            raise LargeError(f"no equilibrium is near after {iteration} iterations")

    def _count(self) -> None:
        """Count how often a new set was seen; friction leaves nodes that do not settle."""
        key = self._active.tobytes()
        self._seen[key] += 1
        self._repeats = max(self._repeats, self._seen[key])
        if self._repeats >= _MOST_REPEATS and self._friction is None:
            raise LargeError("active sets repeat")


def _placed(tissue: Tissue, tool: PlacedTool) -> tuple[Distance, Placed]:
    """Return distance and place of the nodes."""
    positions = tissue.positions()
    place = tool.distance(positions)
    return place, Placed(positions, _within_planes(place.normal, tissue.fixed))


def _constraint(place: Distance, normal: FloatArray, pressed: FloatArray, active: BoolArray) -> Constraint:
    held = np.zeros(normal.shape, dtype=bool)
    held[:, -1] = active
    values = np.zeros(normal.shape)
    values[active, -1] = -place.gap[active]
    turning = np.maximum(pressed, 0.0)[:, None, None] * place.curvature
    return Constraint(turned_frames(normal, active), held, values, turning, np.zeros(normal.shape))


def _next_set(
    tool: PlacedTool, active: BoolArray, reactions: FloatArray, gap: FloatArray, slack: float | FloatArray
) -> BoolArray:
    """Return active nodes under pressure, and inactive nodes that penetrate the tool by more than the ``slack`` (m)."""
    pull = -SLACK * float(np.abs(reactions[active]).mean()) if active.any() else 0.0
    following = np.where(active, reactions > pull, gap < -slack)
    return tool.complete(following)


def _pulls(tool: PlacedTool, active: BoolArray, pressed: FloatArray) -> bool:
    """Return whether the tool pulls at an active node whose force ``pressed`` (n), N, means something."""
    forces = pressed[active & ~tool.followers]
    return bool((forces < -SLACK * np.abs(forces).mean()).any()) if len(forces) else False


def _within_planes(normal: FloatArray, fixed: BoolArray) -> FloatArray:
    """Return unit normals without their components across planes of symmetry, which are zero but for rounding."""
    normal = np.where(fixed, 0.0, normal)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None])
