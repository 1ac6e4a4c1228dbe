"""Unilateral contact with friction in a linear elastic body.

Contact without friction is found first. The surface near it is then condensed, all three components of its nodes, and
the load path of the tool is followed there, in steps whose depths go with the square of their numbers: the contact of a
ball grows by equal widths. As in linear elasticity, the normal of the contact is the tool's axis.

The error bar is that of frictionless contact on the same mesh, plus the change of the force from half as many load
steps, plus a share of what friction adds.

A far field on a cut face adds φ φᵀ / k to the compliance, with all components of its unit φ
(:mod:`epsmesh.solve.contact.elements`). The friction of a tool that presses along its axis has no resultant: its far
field, which is neglected, decays by one order faster than that of the pressure, as under a bonded footprint.
"""

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve.contact.active_set import ContactError
from epsmesh.solve.contact.condensed import CondensedTissue
from epsmesh.solve.contact.contact_steps import ContactPath, ContactPathPoint, Friction, reach_contact_with_friction
from epsmesh.solve.contact.coulomb import Slide
from epsmesh.solve.contact.found import LinearContact, Rubbed
from epsmesh.solve.contact.surface import Candidates, Neighbours
from epsmesh.solve.contact.touching import SLACK, ContactSolution, PlacedTool
from epsmesh.solve.newton import LargeError

# Steps of a load path.
_STEPS = 16
# Facets round the frictionless contact whose nodes are condensed, too.
_RINGS = 2
_ADVANCE = np.array([0.0, 0.0, -1.0])


def rub(contact: LinearContact) -> LinearContact:
    """Return a ``contact`` without friction with the friction of its tool; collective.

    Raises:
        SolveError: if the factorisation fails.
        ContactError: if a load step does not settle.
    """
    sweep, obstacle, friction = contact.sweep, contact.obstacle, contact.tool.friction
    candidates, depth = obstacle.candidates, obstacle.depth
    body, neighbours = sweep.elements.without_tool, candidates.neighbours
    is_free, far = body.is_free(), sweep.elements.far
    of_unit = np.zeros(is_free.shape) if far is None else body.gathered(far.unit.unknowns[0])
    stiffness = inf if far is None else far.stiffness
    reachable = np.isfinite(obstacle.bounds) & is_free[:, 2]
    touched = contact.smooth.active
    while True:
        near = neighbours.complete(_around(candidates, touched) & reachable) & reachable
        nodes = np.flatnonzero(near)
        components = np.argwhere(is_free & near[:, None])
        compliance = np.zeros((is_free[nodes].size,) * 2)
        free = np.flatnonzero(is_free[nodes])
        compliance[np.ix_(free, free)] = body.compliance(components)
        if far is not None:
            compliance += np.outer(of_unit[nodes], of_unit[nodes]) / stiffness
        tissue = CondensedTissue(compliance, candidates.points[nodes], ~is_free[nodes])
        heights, own = obstacle.bounds[nodes] + depth, neighbours.of(nodes)
        both = [_contact_in_steps(tissue, heights, own, depth, friction, steps) for steps in (_STEPS, _STEPS // 2)]
        fine, coarse = (_of_all(candidates, nodes, one) for one in both)
        moved, unknowns = body.moved(fine.forces)
        share = float((of_unit * fine.forces).sum()) / stiffness
        moved += share * of_unit
        gap = obstacle.bounds - moved[:, 2]
        through = (gap < -SLACK * depth) & reachable & ~near & ~neighbours.followers
        if not through.any():
            return replace(contact, rubbed=Rubbed(replace(fine, gap=gap), coarse, moved, unknowns, share))
        touched = touched | through


def _around(candidates: Candidates, active: BoolArray) -> BoolArray:
    """Return a mask (n) of candidates within some facets of the ``active`` ones."""
    found = active.copy()
    for _ in range(_RINGS):
        found[candidates.facets[found[candidates.facets].any(axis=1)]] = True
    return found


def _contact_in_steps(
    tissue: CondensedTissue, heights: FloatArray, neighbours: Neighbours, depth: float, friction: float, steps: int
) -> ContactSolution:
    """Return the equilibrium at a ``depth`` (m), reached in ``steps``; infinite ``friction`` sticks.

    ``heights`` (n) of the tool above the nodes, m, are those at first touch.

    Raises:
        ContactError: if no node touches, or a step does not settle however small it is.
    """

    def tool_at(amount: float) -> PlacedTool:
        def distance(points: FloatArray) -> Distance:
            return Distance.along_axis(heights - amount, points - tissue.places)

        return PlacedTool(distance, neighbours.complete, neighbours.followers, amount)

    tissue.state = np.zeros_like(tissue.state)
    path = ContactPath(ContactPathPoint(0.0, tissue.state))
    of = Friction(friction, _ADVANCE, tissue.penalty, neighbours, depth, is_linear=True)
    try:
        iterations = reach_contact_with_friction(tissue, tool_at, path, depth, of, steps)
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
    slide = Slide(
        *(spread(values) for values in (touched.slide.sliding, touched.slide.directions, touched.slide.sizes))
    )
    arrays = {name: spread(getattr(touched, name)) for name in ("active", "forces", "gap", "normal")}
    return replace(touched, **arrays, slide=slide)
