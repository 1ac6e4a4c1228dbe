"""Preparation of a file's surface for the remesher: duplicates merged, cut at the support, sharp edges marked."""

from collections.abc import Callable

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.generate import MeshError
from epsmesh.mesh.organ.sheet import FIXED, FREE, WALL, Sheet, compact, edges_of, groups_of
from epsmesh.shapes.complex import OUTSIDE, TISSUE
from epsmesh.shapes.triangles import half_edges

# Points closer than this, in units of the surface's edges, are merged: remeshers drop such details.
_SAME = 0.05
# A point is moved along an edge onto the level within this share of the edge.
_NEAR = 0.02
# An edge is sharp if its facets, and those at some distance, meet at a larger angle (cosine).
_SHARP = 0.7


def merged(points: FloatArray, facets: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a closed surface with neighbouring points merged; points stay where merging would open the surface."""
    edges, _ = edges_of(facets)
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    near = edges[length < _SAME * np.median(length)]
    count = len(points)
    groups, label = connected_components(coo_array((np.ones(len(near)), tuple(near.T)), shape=(count, count)), False)
    if groups == count:
        return points, facets
    share = np.bincount(label, minlength=groups)
    middles = np.column_stack([np.bincount(label, points[:, k], minlength=groups) / share for k in range(3)])
    corners = label[facets].astype(np.int64)
    corners = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]
    # Two facets with the same corners, left when a detail between them has gone, cancel.
    _, first, number = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True)
    corners = corners[number[first.ravel()] == 1]
    try:
        edges_of(corners)
    except MeshError:
        return points, facets
    used = np.zeros(groups, dtype=bool)
    used[corners] = True
    return middles[used], (np.cumsum(used) - 1)[corners]


def cut(points: FloatArray, facets: IntArray, below: float, sides: IntArray | None = None) -> Sheet:
    """Return the surface with edges along the level ``below`` (m); its facets are free above and fixed below it.

    ``sides`` (m, 2) are the regions behind and before each facet, if the body is divided.
    """
    if sides is None:
        edges, _ = edges_of(facets)
        sides = np.tile([TISSUE, OUTSIDE], (len(facets), 1))
    else:
        edges = np.unique(np.sort(half_edges(facets), axis=1), axis=0)
    points = _moved_onto(points, edges, below)
    side = np.sign(points[:, 2] - below).astype(np.int64)
    crossing = edges[side[edges[:, 0]] * side[edges[:, 1]] < 0]
    z = points[crossing][:, :, 2] - below
    t = z[:, 0] / (z[:, 0] - z[:, 1])
    new = points[crossing[:, 0]] + t[:, None] * (points[crossing[:, 1]] - points[crossing[:, 0]])
    new[:, 2] = below
    count = len(points)
    keys = crossing[:, 0] * count + crossing[:, 1]  # sorted, as edges are
    number = dict(zip(keys.tolist(), range(count, count + len(keys)), strict=True))

    def middle(i: int, j: int) -> int:
        return number[min(i, j) * count + max(i, j)]

    low, high = side[facets].min(axis=1), side[facets].max(axis=1)
    whole = low * high >= 0
    pieces, groups = [facets[whole]], [np.where(low[whole] < 0, FIXED, FREE)]
    # A facet within the level is fixed if its normal points down: it is then a bottom, otherwise a top.
    flat = (low == 0) & (high == 0)
    normal_down = (
        np.cross(points[facets[:, 1]] - points[facets[:, 0]], points[facets[:, 2]] - points[facets[:, 0]])[:, 2] < 0
    )
    groups[0] = np.where((flat & normal_down)[whole], FIXED, groups[0])
    split, owners = [], [np.flatnonzero(whole)]
    for owner in np.flatnonzero(~whole):
        facet = facets[owner].tolist()
        parts = _split(facet, [int(side[i]) for i in facet], middle)
        split += parts
        owners.append(np.full(len(parts), owner))
    if split:
        array = np.array(split, dtype=np.int64)
        pieces.append(array[:, :3])
        groups.append(array[:, 3])
    sides = sides[np.concatenate(owners)]
    group = groups_of(np.where(sides[:, 1] == OUTSIDE, np.concatenate(groups), WALL), sides)
    sheet = Sheet(np.vstack([points, new]), np.vstack(pieces), group, np.empty((0, 2), np.int64))
    return compact(sheet)[0]


def level_line(points: FloatArray, facets: IntArray, below: float) -> FloatArray:
    """Return the line at the height ``below`` (m) as segments (k, 2, 3), one in each facet that crosses it."""
    over = points[:, 2] > below
    crossed = facets[over[facets].any(axis=1) & ~over[facets].all(axis=1)]
    ends = []
    for k in range(3):
        start, end = points[crossed[:, k]], points[crossed[:, (k + 1) % 3]]
        crosses = over[crossed[:, k]] != over[crossed[:, (k + 1) % 3]]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = (below - start[:, 2]) / (end[:, 2] - start[:, 2])
            ends.append(np.where(crosses[:, None], start + t[:, None] * (end - start), np.nan))
    found = np.stack(ends, axis=1)
    segments = found[np.isfinite(found[:, :, 0])].reshape(-1, 2, 3)
    segments[:, :, 2] = below
    return segments


def _split(facet: list[int], side: list[int], middle: Callable[[int, int], int]) -> list[tuple[int, int, int, int]]:
    """Split a facet at the level: into two if a corner is on it, otherwise into a triangle and a quadrilateral."""
    if 0 in side:
        first = side.index(0)
        a, b, c = (facet[(first + k) % 3] for k in range(3))
        m = middle(b, c)
        over = side[(first + 1) % 3]
        return [(a, b, m, FREE if over > 0 else FIXED), (a, m, c, FIXED if over > 0 else FREE)]
    alone = next(k for k in range(3) if side[k] != side[k - 1] and side[k] != side[(k + 1) % 3])
    a, b, c = (facet[(alone + k) % 3] for k in range(3))
    p, q = middle(a, b), middle(a, c)
    here, there = (FREE, FIXED) if side[alone] > 0 else (FIXED, FREE)
    return [(a, p, q, here), (p, b, c, there), (p, c, q, there)]


def _moved_onto(points: FloatArray, edges: IntArray, below: float) -> FloatArray:
    """Move points close to the level onto it, along an edge, so that no sliver facets remain."""
    points = points.copy()
    z = points[edges][:, :, 2] - below
    crossing = z[:, 0] * z[:, 1] < 0
    t = np.divide(z[:, 0], z[:, 0] - z[:, 1], out=np.full(len(z), 0.5), where=crossing)
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    shortest = np.full(len(points), np.inf)
    for end in (0, 1):
        np.minimum.at(shortest, edges[:, end], length)
    for end, share in ((0, t), (1, 1 - t)):
        here, there = edges[:, end], edges[:, 1 - end]
        near = crossing & (share < _NEAR) & (share * length < 5 * _NEAR * shortest[here])
        move = points[here[near]] + share[near, None] * (points[there[near]] - points[here[near]])
        move[:, 2] = below
        points[here[near]] = move
    return points


def on_segments(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Return the points of a line of segments (k, 2, 3) that are nearest to ``points`` (n, 3) near it."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    length = np.linalg.norm(along, axis=1)
    middle = cKDTree(segments.mean(axis=1))
    result = np.empty_like(points)
    square = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    for number, point in enumerate(points):
        least, _ = middle.query(point)
        near = middle.query_ball_point(point, least + length.max() / 2 + 1e-12)
        near = np.sort(np.array(near))
        t = np.clip(((point - start[near]) * along[near]).sum(axis=1) / square[near], 0.0, 1.0)
        found = start[near] + t[:, None] * along[near]
        result[number] = found[np.argmin(((found - point) ** 2).sum(axis=1))]
    return result


def sharp_edges(sheet: Sheet, largest: float) -> IntArray:
    """Return the edges (k, 2) at which the surface is sharp, not only between two facets, as by noise and voxels."""
    if sheet.is_divided:
        edges, junctions, count = sharp_edges(sheet.skin, largest), sheet.junctions, np.array([len(sheet.points), 1])
        return edges[~np.isin(edges @ count, junctions @ count)]
    edges, sides = edges_of(sheet.facets)
    normals = sheet.normals
    sharp = (normals[sides[:, 0]] * normals[sides[:, 1]]).sum(axis=1) < _SHARP
    edges, sides = edges[sharp], sides[sharp]
    if not len(edges):
        return edges
    middle = sheet.points[edges].mean(axis=1)
    centre = sheet.points[sheet.facets].mean(axis=1)
    mean = []
    for side in sides.T:
        # Half an element into the facet: the facets around that point give the orientation of the surface.
        along = sheet.points[edges[:, 1]] - sheet.points[edges[:, 0]]
        inward = centre[side] - middle
        inward -= along * ((inward * along).sum(axis=1) / (along**2).sum(axis=1))[:, None]
        inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), np.finfo(float).tiny)
        total = np.zeros_like(inward)
        for share in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6):
            place = np.ascontiguousarray(middle + share * largest * inward)
            _, facet, _ = igl.point_mesh_squared_distance(place, sheet.points, sheet.facets)
            total += normals[facet]
        mean.append(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), np.finfo(float).tiny))
    return _long_lines(sheet, edges[(mean[0] * mean[1]).sum(axis=1) < _SHARP], largest)


def _long_lines(sheet: Sheet, edges: IntArray, largest: float) -> IntArray:
    """Return those edges that form lines at least as long as an element; shorter ones are no edges of a body."""
    count = len(sheet.points)
    joined = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, line = connected_components(joined, directed=False)
    length = np.linalg.norm(sheet.points[edges[:, 1]] - sheet.points[edges[:, 0]], axis=1)
    of_line = line[edges[:, 0]]
    return edges[np.bincount(of_line, length, minlength=1)[of_line] > largest] if len(edges) else edges
