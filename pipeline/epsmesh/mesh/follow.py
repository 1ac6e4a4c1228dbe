"""Elements on a CAD solid: their size along rounded edges, and mid nodes on the true faces.

Both query the geometry kernel while its model is open.
"""

from collections.abc import Iterable, Iterator
from math import ceil

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.model_arrays import corners_of, points_by_tag
from epsmesh.mesh.regions import PointSizes
from epsmesh.scene.model import Scene
from epsmesh.shapes.bodies.cad import FromCad
from epsmesh.shapes.triangles import half_edges

# Element size along a rounded edge, in units of its radius, and the least size as a share of the body.
_PER_RADIUS, _LEAST = 0.5, 1 / 100
# Distance to curves of the model is taken from points on them: points per element, and most points.
_POINTS, _MOST = 2, 4000
# Types of curves and faces that straight elements fit exactly.
_STRAIGHT = {1: "Line", 2: "Plane"}


def rounded_sizes(scene: Scene, growth: float) -> Iterator[str]:
    """Yield the element sizes for rounded edges, as text for gmsh; they grow by ``growth`` per unit of distance."""
    for size, curves in _rounded(scene):
        longest = max(gmsh.model.occ.getMass(1, curve) for curve in curves)
        distance = gmsh.model.mesh.field.add("Distance")
        gmsh.model.mesh.field.setNumbers(distance, "CurvesList", curves)
        points = min(_MOST, ceil(_POINTS * longest / size))
        gmsh.model.mesh.field.setNumber(distance, "NumPointsPerCurve", points)
        yield f"{size:.12g}+{growth:.12g}*F{distance}"


def rounded_points(scene: Scene, growth: float) -> Iterator[PointSizes]:
    """Yield the same sizes, for points of the rounded edges."""
    for size, curves in _rounded(scene):
        points = scene.scale * points_along(curves, size / _POINTS)
        yield PointSizes(scene.scale * size, points, growth)


def _rounded(scene: Scene) -> Iterator[tuple[float, list[int]]]:
    """Yield the element size, in the model's unit, along the rounded edges of each radius, and their curves."""
    body = scene.body
    if not isinstance(body, FromCad):
        return
    solid = body.solid
    for radius in np.unique(solid.radius[solid.radius < body.bend]):
        size = scene.units(max(_PER_RADIUS * float(radius), _LEAST * body.extent))
        if curves := _curves_of(scene.units(float(radius))):
            yield size, curves


def points_along(curves: Iterable[int], spacing: float) -> FloatArray:
    """Return points (n, 3) along curves of the model, about ``spacing`` apart, in its unit."""
    parts = []
    for curve in curves:
        (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
        count = min(_MOST, ceil(gmsh.model.occ.getMass(1, curve) / spacing)) + 1
        parts.append(np.array(gmsh.model.getValue(1, curve, np.linspace(start, end, count).tolist())).reshape(-1, 3))
    return np.vstack(parts)


def _boundary() -> list[tuple[int, int]]:
    """Return the faces of the model except those of inclusions."""
    return list(gmsh.model.getBoundary(gmsh.model.getEntities(3), combined=True, oriented=False))


def _curves_of(radius: float) -> list[int]:
    """Return the boundary curves of faces with a radius of curvature near ``radius``, in the model's unit."""
    found: set[int] = set()
    for dim, face in sorted(_boundary()):
        if gmsh.model.getType(dim, face) == _STRAIGHT[dim]:
            continue
        low, high = gmsh.model.getParametrizationBounds(dim, face)
        middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
        most = abs(float(gmsh.model.getCurvature(dim, face, middle)[0]))
        if most * radius > 0.5:
            found |= {abs(tag) for _, tag in gmsh.model.getBoundary([(dim, face)], oriented=False)}
    return sorted(found)


def middle_nodes(position: IntArray, scale: float) -> tuple[IntArray, FloatArray]:
    """Return the edges (k, 2) of elements on curved faces and curves of the body, and their mid nodes (k, 3), in m.

    ``position`` maps tags of the model, whose unit is ``scale`` metres, to point numbers. A mid node is the point of
    the face, or of the curve between faces, nearest to the middle of the straight edge.
    """
    at = points_by_tag()
    middle: dict[tuple[int, int], FloatArray] = {}
    curves: set[int] = set()
    for dim, face in _boundary():
        curves |= {abs(tag) for _, tag in gmsh.model.getBoundary([(dim, face)], oriented=False)}
        if gmsh.model.getType(dim, face) != _STRAIGHT[dim]:
            _put(middle, dim, face, half_edges(corners_of(dim, [face])), at)
    for curve in sorted(curves):
        pairs = corners_of(1, [curve])
        if gmsh.model.getType(1, curve) == _STRAIGHT[1]:
            for edge in np.sort(pairs, axis=1).tolist():
                middle.pop(tuple(edge), None)
        else:
            _put(middle, 1, curve, pairs, at)
    edges = np.array(list(middle), dtype=np.int64).reshape(-1, 2)
    return position[edges], scale * np.array(list(middle.values())).reshape(-1, 3)


def _put(middle: dict[tuple[int, int], FloatArray], dim: int, tag: int, pairs: IntArray, at: FloatArray) -> None:
    """Add the mid nodes of edges (k, 2) of elements on a face or a curve."""
    edges = np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int64)
    if not len(edges):
        return
    halves = at[edges].mean(axis=1)
    found, _ = gmsh.model.getClosestPoint(dim, tag, halves.ravel().tolist())
    points = np.array(found).reshape(-1, 3)
    # A point half an edge away is on another sheet of the surface: a straight element is better.
    lengths = np.linalg.norm(at[edges[:, 0]] - at[edges[:, 1]], axis=1)
    near = np.linalg.norm(points - halves, axis=1) < 0.5 * lengths
    for edge, point in zip(edges[near].tolist(), points[near], strict=True):
        middle[(edge[0], edge[1])] = point
