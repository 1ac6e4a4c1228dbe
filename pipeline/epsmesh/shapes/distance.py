"""Signed distance to a tool, for contact at the deformed place.

A tool is all that is above its profile: above the largest radius of its profile it goes on as a cylinder or a prism
(a ball is the end of a rod of its own radius, a cone that of its shaft). This is a convex region, so its signed
distance is the largest of the distances to all planes that touch it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.contour import Contour

# Points are on the axis, or in the plane of an edge, within this share of their height.
_ON_AXIS = 1e-9
# Newton's method for the height of a tool: most steps, the slope of a line that passes it, and the last step, in units
# of the extent of the points.
_MOST, _AWAY, _ROUNDING = 100, 1e-6, 1e-14
_DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Distance:
    """Signed distance of n points to a tool, with its derivatives.

    ``gap`` (n,), in m, is > 0 outside the tool and < 0 inside. ``normal`` (n, d) is its gradient: the tool's outward
    unit normal at the nearest point of its surface. ``curvature`` (n, d, d), in 1/m, is its Hessian. In a plane through
    the tool's axis d is 2, else 3.

    All are finite. Where the gradient is not unique - on the axis above a sharp tip, or above the centre of a rounded
    one - the gap is the distance along the axis, and the normal is the axis. Deeper in a rounding than half its radius
    the curvature is limited to twice that of the rounding. Sharp tips, edges and corners add no curvature: it would be
    unbounded where they touch.
    """

    gap: FloatArray
    normal: FloatArray
    curvature: FloatArray

    @staticmethod
    def along(direction: FloatArray, heights: FloatArray, moved: FloatArray) -> "Distance":
        """Return the distance of linear elasticity: that along a unit ``direction``, above places at rest.

        ``heights`` (n) are those of the tool there, ``moved`` (n, d) the displacements. There is one direction (d), or
        one at each point (n, d).
        """
        normal, curvature = (
            np.broadcast_to(-direction, moved.shape),
            np.broadcast_to(0.0, (*moved.shape, moved.shape[1])),
        )
        return Distance(heights - np.einsum("ni,ni->n", moved, -normal), normal, curvature)

    @staticmethod
    def along_axis(heights: FloatArray, moved: FloatArray) -> "Distance":
        """Return that along the last axis, the tool's."""
        dim = moved.shape[1]
        normal, curvature = np.broadcast_to(-np.eye(dim)[-1], moved.shape), np.broadcast_to(0.0, (*moved.shape, dim))
        return Distance(heights - moved[:, -1], normal, curvature)

    def turned(self, axes: FloatArray) -> "Distance":
        """Return it from coordinates with the unit vectors ``axes``, in rows (3, 3), in those of these vectors."""
        return Distance(self.gap, self.normal @ axes, axes.T @ self.curvature @ axes)


def heights_along(direction: FloatArray, distance: Callable[[FloatArray], Distance], points: FloatArray) -> FloatArray:
    """Return how far (n, m) a tool is from ``points`` (n, 3) along a unit ``direction``, less than 0 within it.

    Past the tool it is as far as it is from the outermost point. From before the tool on, its distance is a convex
    function, so that Newton's method does not pass its zero.
    """
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    heights, nearer = np.full(len(points), -extent), np.ones(len(points), dtype=bool)
    for _ in range(_MOST):
        found = distance(points + heights[:, None] * direction)
        slope = -found.normal @ direction
        nearer &= slope > _AWAY
        step = np.where(nearer, found.gap / np.maximum(slope, _AWAY), 0.0)
        heights = heights + step
        if np.abs(step).max() <= _ROUNDING * extent:
            break
    return np.where(nearer, heights, extent)


