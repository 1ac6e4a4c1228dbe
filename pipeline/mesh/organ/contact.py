"""Surface around a contact: meshed in the probe's plane, lifted along its axis, and inserted into the rest.

The points of the footprint's edge are then on its true curve, at the distance of the elements there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import gmsh
import numpy as np

from pipeline.arrays import BoolArray, FloatArray, IntArray
from pipeline.compat import gmsh_session
from pipeline.mesh.generate import GeometryError, MeshError, model_options
from pipeline.mesh.model_arrays import corners_of, numbered_points
from pipeline.mesh.organ.sheet import FIXED, PROBE, WALL, Sheet, compact, edges_of
from pipeline.mesh.reason import reason
from pipeline.mesh.size import Sizes, set_size_field
from pipeline.shapes.frame import Frame
from pipeline.shapes.probe import Probe
from pipeline.shapes.rays import facing
from pipeline.shapes.triangles import half_edges

Lift = Callable[[FloatArray], FloatArray]
# Radius of the remeshed patch, in units of the footprint's, if facets are small; smaller ones are tried where a fold
# is close.
_COLLARS = (1.25, 1.1, 1.0)
# Points along a round outline, per element.
_FOLLOW = 8
_FOLDED = "the surface is folded around the contact and cannot be projected into the probe's plane"


class FoldedError(GeometryError):
    """Facets around the contact are too large to be projected into the probe's plane: they reach over folds."""


@dataclass(frozen=True, eq=False)
class Contact:
    """The ``sheet`` with the footprint in it; ``rim`` (k) are the points along its edge, in order.

    ``edge`` (n, 3), in m, are dense points along the true edge; if contact is found, where it is expected to end.
    """

    sheet: Sheet
    rim: IntArray
    edge: FloatArray


def rim_points(probe: Probe, sizes: Sizes) -> FloatArray:
    """Return points (n, 2), in m, along the footprint's edge, at the distance of the elements there."""
    outline = probe.outline()
    if probe.is_curved:
        count = sizes.rim_segments(probe)
        return probe.to_edge(_resample(outline, count))
    legs = _legs(outline)
    parts = []
    for start, end in legs:
        count = max(2, int(np.ceil(np.linalg.norm(end - start) / sizes.rim)))
        parts.append(start + (np.arange(count) / count)[:, None] * (end - start))
    return np.vstack(parts)


def edge_points(probe: Probe, rim: FloatArray) -> FloatArray:
    """Return points (n, 2), in m, along the footprint's edge, denser than those of its elements."""
    following = np.roll(rim, -1, axis=0)
    share = np.arange(_FOLLOW)[:, None, None] / _FOLLOW
    return probe.to_edge((rim + share * (following - rim)).reshape(-1, 2))


def _resample(outline: FloatArray, count: int) -> FloatArray:
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(outline, axis=0), axis=1))])
    wanted = length[-1] * np.arange(count) / count
    return np.column_stack([np.interp(wanted, length, outline[:, k]) for k in range(2)])


