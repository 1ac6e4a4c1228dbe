"""Unilateral contact with friction in a linear elastic body.

Contact without friction is found first. The surface near it is then condensed, all three components of its nodes, and
the load path of the tool is followed there, in steps whose depths go with the square of their numbers: the contact of a
ball grows by equal widths. As in linear elasticity, the normal of the contact is the tool's axis.

The error bar is that of frictionless contact on the same mesh, plus the change of the force from half as many load
steps, plus a share of what friction adds.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.active_set import ContactError
from epsmesh.solve.contact.condensed import CondensedTissue
from epsmesh.solve.contact.contact_steps import ContactPath, ContactPathPoint, Friction, press_with_friction
from epsmesh.solve.contact.coulomb import Slide
from epsmesh.solve.contact.deformed import SLACK, ContactSolution, PlacedTool
from epsmesh.solve.contact.elements import Unknowns
from epsmesh.solve.contact.found import LinearContact, Rubbed
from epsmesh.solve.contact.surface import Candidates, Neighbours
from epsmesh.solve.elements.base import Elements, Solver
from epsmesh.solve.elements.fields import Column
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Steps of a load path.
STEPS = 16
# Facets round the frictionless contact whose nodes are condensed, too.
_RINGS = 2
# Right-hand sides solved with one factorisation of mixed elements.
_TOGETHER = 128
_ADVANCE = np.array([0.0, 0.0, -1.0])
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
        dofs = 3 * local[:, None] + np.arange(3)
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
                right[0].array[self._dofs[own]] = load[own] / self._unit
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
        return np.asarray(global_sum(self._space.comm, found))


def rub(contact: LinearContact, stack: ExitStack) -> LinearContact:
    """Return a ``contact`` without friction with the friction of its tool; collective.

    Raises:
        SolveError: if the factorisation fails.
        ContactError: if a load step does not settle.
    """
    sweep, obstacle, friction = contact.sweep, contact.obstacle, contact.tool.friction
    candidates, depth = obstacle.candidates, obstacle.depth
    body = SurfaceBody(sweep.elements.plug, sweep.law, sweep.elements.numbering.local, stack)
    is_free, neighbours = body.is_free(), candidates.neighbours
    reachable = np.isfinite(obstacle.bounds) & is_free[:, 2]
    touched = contact.smooth.active
    while True:
        near = neighbours.complete(_around(candidates, touched) & reachable) & reachable
        nodes = np.flatnonzero(near)
        tissue = CondensedTissue(body.compliance(nodes, is_free), candidates.points[nodes], ~is_free[nodes])
        surface = CondensedSurface(tissue, obstacle.bounds[nodes] + depth, neighbours.of(nodes))
        both = [press_condensed(surface, depth, friction, count) for count in (STEPS, STEPS // 2)]
        fine, coarse = (_of_all(candidates, nodes, one) for one in both)
        moved, unknowns = body.moved(fine.forces)
        gap = obstacle.bounds - moved[:, 2]
        through = (gap < -SLACK * depth) & reachable & ~near & ~neighbours.followers
        if not through.any():
            return replace(contact, rubbed=Rubbed(replace(fine, gap=gap), coarse, moved, unknowns))
        touched = touched | through


def _around(candidates: Candidates, active: BoolArray) -> BoolArray:
    """Return a mask (n) of candidates within some facets of the ``active`` ones."""
    found = active.copy()
    for _ in range(_RINGS):
        found[candidates.facets[found[candidates.facets].any(axis=1)]] = True
    return found


@dataclass(frozen=True, eq=False)
class CondensedSurface:
    """Condensed ``tissue`` below a tool, whose ``heights`` (n) above the nodes, m, are those at first touch."""

    tissue: CondensedTissue
    heights: FloatArray
    neighbours: Neighbours

    def tool_at(self, depth: float) -> PlacedTool:
        """Return the tool at a ``depth`` (m), with the gaps along its axis."""

        def distance(points: FloatArray) -> Distance:
            return Distance.along_axis(self.heights - depth, points - self.tissue.places)

        return PlacedTool(distance, self.neighbours.complete, self.neighbours.followers, depth)


def press_condensed(surface: CondensedSurface, depth: float, friction: float, steps: int = STEPS) -> ContactSolution:
    """Return the equilibrium at a ``depth`` (m), reached in ``steps``; infinite ``friction`` sticks.

    Raises:
        ContactError: if no node touches, or a step does not settle however small it is.
    """
    tissue, dim = surface.tissue, surface.tissue.places.shape[1]
    tissue.state = np.zeros_like(tissue.state)
    path = ContactPath(ContactPathPoint(0.0, tissue.state))
    of = Friction(friction, _ADVANCE[-dim:], tissue.penalty, surface.neighbours, depth, is_linear=True)
    try:
        iterations = press_with_friction(tissue, surface.tool_at, path, depth, of, steps)
    except LargeError as error:
        raise ContactError(
            f"contact with friction does not settle ({error}): use smaller elements below the probe, or less friction"
        ) from error
    assert path.last.touched is not None
    return replace(path.last.touched, iterations=iterations)


def _of_all(candidates: Candidates, nodes: IntArray, touched: ContactSolution) -> ContactSolution:
    """Return contact of some ``nodes`` as that of all candidates."""

    def spread(values: FloatArray | BoolArray) -> Any:
        found = np.zeros((len(candidates), *values.shape[1:]), values.dtype)
        found[nodes] = values
        return found

    assert touched.slide is not None
    slide = Slide(spread(touched.slide.sliding), spread(touched.slide.trial))
    arrays = {name: spread(getattr(touched, name)) for name in ("active", "forces", "gap", "pressed")}
    return replace(touched, **arrays, slide=slide)
