"""How large the area of contact is, between nodes as well.

Near the edge of contact, at a distance x from it, the pressure is p = K x^½ and the gap beside it o = (4 K / 3 E*)
x^{3/2}, wherever the probe's surface is smooth there (K. L. Johnson, Contact Mechanics, 1985, ch. 4 and 5). A node on
either side of the edge tells thus how far it is from the edge. It counts as in contact by the share of its own area
that the edge leaves within: area and radius vary smoothly as the edge passes nodes.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.contact.active_set import Obstacle, State

# K, in units of the mean pressure times (2 / a)^½, a the smaller semi-axis of contact: that of a ball.
_INTENSITY = 1.5
# The width of a node's own area, in units of the side of a square as large.
_WIDTH = 1.3
# The smaller semi-axis of a ball's contact is that many times the root of its pressure's mean x².
_SEMI_AXIS = 5**0.5
# Rounds in which K and the area that it depends on are found, and the change at which they end.
_ROUNDS, _SMALL = 60, 1e-9
# The 95 % bar on the area, in units of the area of nodes that share a facet with the edge: docs/accuracy.md.
_BAR = 0.07


@dataclass(frozen=True)
class Area:
    """An area of contact (m², normal to the axis) and its relative 95 % bar, of the elements' size alone."""

    value: float
    bar: float


def contact_area(
    obstacle: Obstacle, active: BoolArray, state: State, modulus: FloatArray, mirrored: tuple[int, ...] = ()
) -> Area:
    """Return the area that touches, of the part that is modelled, bounded by planes of symmetry across ``mirrored``.

    ``modulus`` (n) is E / (1 - ν²) of the tissue at each candidate (Pa).
    """
    candidates, weights = obstacle.candidates, obstacle.candidates.weights
    sure, near = float(weights[active].sum()), candidates.bordering(active) & (weights > 0)
    if not near.any():
        return Area(sure, 0.0)
    within = active[near]
    pressure = np.maximum(-state.reactions[near], 0.0) / weights[near] * within
    gap = np.maximum(obstacle.bounds[near] - state.moved[near], 0.0) * ~within
    force, width = -float(state.reactions[active].sum()), _WIDTH * candidates.widths[near]
    semi_axis = _semi_axis(candidates.points[:, :2], -np.where(active, state.reactions, 0.0), mirrored)
    inner = sure - float(weights[near][within].sum())
    area = sure or float(weights[near].sum())
    for _ in range(_ROUNDS):
        intensity = _INTENSITY * force / area * np.sqrt(2 / max(semi_axis, float(width.min())))
        inside = (pressure / intensity) ** 2 - (0.75 * modulus[near] * gap / intensity) ** (2 / 3)
        found = inner + float(weights[near] @ np.clip(0.5 + inside / width, 0.0, 1.0))
        if abs(found - area) <= _SMALL * area:
            break
        area = (area + found) / 2
    return Area(area, _BAR * float(weights[near].sum()) / area)


def _semi_axis(points: FloatArray, load: FloatArray, mirrored: tuple[int, ...]) -> float:
    """Return the smaller semi-axis (m) of the ellipse on which a ball's pressure has a ``load``'s moments."""
    points = points - np.where(np.isin([0, 1], mirrored), 0.0, load @ points / load.sum())
    moments = (points * load[:, None]).T @ points / load.sum()
    for axis in mirrored:
        moments[axis, 1 - axis] = moments[1 - axis, axis] = 0.0
    return _SEMI_AXIS * float(np.sqrt(max(np.linalg.eigvalsh(moments)[0], 0.0)))
