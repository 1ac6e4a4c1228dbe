"""Smoothing: points within a mesh are moved so that its tetrahedra become more regular.

The shape of a tetrahedron is the sum of its squared edges, over its volume to the power 2/3: least, 12 · 3^(2/3), if it
is regular, and infinite if it is flat. It does not depend on size, so that the grading of a mesh stays (A. Liu, B. Joe,
BIT 34, 268, 1994). The sum of its squares over all cells is minimised, by gradients scaled point by point.
"""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.curve import interfaces
from epsmesh.mesh.generate import MeshArrays
from epsmesh.stages import stage

# Steps, and the share of the scaled gradient in each. Further steps change the mean shape by less than a hundredth.
_STEPS, _SHARE = 6, 0.65


@stage("smoothing")
def smoothed(mesh: MeshArrays) -> MeshArrays:
    """Return ``mesh``, of four nodes per cell, with moved points: those on its boundary and between regions stay."""
    free = np.zeros(len(mesh.points), dtype=bool)
    free[mesh.cells] = True
    for triangles in (*mesh.facets.values(), interfaces(mesh)):
        free[triangles] = False
    return replace(mesh, points=_moved(mesh.points, mesh.cells[free[mesh.cells].any(axis=1)], free))


def _moved(points: FloatArray, cells: IntArray, free: BoolArray) -> FloatArray:
    """Return points (n, 3) after some steps of descent, which end where a cell would have a negative volume."""
    at, corners = np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T)
    best, least = at, np.inf
    for _ in range(_STEPS + 1):
        total, direction = _total_and_direction(at, corners, free)
        if not total < least:
            break
        best, least = at, total
        at = at + _SHARE * direction
    return np.ascontiguousarray(best.T)


def _total_and_direction(at: FloatArray, corners: IntArray, free: BoolArray) -> tuple[float, FloatArray]:
    """Return the sum of squared shapes, infinite if a volume is negative, and the direction (3, n) of its descent.

    ``at`` (3, n) are the points, ``corners`` (4, m) those of each cell. The gradient is divided by the mean over
    directions of second derivatives, without mixed ones.
    """
    nodes = at.take(corners, axis=1)
    a, b, c = (nodes[:, i] - nodes[:, 0] for i in (1, 2, 3))
    slope = np.empty_like(nodes)  # of six times the volume
    for i, (u, v) in enumerate(((b, c), (c, a), (a, b)), start=1):
        for k in range(3):
            slope[k, i] = u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2]
    slope[:, 0] = -slope[:, 1:].sum(axis=1)
    volume = np.einsum("km,km->m", a, slope[:, 1])
    if not (volume > 0).all():
        return np.inf, np.zeros_like(at)
    unit, nodes = np.cbrt(volume) ** -2, nodes - nodes.mean(axis=1, keepdims=True)
    shapes = 4 * unit * np.einsum("kim,kim->m", nodes, nodes)
    gradient = 8 * unit * nodes - (2 / 3) * (shapes / volume) * slope
    second = 6 * unit + (10 / 27) * (shapes / volume**2) * np.einsum("kim,kim->im", slope, slope)
    second = 2 * shapes * second + (2 / 3) * np.einsum("kim,kim->im", gradient, gradient)
    gradient *= 2 * shapes
    where, count = corners.reshape(-1), at.shape[1]
    weight = np.bincount(where, second.reshape(-1), count)
    down = np.array([np.bincount(where, part.reshape(-1), count) for part in gradient])
    return float(shapes @ shapes), np.where(free, -down / np.where(free, weight, 1.0), 0.0)
