"""Surface around a contact: meshed in the probe's plane, lifted along its axis, and inserted into the rest.

The points of the footprint's edge are then on its true curve, at the distance of the elements there.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import gmsh
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.compat import gmsh_session
from epsmesh.mesh.generate import GeometryError, MeshError, model_options
from epsmesh.mesh.model_arrays import corners_of, numbered_points
from epsmesh.mesh.organ.borders import Bordered, are_within, borders_within, cut_at_rim, divided_to
from epsmesh.mesh.organ.faces import Faces
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.sheet import FIXED, FREE, JAW, PROBE, WALL, Sheet, compact, edges_of, groups_of
from epsmesh.mesh.reason import generate, reason
from epsmesh.mesh.size import Sizes, set_size_field
from epsmesh.shapes.complex import OUTSIDE
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.rays import facing, pierce
from epsmesh.shapes.triangles import edge_keys, half_edges

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
    sheet: Sheet, faces: Faces, frame: Frame, probe: Probe, sizes: Sizes, lift: Lift, kind: int = PROBE
) -> Contact:
    """Return the sheet with the footprint's surroundings meshed to ``sizes``, and its edge as edges of the mesh.

    So are the borders of regions there. ``faces`` are the body's true ones. ``lift`` projects points (n, 2) of the
    probe's plane along its axis onto them. ``kind`` is that of the footprint's facets.

    Raises:
        GeometryError: if a part of the footprint has no tissue below it, or a border of regions runs along its edge.
        FoldedError: if facets around it reach over a fold.
    """
    rim = rim_points(probe, sizes)
    edge = np.vstack([edge_points(tool, rim_points(tool, sizes)) for tool in probe.contact_ends])
    lifted, followed = lift(rim), lift(edge)
    if not (np.isfinite(lifted).all() and np.isfinite(followed).all()):
        raise GeometryError("a part of the footprint's edge has no connected tissue below it")
    local, radii = frame.local(sheet.points), [collar * probe.circumradius + sizes.rim for collar in _COLLARS]
    around = borders_within(sheet, _patch(sheet, local, radii[0]))
    sheet = divided_to(sheet, around, faces, Field(sizes, frame, followed).at)
    local = frame.local(sheet.points)
    is_corner = np.zeros(len(rim), dtype=bool) if probe.is_curved else np.isin(rim, probe.outline()).all(axis=1)
    for radius in radii:
        patch = _patch(sheet, local, radius)
        bordered = cut_at_rim(sheet, patch, local[:, :2], rim, is_corner, probe.to_edge, lift)
        loops = _loops(sheet.facets[patch])
        if not _lines_cross(bordered, loops):
            break
    else:
        raise FoldedError(f"{_FOLDED}; for a rough surface, set `smooth` to the length of its bumps")
    if (sheet.kind[patch] == FIXED).any():
        raise GeometryError("the footprint is on, or next to, the fixed part of the body")
    if np.isin(sheet.kind[patch], (PROBE, JAW)).any():
        raise GeometryError("the surfaces around both jaws meet: use smaller jaws, or another place")
    return _joined(bordered, _mesh_plane(bordered, loops, probe, sizes), lift, followed, kind)


def _patch(sheet: Sheet, local: FloatArray, radius: float) -> IntArray:
    """Return the facets that meet the disc, enlarged until no point of the patch's boundary is used twice."""
    (outer,) = np.nonzero(sheet.kind != WALL)
    skin = sheet.facets[outer]
    reachable = outer[facing(local, skin, 4 * radius)]
    corners = local[sheet.facets[reachable]][:, :, :2]
    chosen = reachable[_distance_to_origin(corners) <= radius]
    chosen = chosen[np.isin(chosen, outer[facing(local, skin, radius)])]
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


def _lines_cross(bordered: Bordered, loops: list[list[int]]) -> bool:
    """Return whether lines of the patch, of borders, and the rim cross in the plane: gmsh would end the process."""
    local, rim = bordered.local, bordered.rim
    lines = [(local[loop], local[np.roll(loop, -1)]) for loop in loops]
    lines += [(rim, np.roll(rim, -1, axis=0)), tuple(local[ends] for ends in bordered.borders.T)]
    return cross(*map(np.vstack, zip(*lines, strict=True)))


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
    inside: BoolArray
    given: IntArray  # points of the mesh on the loops and borders
    given_of: IntArray  # points of the sheet that they are
    rim: IntArray


