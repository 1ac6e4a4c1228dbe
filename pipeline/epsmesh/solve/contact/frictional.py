"""Unilateral contact with friction in a linear elastic body: response, slip, and error bar.

Contact without friction is found first. The surface near it is then condensed, all three components of its nodes, and
the load path of the tool is followed there (:mod:`epsmesh.solve.contact.friction_path`). As in linear elasticity, the
normal of the contact is the tool's axis.

The error bar is that of frictionless contact on the same mesh, plus the change of the force from half as many load
steps, plus a share of what friction adds.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.active_set import SLACK, Obstacle
from epsmesh.solve.contact.coulomb import Neighbours, Slide, rubbing_of
from epsmesh.solve.contact.elements import State, Unknowns
from epsmesh.solve.contact.found import FoundContact
from epsmesh.solve.contact.friction_path import STEPS, CondensedSurface, Step, press
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate, Solver
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.response import Contact, Response, reaction
from epsmesh.stages import stage

# Facets round the frictionless contact whose nodes are condensed, too.
_RINGS = 2
# Right-hand sides solved with one factorisation of mixed elements.
_TOGETHER = 128
# The bar on what friction adds to the force, as a share of it: benchmarks/results/friction.md.
_OF_FRICTION = 0.2
# Signs of the components: the tool advances along −z, x and y are tangents.
_COMPONENTS = np.array([2, 0, 1])
_SIGNS = np.array([-1.0, 1.0, 1.0])
# The solver is direct: its tolerance has no effect.
_EXACT = 1e-12


class SurfaceBody:
    """A linear elastic body, factorised, under forces on nodes of its surface; collective.

    ``nodes`` (k) are numbers of candidates; ``candidates`` are those of the elements.
    """

    def __init__(self, elements: Elements, law: MaterialLaw, local: IntArray, stack: ExitStack):
        """Factorise; ``local`` (n) are the local blocks of the candidates, −1 for those of other ranks.

        Raises:
            SolveError: if the factorisation fails.
        """
        self._elements, self._unit = elements, elements.unit(law)
        self._space = space = elements.displacements
        self._solver: Solver = elements.set_up(law, stack, direct=True, keep=False)
        dofs = 3 * local[:, None] + _COMPONENTS
        self._dofs = np.where((local[:, None] >= 0) & (dofs < space.owned), dofs, -1)

    def is_free(self) -> BoolArray:
        """Return a mask (n, 3) of the components that neither symmetry nor support fix."""
        own = self._dofs >= 0
        fixed = own & np.isin(self._dofs, self._space.prescribed_owned)
        return np.asarray(global_sum(self._space.comm, fixed.astype(float)) == 0)

    def moved(self, reactions: FloatArray) -> tuple[FloatArray, Unknowns]:
        """Return the displacements (n, 3) of all candidates and the unknowns, under ``reactions`` (n, 3) in N."""
        ((moved, unknowns),) = self._solved([reactions])
        return moved, unknowns

    @stage("condensation")
    def compliance(self, nodes: IntArray, is_free: BoolArray) -> FloatArray:
        """Return the compliance (k, 3, k, 3) of candidates ``nodes`` (k), symmetric; zero for what is not free."""
        count = len(nodes)
        found = np.zeros((count, 3, count, 3))
        pairs = np.argwhere(is_free[nodes])
        for first in range(0, len(pairs), _TOGETHER):
            some = pairs[first : first + _TOGETHER]
            units = np.zeros((len(some), len(self._dofs), 3))
            units[np.arange(len(some)), nodes[some[:, 0]], some[:, 1]] = 1.0
            for (node, axis), (moved, _) in zip(some, self._solved(units), strict=True):
                found[:, :, node, axis] = moved[nodes]
        found *= is_free[nodes][:, :, None, None]
        matrix = found.reshape(3 * count, 3 * count)
        return ((matrix + matrix.T) / 2).reshape(found.shape)

    def _solved(self, loads: Sequence[FloatArray] | FloatArray) -> list[tuple[FloatArray, Unknowns]]:
        """Return displacements (n, 3) of the candidates and unknowns for each of several ``loads`` (n, 3) in N."""
        own, space = self._dofs >= 0, self._space
        nothing = np.zeros(len(space.forms.displacement.x.array))
        with ExitStack() as stack:
            columns = []
            for load in loads:
                right, unknown = (stack.enter_context(self._elements.fields()) for _ in range(2))
                right[0].array[self._dofs[own]] = (_SIGNS * load)[own] / self._unit
                right[0].array[space.prescribed_owned] = 0.0
                columns.append(Column(prescribed=nothing, applied=None, right=right, unknown=unknown))
            self._solver.solve(columns, _EXACT)
            return [
                (self._gathered(column.unknown[0].array), tuple(np.array(part.array) for part in column.unknown))
                for column in columns
            ]

    def _gathered(self, values: FloatArray) -> FloatArray:
        own = self._dofs >= 0
        found = np.zeros(self._dofs.shape)
        found[own] = values[self._dofs[own]]
        return _SIGNS * global_sum(self._space.comm, found)


@dataclass(frozen=True, eq=False)
class FrictionalContact(FoundContact):
    """Contact with the friction of a ``tool``, beside the frictionless one that was ``found``.

    ``pressed`` is its equilibrium, nodes in the order of the candidates, and ``coarse`` that from half as many load
    steps. ``smooth`` and ``frictional`` are the unknowns without and with friction.
    """

    tool: Tool
    pressed: Step
    coarse: Step
    smooth: Unknowns
    frictional: Unknowns

    @property
    def stored(self) -> float:
        """The energy (J) of the modelled part: less than half the work of the force, since friction dissipates."""
        return self.pressed.energy

    @property
    def force(self) -> float:
        """The force (N) on the modelled part of the tool."""
        return self.pressed.force

    def summary(self, sag: float) -> Contact:
        """Return the area of the whole contact, and the part of it that slides."""
        candidates, step = self.obstacle.candidates, self.pressed
        torque = self.tool.torque(candidates.points, step.reactions[:, 1:])
        rubbing = rubbing_of(candidates, self.tool.friction, step, self.coarse)
        return super().summary(sag).with_friction(rubbing, torque, self._plug.body.mirrored)

    def response(self, column: Column, movement: Movement) -> Response:
        """Return the force at this depth as a stiffness, F/d, with its components across the axis."""
        space, (depth,) = self._plug.displacements, movement.amounts
        products = self._plug.products(self.sweep.law, [column])
        (moved,), (residual,) = products.moved, products.residuals
        local = np.array([residual.reshape(-1, 3)[space.fixed_owned, 2].sum(), moved @ residual])
        support, energy = global_sum(space.comm, depth * local * (1.0, depth))
        balance = max(abs(support / self.force - 1), abs(2 * self.pressed.energy / energy - 1))
        across = self.pressed.reactions[:, 1:].sum(axis=0)
        on_probe = np.array([[*across, -self.force]]) / depth
        return reaction(movement, np.array([[self.force / depth]]), on_probe, self._plug.body.mirrored, balance)

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the change of the force in one degree more, and its error bar."""
        (depth,) = movement.amounts
        self._plug.put(columns[0], self.smooth, depth)
        found = super().hierarchical_estimate(columns, movement, stack, keep=keep)
        self._plug.put(columns[0], self.frictional, depth)
        path_bar = abs(self.coarse.force / self.force - 1)
        return with_friction(found, path_bar, added=self.force / super().force - 1)

    def _touching(self) -> tuple[BoolArray, State]:
        step = self.pressed
        return step.active, State(-step.moved[:, 0], -step.reactions[:, 0], 2 * step.energy)


