"""The surface of a tool that is not flat, for pictures."""

import numpy as np
import pyvista as pv

from pipeline.arrays import FloatArray
from pipeline.shapes.frame import Frame
from pipeline.shapes.indenter import Indenter

# Lines over the surface, and the points of each.
_LINES, _POINTS = 97, 120
# How far lines go, in units of what the tool may touch: round the axis, up to where it ends; across a long tool.
_ROUND, _ACROSS = 4.0, 1.5


def tool_surface(probe: Indenter, frame: Frame, length: float) -> pv.PolyData:
    """Return what of a tool is at most ``length`` (m) above its lowest point, before it is pushed in; in m."""
    places = frame.world(tool_points(probe, length).reshape(-1, 3)).reshape(_LINES, -1, 3)
    grid = pv.StructuredGrid(*(places[None, :, :, k] for k in range(3)))
    return grid.extract_surface(algorithm="dataset_surface")


def tool_points(probe: Indenter, length: float) -> FloatArray:
    """Return lines (k, n, 3) over its surface, in m and the probe's own coordinates: from the axis, or across it."""
    if probe.is_round:
        directions = (np.array([np.cos(a), np.sin(a)]) for a in np.linspace(0, 2 * np.pi, _LINES))
        farthest = _ROUND * probe.circumradius
        return np.array([_line(probe, np.zeros(2), farthest * direction, length) for direction in directions])
    along, across = probe.outline().max(axis=0)
    sides = np.array([0.0, _ACROSS * across])
    starts = (np.array([x, 0.0]) for x in np.linspace(-along, along, _LINES))
    return np.array(
        [np.vstack([_line(probe, s, -sides, length)[::-1], _line(probe, s, sides, length)]) for s in starts]
    )


def _line(probe: Indenter, start: FloatArray, along: FloatArray, length: float) -> FloatArray:
    """Return points (n, 3) from ``start`` on ``along`` the surface; where it ends, or the line, straight up."""
    ray = start + np.linspace(0.0, 1.0, _POINTS)[:, None] * along
    heights = probe.profile(ray)
    last = np.flatnonzero(heights <= length)[-1]
    ray[last:], heights[last + 1 :] = ray[last], length
    return np.vstack([np.column_stack([ray, heights]), [*ray[-1], length]])