def _mesh_plane(bordered: Bordered, loops: list[list[int]], probe: Probe, sizes: Sizes) -> _Plane:
    """Mesh the plane inside ``loops`` of points, with the edges of the rim and of borders in it."""
    scale, local = probe.circumradius / 10, bordered.local
    with gmsh_session():
        model_options()
        geo, mesh = gmsh.model.geo, gmsh.model.mesh
        tag_of: dict[int, int] = {}
        curves = []
        for loop in loops:
            tag_of |= {point: geo.addPoint(*(local[point] / scale), 0) for point in loop}
            curves.append(_closed([tag_of[point] for point in loop]))
        rim_tags = [geo.addPoint(*p, 0) for p in (bordered.rim / scale).tolist()]
        around = _closed(rim_tags)
        tag_of |= {point: tag for point, tag in zip(bordered.on_rim.tolist(), rim_tags, strict=True) if point >= 0}
        for point in np.unique(bordered.borders).tolist():
            if point not in tag_of:
                tag_of[point] = geo.addPoint(*(local[point] / scale), 0)
        geo.addPlaneSurface([*curves, around], 1)
        geo.addPlaneSurface([around], 2)
        lines = [geo.addLine(tag_of[a], tag_of[b]) for a, b in bordered.borders.tolist()]
        geo.synchronize()
        is_inner = are_within(bordered.rim, local[bordered.borders].mean(axis=1))
        for face, chosen in ((1, ~is_inner), (2, is_inner)):
            mesh.embed(1, [line for line, is_chosen in zip(lines, chosen, strict=True) if is_chosen], 2, face)
        for _, curve in gmsh.model.getEntities(1):
            mesh.setTransfiniteCurve(curve, 2)
        set_size_field(sizes, probe, Frame((0.0, 0.0, 0.0)), scale)
        try:
            generate(2)
        except Exception as error:
            raise MeshError(f"gmsh: {reason(error)}") from error
        points, position = numbered_points()
        points = points[:, :2] * scale
        parts = [position[corners_of(2, [face])] for face in (1, 2)]

        def nodes(tags: Iterable[int]) -> IntArray:
            return np.array([position[mesh.getNodes(0, tag)[0][0]] for tag in tags])

        facets = np.vstack(parts)
        a, b, c = (points[facets[:, k]] for k in range(3))
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        facets = np.where((area < 0)[:, None], facets[:, [0, 2, 1]], facets)
        inside = np.arange(len(facets)) >= len(parts[0])
        return _Plane(points, facets, inside, nodes(tag_of.values()), np.array(list(tag_of)), nodes(rim_tags))


def _closed(tags: list[int]) -> int:
    geo = gmsh.model.geo
    lines = [geo.addLine(start, end) for start, end in zip(tags, [*tags[1:], tags[0]], strict=True)]
    return int(geo.addCurveLoop(lines))


def _joined(bordered: Bordered, plane: _Plane, lift: Lift, followed: FloatArray, kind: int) -> Contact:
    """Replace a patch of the sheet's surface by the lifted mesh of the plane."""
    sheet = bordered.sheet
    number = np.full(len(plane.points), -1, dtype=np.int64)
    number[plane.given] = plane.given_of
    (new,) = np.nonzero(number < 0)
    number[new] = len(sheet.points) + np.arange(len(new))
    flat = plane.points.copy()
    flat[plane.rim] = bordered.rim
    points = lift(flat[new])
    if not np.isfinite(points).all():
        raise GeometryError("a part of the surface around the footprint is hidden along the probe's axis")
    rest = np.setdiff1d(np.arange(len(sheet.facets)), bordered.patch)
    group = groups_of(np.where(plane.inside, kind, FREE), _sides(bordered, plane))
    whole = Sheet(
        np.vstack([sheet.points, points]),
        np.vstack([sheet.facets[rest], number[plane.facets]]),
        np.concatenate([sheet.group[rest], group]),
        _outside(sheet, bordered.patch),
    )
    result, renumbered = compact(whole)
    edges_of(result.skin.facets)
    return Contact(result, renumbered[number[plane.rim]], followed)


def _sides(bordered: Bordered, plane: _Plane) -> IntArray:
    """Return the regions (m, 2) behind and before the facets of the plane; borders separate them."""
    sides, count = bordered.sheet.sides[bordered.patch], len(plane.points)
    if not len(bordered.borders):
        return np.tile(sides[:1], (len(plane.facets), 1))
    position = np.full(len(bordered.local), -1)
    position[plane.given_of] = plane.given
    keys = edge_keys(plane.facets, count)
    lines = position[bordered.borders]
    order = np.argsort(keys, kind="stable")
    twins = (np.diff(keys[order]) == 0) & ~np.isin(keys[order[1:]], lines.min(axis=1) * count + lines.max(axis=1))
    one, other = order[:-1][twins] // 3, order[1:][twins] // 3
    joined = coo_array((np.ones(len(one)), (one, other)), shape=(len(plane.facets),) * 2)
    pieces, piece = connected_components(joined, directed=False)
    level = np.column_stack([bordered.local, np.zeros(len(bordered.local))])
    below, _ = pierce(level, bordered.sheet.facets[bordered.patch], plane.points[plane.facets].mean(axis=1))
    region = np.zeros((pieces, sides[:, 0].max() + 1))
    seen = below >= 0
    np.add.at(region, (piece[seen], sides[below[seen], 0]), 1)
    return np.column_stack([region.argmax(axis=1)[piece], np.full(len(piece), OUTSIDE)])


def _outside(sheet: Sheet, patch: IntArray) -> IntArray:
    """Sharp edges that are not within the patch."""
    (outer,) = np.nonzero(sheet.kind != WALL)
    edges, sides = edges_of(sheet.facets[outer])
    within = np.isin(outer[sides], patch).all(axis=1)
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