def with_friction(found: HierarchicalEstimate, path_bar: float, *, added: float) -> HierarchicalEstimate:
    """Return the estimate of frictionless contact with the bars of friction, which has ``added`` this to the force.

    ``path_bar`` is that of the load steps; both are shares of the force.
    """
    assert found.relative is not None
    of_friction = path_bar + _OF_FRICTION * abs(added)
    return replace(found, relative=found.relative + of_friction, friction_bar=of_friction)


def add_friction(contact: FoundContact, tool: Tool, smooth: Unknowns, stack: ExitStack) -> FrictionalContact:
    """Return the contact with the friction of a ``tool``, from the one without, whose unknowns are ``smooth``.

    Collective.

    Raises:
        SolveError: if the factorisation fails.
        ContactError: if a load step does not settle.
    """
    sweep, obstacle = contact.sweep, contact.obstacle
    elements, candidates = sweep.elements.plug, obstacle.candidates
    body = SurfaceBody(elements, sweep.law, sweep.elements.numbering.local, stack)
    is_free, reachable = body.is_free(), np.isfinite(obstacle.bounds)
    reachable &= is_free[:, 0]
    touched = contact.found.active
    while True:
        nodes = np.flatnonzero(_around(candidates, touched) & reachable)
        surface = _condensed(body, obstacle, nodes, is_free)
        steps = [press(surface, obstacle.depth, tool.friction, count) for count in (STEPS, STEPS // 2)]
        pressed, coarse = (_of_all(candidates, nodes, step) for step in steps)
        moved, frictional = body.moved(pressed.reactions)
        through = (-obstacle.bounds - moved[:, 0] > SLACK * obstacle.depth) & ~pressed.active & reachable
        through[nodes] = False
        if not through.any():
            break
        touched = touched | through
    known = {name: getattr(contact, name) for name in ("sweep", "obstacle", "found", "loaded", "obstacle_above")}
    return FrictionalContact(
        **known,
        tool=tool,
        pressed=replace(pressed, moved=moved),
        coarse=coarse,
        smooth=smooth,
        frictional=frictional,
    )


def _around(candidates: Candidates, active: BoolArray) -> BoolArray:
    """Return a mask (n) of candidates within some facets of the ``active`` ones."""
    found = active.copy()
    for _ in range(_RINGS):
        found[candidates.facets[found[candidates.facets].any(axis=1)]] = True
    return found


def _condensed(body: SurfaceBody, obstacle: Obstacle, nodes: IntArray, is_free: BoolArray) -> CondensedSurface:
    candidates = obstacle.candidates
    heights = obstacle.bounds[nodes] + obstacle.depth
    neighbours = Neighbours(candidates.is_corner[nodes], candidates.beside_corners(nodes))
    return CondensedSurface(body.compliance(nodes, is_free), heights, is_free[nodes], neighbours)


def _of_all(candidates: Candidates, nodes: IntArray, step: Step) -> Step:
    """Return a step of some ``nodes`` as one of all candidates."""

    def spread(values: FloatArray) -> FloatArray:
        found = np.zeros((len(candidates), *values.shape[1:]))
        found[nodes] = values
        return found

    active, sliding = (spread(mask.astype(float)) > 0 for mask in (step.active, step.slide.sliding))
    return replace(
        step,
        moved=spread(step.moved),
        reactions=spread(step.reactions),
        active=active,
        slide=Slide(sliding, spread(step.slide.trial)),
    )