def revolved(contour: Contour, points: FloatArray) -> Distance:
    """Return the distance to the body of revolution of an ``contour``, from ``points`` (n, 3), in m."""
    radius = np.hypot(points[:, 0], points[:, 1])
    found = contour.distance(radius, points[:, 2])
    outward = points[:, :2] / np.maximum(radius, 1e-300)[:, None]
    aside, down = found.normal.T
    normal = np.column_stack([aside[:, None] * outward, down])
    slope = np.column_stack([-down[:, None] * outward, aside])
    hoop = np.column_stack([-outward[:, 1], outward[:, 0], np.zeros_like(radius)])
    # The radius at the nearest point of the surface; zero at a sharp tip.
    foot = radius - found.gap * aside
    around = np.where(foot > _ON_AXIS * radius, aside / np.maximum(np.maximum(radius, foot / 2), 1e-300), 0.0)
    curvature = _outer(slope, found.curvature) + _outer(hoop, around)
    return _along_axis(Distance(found.gap, normal, curvature), contour, radius, points[:, 2], np.diag([1.0, 1.0, 0.0]))


def extruded(contour: Contour, points: FloatArray) -> Distance:
    """Return the distance to an endless edge along the first coordinate, with ``contour`` on both of its sides."""
    beside = np.abs(points[:, 1])
    found = contour.distance(beside, points[:, 2])
    side, none = np.where(points[:, 1] < 0, -1.0, 1.0), np.zeros_like(beside)
    aside, down = found.normal.T
    normal = np.column_stack([none, side * aside, down])
    slope = np.column_stack([none, -down * side, aside])
    distance = Distance(found.gap, normal, _outer(slope, found.curvature))
    return _along_axis(distance, contour, beside, points[:, 2], np.diag([0.0, 1.0, 0.0]))


def slab(half: float, points: FloatArray, axis: int) -> Distance:
    """Return the distance to all that is within ``half`` (m) of zero in the coordinate ``axis``."""
    normal = np.zeros_like(points)
    normal[:, axis] = np.where(points[:, axis] < 0, -1.0, 1.0)
    return Distance(np.abs(points[:, axis]) - half, normal, np.zeros((*points.shape, 3)))


def above(points: FloatArray) -> Distance:
    """Return the distance to all that is above the height 0."""
    return Distance(-points[:, 2], np.tile(_DOWN, (len(points), 1)), np.zeros((*points.shape, 3)))


def intersection(*parts: Distance, rounding: float = 0.0) -> Distance:
    """Return the distance to what is inside all ``parts``, with the edges between them rounded to a radius (m).

    Their normals must be at right angles to each other wherever points are beyond more than one of them.
    """
    gaps, normals = np.stack([part.gap for part in parts]), np.stack([part.normal for part in parts])
    curvatures, points = np.stack([part.curvature for part in parts]), np.arange(gaps.shape[1])
    largest = gaps.argmax(axis=0)
    beyond = np.maximum(gaps + rounding, 0.0)
    is_beyond, length = beyond > 0, np.linalg.norm(beyond, axis=0)
    shares = beyond / np.where(length > 0, length, 1.0)
    several = is_beyond.sum(axis=0) > 1
    normal = np.where(several[:, None], np.einsum("kn,kni->ni", shares, normals), normals[largest, points])
    curvature = np.einsum(
        "kn,knij->nij", np.where(several, shares, largest == np.arange(len(parts))[:, None]), curvatures
    )
    if rounding:
        faces = np.einsum("kn,kni,knj->nij", is_beyond, normals, normals) - normal[:, :, None] * normal[:, None, :]
        curvature += (several / np.maximum(length, rounding / 2))[:, None, None] * faces
    return Distance(np.where(several, length - rounding, gaps[largest, points]), normal, curvature)


def _along_axis(
    distance: Distance, contour: Contour, beside: FloatArray, height: FloatArray, across: FloatArray
) -> Distance:
    """Return the distance with its values on the axis replaced by those along it."""
    on_axis = beside <= _ON_AXIS * np.abs(height)
    curvature = contour.curvature_at_axis(height)[:, None, None] * across
    return Distance(
        np.where(on_axis, -height, distance.gap),
        np.where(on_axis[:, None], _DOWN, distance.normal),
        np.where(on_axis[:, None, None], curvature, distance.curvature),
    )


def _outer(vectors: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the products (n, 3, 3) of vectors (n, 3) with themselves, with weights (n,)."""
    product: FloatArray = weights[:, None, None] * vectors[:, :, None] * vectors[:, None, :]
    return product