def _legs(outline: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    return [(outline[k], outline[k + 1]) for k in range(len(outline) - 1)]


def set_in(
    sheet: Sheet, frame: Frame, probe: Probe, sizes: Sizes, lift: Lift, *, names: Sequence[str] = ("tissue",)
) -> Contact:
    """Return the sheet with the footprint's surroundings meshed to ``sizes``, and its edge as edges of the mesh.

    ``lift`` projects points (n, 2) of the probe's plane along its axis onto the true surface. ``names`` are those of
    the body's regions, by number.

    Raises:
        GeometryError: if a part of the footprint has no tissue below it, or two regions.
        FoldedError: if facets around it reach over a fold.
    """
    rim = rim_points(probe, sizes)
    edge = np.vstack([edge_points(tool, rim_points(tool, sizes)) for tool in probe.contact_ends])
    lifted, followed = lift(rim), lift(edge)
    if not (np.isfinite(lifted).all() and np.isfinite(followed).all()):
        raise GeometryError("a part of the footprint's edge has no connected tissue below it")
    local, skin = frame.local(sheet.points), sheet.skin
    for collar in _COLLARS:
        patch = _patch(skin, local, collar * probe.circumradius + sizes.rim)
        loops = _loops(skin.facets[patch])
        if not _lines_cross(local[:, :2], loops, rim) and len(np.unique(skin.sides[patch], axis=0)) == 1:
            break
    else:
        if len(np.unique(skin.sides[patch], axis=0)) > 1:
            raise _over_two_regions(skin, patch, frame, names)
        raise FoldedError(f"{_FOLDED}; for a rough surface, set `smooth` to the length of its bumps")
    if (skin.kind[patch] == FIXED).any():
        raise GeometryError("the footprint is on, or next to, the fixed part of the body")
    plane = _mesh_plane(local[:, :2], loops, rim, probe, sizes)
    return _joined(sheet, patch, plane, lift, lifted, followed)


def _over_two_regions(skin: Sheet, patch: IntArray, frame: Frame, names: Sequence[str]) -> GeometryError:
    """Return the error for a contact at a border between regions, with the nearest place of that."""
    edges, sides = skin.border_of_regions()
    near = np.isin(edges, skin.facets[patch]).any(axis=1)
    middles = skin.points[edges[near]].mean(axis=1)
    nearest = np.linalg.norm(middles - np.array(frame.point), axis=1).argmin()
    (x, y, z), (one, other) = 1e3 * middles[nearest], sorted(sides[near][nearest])
    return GeometryError(
        f"{names[one]} and {names[other]} meet at the body's surface at ({x:.4g}, {y:.4g}, {z:.4g}) mm, below the "
        "footprint or next to it: move the probe, or make it smaller"
    )


def _patch(sheet: Sheet, local: FloatArray, radius: float) -> IntArray:
    """Return the facets that meet the disc, enlarged until no point of the patch's boundary is used twice."""
    reachable = facing(local, sheet.facets, 4 * radius)
    corners = local[sheet.facets[reachable]][:, :, :2]
    chosen = reachable[_distance_to_origin(corners) <= radius]
    chosen = chosen[np.isin(chosen, facing(local, sheet.facets, radius))]
    if not len(chosen):
        raise GeometryError("the probe's axis does not meet the surface")
    for _ in range(20):
        pairs = _outer_edges(sheet.facets[chosen])
        points, count = np.unique(pairs, return_counts=True)
        pinched = points[count > 2]
        if not len(pinched):
            return chosen
        more = reachable[np.isin(sheet.facets[reachable], pinched).any(axis=1)]
        if np.isin(more, chosen).all():
            break
        chosen = np.union1d(chosen, more)
    raise FoldedError(_FOLDED)


def _lines_cross(local: FloatArray, loops: list[list[int]], rim: FloatArray) -> bool:
    """Return whether boundary lines of the patch, and the rim, cross in the plane: gmsh would end the process."""
    closed = [local[loop] for loop in loops] + [rim]
    return cross(np.vstack(closed), np.vstack([np.roll(line, -1, axis=0) for line in closed]))


def _distance_to_origin(corners: FloatArray) -> FloatArray:
    """Distance of triangles (m, 3, 2) in a plane from its origin."""
    best = np.full(len(corners), np.inf)
    inside = np.ones(len(corners), dtype=bool)
    for k in range(3):
        start, end = corners[:, k], corners[:, (k + 1) % 3]
        along = end - start
        t = np.clip(-(start * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
        best = np.minimum(best, np.linalg.norm(start + t[:, None] * along, axis=1))
        inside &= start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0] >= 0
    return np.where(inside, 0.0, best)


def _outer_edges(facets: IntArray) -> IntArray:
    """Return the oriented edges (k, 2) that belong to one of the facets only."""
    pairs = half_edges(facets)
    there = set(map(tuple, pairs.tolist()))
    return np.array([pair for pair in pairs.tolist() if (pair[1], pair[0]) not in there], dtype=np.int64)


def _loops(facets: IntArray) -> list[list[int]]:
    """Return the closed boundary lines of facets, as point numbers."""
    following = dict(_outer_edges(facets).tolist())
    loops = []
    while following:
        start = min(following)
        loop, point = [start], following.pop(start)
        while point != start:
            loop.append(point)
            point = following.pop(point)
        loops.append(loop)
    return loops


@dataclass(frozen=True, eq=False)
class _Plane:
    """A mesh in the plane: points (n, 2), facets, whether each is within the rim, and the given points."""

    points: FloatArray
    facets: IntArray
    inside: np.ndarray
    outer: IntArray  # points of the mesh on the loops
    outer_of: IntArray  # points of the sheet that they are
    rim: IntArray


def _mesh_plane(local: FloatArray, loops: list[list[int]], rim: FloatArray, probe: Probe, sizes: Sizes) -> _Plane:
    """Mesh the plane inside ``loops`` of points, with the rim's edges in it."""
    scale = probe.circumradius / 10
    with gmsh_session():
        model_options()
        geo, mesh = gmsh.model.geo, gmsh.model.mesh
        curves, outer = [], []
        for loop in loops:
            tags = [geo.addPoint(*(local[i] / scale), 0) for i in loop]
            outer += list(zip(tags, loop, strict=True))
            curves.append(_closed(tags))
        rim_tags = [geo.addPoint(*p, 0) for p in (rim / scale).tolist()]
        around = _closed(rim_tags)
        geo.addPlaneSurface([*curves, around], 1)
        geo.addPlaneSurface([around], 2)
        geo.synchronize()
        for _, curve in gmsh.model.getEntities(1):
            mesh.setTransfiniteCurve(curve, 2)
        set_size_field(sizes, probe, Frame((0.0, 0.0, 0.0)), scale)
        try:
            mesh.generate(2)
        except Exception as error:
            raise MeshError(f"gmsh: {reason(error)}") from error
        points, position = numbered_points()
        points = points[:, :2] * scale
        parts = [position[corners_of(2, [face])] for face in (1, 2)]

        def node(point: int) -> int:
            return int(position[mesh.getNodes(0, point)[0][0]])

        facets = np.vstack(parts)
        a, b, c = (points[facets[:, k]] for k in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        facets = np.where((area < 0)[:, None], facets[:, [0, 2, 1]], facets)
        inside = np.arange(len(facets)) >= len(parts[0])
        return _Plane(
            points, facets, inside, np.array([node(tag) for tag, _ in outer]), np.array([i for _, i in outer]),
            np.array([node(tag) for tag in rim_tags]),
        )  # fmt: skip


def _closed(tags: list[int]) -> int:
    geo = gmsh.model.geo
    lines = [geo.addLine(start, end) for start, end in zip(tags, [*tags[1:], tags[0]], strict=True)]
    return int(geo.addCurveLoop(lines))


def _joined(
    sheet: Sheet, patch: IntArray, plane: _Plane, lift: Lift, lifted: FloatArray, followed: FloatArray
) -> Contact:
    """Replace a patch of the sheet's surface by the lifted mesh of the plane."""
    skin = sheet.skin
    inner = sheet.kind == WALL
    number = np.full(len(plane.points), -1, dtype=np.int64)
    number[plane.outer] = plane.outer_of
    (new,) = np.nonzero(number < 0)
    number[new] = len(sheet.points) + np.arange(len(new))
    points = np.full((len(new), 3), np.nan)
    on_rim = np.full(len(plane.points), -1, dtype=np.int64)
    on_rim[plane.rim] = np.arange(len(plane.rim))
    is_rim = on_rim[new] >= 0
    points[is_rim] = lifted[on_rim[new[is_rim]]]
    points[~is_rim] = lift(plane.points[new[~is_rim]])
    if not np.isfinite(points).all():
        raise GeometryError("a part of the surface around the footprint is hidden along the probe's axis")
    rest = np.ones(len(skin.facets), dtype=bool)
    before = skin.group[patch[0]]
    group = np.where(plane.inside, before - skin.kind[patch[0]] + PROBE, before)
    rest[patch] = False
    whole = Sheet(
        np.vstack([sheet.points, points]),
        np.vstack([skin.facets[rest], number[plane.facets], sheet.facets[inner]]),
        np.concatenate([skin.group[rest], group, sheet.group[inner]]),
        _outside(skin, patch),
    )
    result, renumbered = compact(whole)
    edges_of(result.skin.facets)
    return Contact(result, renumbered[number[plane.rim]], followed)


def _outside(sheet: Sheet, patch: IntArray) -> IntArray:
    """Sharp edges that are not within the patch."""
    edges, sides = edges_of(sheet.facets)
    within = np.isin(sides, patch).all(axis=1)
    base = len(sheet.points)
    gone = edges[within] @ np.array([base, 1])
    sharp = np.sort(sheet.sharp, axis=1)
    return sharp[~np.isin(sharp @ np.array([base, 1]), gone)]


def cross(start: FloatArray, end: FloatArray) -> bool:
    """Return whether any two segments from ``start`` (n, 2) to ``end`` (n, 2) without a common end meet."""
    sides = _sign(start[:, None], end[:, None], start[None]) * _sign(start[:, None], end[:, None], end[None])
    # Segments of one straight line have no sides of each other: they meet if they overlap along it.
    low, high = np.minimum(start, end), np.maximum(start, end)
    apart = ((low[:, None] > high[None]) | (high[:, None] < low[None])).any(axis=-1)
    joined = _same(start, start) | _same(start, end) | _same(end, start) | _same(end, end)
    return bool(((sides <= 0) & (sides.T <= 0) & ~joined & ~apart).any())


def _sign(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return on which side of the lines from ``a`` to ``b`` the points ``c`` are, as signs."""
    ab, ac = b - a, c - a
    return np.asarray(np.sign(ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]))


def _same(one: FloatArray, other: FloatArray) -> BoolArray:
    return np.asarray((one[:, None] == other[None]).all(axis=-1))
