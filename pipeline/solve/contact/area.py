"""How large the area of contact is, between nodes as well.

Beside it the surfaces part by o ~ x^{3/2} at a distance x from its edge, wherever the probe's surface is smooth there.
The areas on which o^{2/3} is below a level are those of lines parallel to the edge: a polynomial of degree 2 in the
level, of which the value at 0 is looked for. Nodes within the contact do not tell as much: of corners, even well
inside, many carry no load.
"""

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.contact.sets import Obstacle, State
from pipeline.solve.contact.surface import Candidates

# Levels up to which parallel lines are looked at, in units of the smallest that is clear of cells with the edge in
# them, and how many.
_REACH, _LEVELS = 2.5, 9
# What parallel lines say is taken if it is that near to what the mid nodes say, relative.
_NEAR = 0.15


def contact_area(obstacle: Obstacle, active: BoolArray, state: State) -> float:
    """Return the area (m², normal to the axis) that touches, of the part that is modelled."""
    candidates, bounds = obstacle.candidates, obstacle.bounds
    counted = float((candidates.areas * active[candidates.facets[:, 3:]].mean(axis=1)).sum())
    beside = np.where(active, 0.0, np.maximum(bounds - state.moved, 0.0) ** (2 / 3))
    drawn = _between_parallels(candidates, beside)
    return drawn if abs(drawn - counted) <= _NEAR * counted else counted


def _between_parallels(candidates: Candidates, beside: FloatArray) -> float:
    """Return the area within the line to which those at equal ``beside`` (n) tend, infinite if there are too few."""
    values = np.sort(beside[candidates.quarters], axis=1)
    crossed = (values[:, 0] == 0) & (values[:, 2] > 0) & np.isfinite(values[:, 2])
    if not crossed.any():
        return np.inf
    first = values[crossed, 2].max()
    if np.count_nonzero(beside[np.isfinite(beside)] > _REACH * first) < _LEVELS:
        return np.inf
    levels = np.linspace(first, _REACH * first, _LEVELS)
    areas = [float(candidates.quarter_areas @ _share_below(values - level)) for level in levels]
    return float(np.polyfit(levels / first, areas, 2)[-1])


def _share_below(values: FloatArray) -> FloatArray:
    """Return the shares of triangles in which what is linear between ascending corner ``values`` (k, 3) is negative."""
    low, middle, high = values.T
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = low**2 / ((low - middle) * (low - high))
        rest = np.where(np.isfinite(high), 1 - high**2 / ((high - low) * (high - middle)), 0.0)
    return np.asarray(np.select([high <= 0, middle < 0, low < 0], [1.0, rest, corner], 0.0))
