"""Quadratic geometry: curved rim and sides, and quarter-point elements at the probe's edge.

The displacement goes like r^½ at the edge of a probe. A quadratic element represents r^½ if the mid node of an edge
that ends on the rim is at a quarter of its length (R. S. Barsoum, Int. J. Numer. Methods Eng. 10, 1976).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.sparse import csr_matrix

from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.generate import MeshArrays, MeshError, determinants
from epsmesh.scene.model import FIXED, FREE, JAW, MIRROR, PROBE, Scene
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.scanned import Scanned
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.triangles import edge_keys
from epsmesh.stages import stage

# Edges of the reference tetrahedron in the order of basix's quadratic nodes 4 to 9.
EDGES = np.array([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])
# A point is on a surface within this distance, in units of the surface's size.
_CLOSE = 1e-6
# Largest distance of straight edges from the rim that they approximate, in units of the footprint's half width.
_OFF_RIM = 0.2
# A cell is straightened if its Jacobian falls below this share of the straight cell's.
_LEAST_JACOBIAN = 1e-3
# Alternating projections onto two surfaces, until a point is on both.
_ALTERNATIONS = 30

# From edges (k, 2) of one part of a mesh, and which of them it has chosen: which of them any part has chosen, and
# whether any edge is; collective.
Agree = Callable[[IntArray, BoolArray], tuple[BoolArray, bool]]


def _of_one_part(_: IntArray, chosen: BoolArray) -> tuple[BoolArray, bool]:
    return chosen, bool(chosen.any())


@stage("curved rim and sides")
def curve(mesh: MeshArrays, scene: Scene, *, is_finest: bool = True, agree: Agree = _of_one_part) -> MeshArrays:
    """Return ``mesh`` with ten nodes per cell, on the true rim and sides, with the scene's quarter points.

    ``agree`` is for parts of a mesh, and collective. A mesh that is not the finest has no quarter points, but those at
    which its edges are to be halved.
    """
    mesh = _on_rim_nodes(mesh, scene)
    corners = mesh.cells
    edges, of_cell = edges_of(corners, len(mesh.points))
    keys = _key(mesh, edges)
    straight = mesh.points[edges].mean(axis=1)
    middle = straight if is_finest else _graded(mesh.points, edges)
    curved = middle if mesh.bent is None else _on_faces(mesh.bent, edges, middle)
    curved = _on_embedded(mesh, scene, edges, _on_sides(mesh, scene, edges, curved, keys))
    curved = _on_rim(mesh, scene, edges, curved)
    middle = curved.copy()
    if is_finest:
        if scene.has_quarter_points:
            middle = _quarter_points(_singular_rim(mesh, scene), mesh.points, edges, middle)
        # A folded cell loses its quarter points first: without its arcs the footprint would be smaller.
        for milder in (curved, straight):
            _unfold(mesh.points, corners, straight, middle, of_cell, milder, partial(agree, edges))
    nodes = np.hstack([corners, len(mesh.points) + of_cell])
    return replace(mesh, points=np.vstack([mesh.points, middle]), cells=nodes, bent=None)


def edges_of(corners: IntArray, count: int) -> tuple[IntArray, Int32Array]:
    """Return the edges (k, 2) of tetrahedra (m, 4) among ``count`` points, in ascending order, and those of each cell.

    The latter (m, 6) are in the order of :data:`EDGES`. Pairs are sorted by counting, first by one end, then by the
    other: numpy sorts a million of them three times as slowly.
    """
    first, second = (corners[:, ends].reshape(-1) for ends in EDGES.T)
    low, high = np.minimum(first, second), np.maximum(first, second)
    order = _counted(low, count, _counted(high, count, np.arange(len(low), dtype=np.int32)))
    low, high = low[order], high[order]
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    of_cell = np.empty(len(order), dtype=np.int32)
    of_cell[order] = np.cumsum(is_first, dtype=np.int32) - 1
    return np.column_stack([low[is_first], high[is_first]]), of_cell.reshape(-1, len(EDGES))


def _counted(values: IntArray, count: int, order: Int32Array) -> Int32Array:
    """Return ``order`` sorted by ``values`` below ``count``, which they number; equal ones keep their order."""
    row = csr_matrix((order, values[order], [0, len(order)]), shape=(1, count))
    return np.asarray(row.tocsc().data)


def _graded(points: FloatArray, edges: IntArray) -> FloatArray:
    """Return the points that halve edges (k, 2) in elements: nearer to the end where elements are smaller.

    If the element size is linear along an edge, from a to b, that is at √a / (√a + √b) of its length.
    """
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    total = sum(np.bincount(ends, length, len(points)) for ends in edges.T)
    count = np.bincount(edges.ravel(), minlength=len(points))
    root = np.sqrt(total / np.maximum(count, 1))[edges]
    share = (root[:, 0] / root.sum(axis=1))[:, None]
    return np.asarray((1 - share) * points[edges[:, 0]] + share * points[edges[:, 1]])


def _on_faces(bent: tuple[IntArray, FloatArray], edges: IntArray, middle: FloatArray) -> FloatArray:
    """Move the mid nodes of edges to the geometry kernel's positions, which include rims that are not plane."""
    among, points = np.sort(bent[0], axis=1), bent[1]
    count = int(edges.max()) + 1
    keys, wanted = edges @ np.array([count, 1]), among @ np.array([count, 1])
    order = np.argsort(keys)
    at = np.searchsorted(keys, wanted, sorter=order)
    middle = middle.copy()
    middle[order[at]] = points
    return middle


def _on_rim(mesh: MeshArrays, scene: Scene, edges: IntArray, middle: FloatArray) -> FloatArray:
    """Move the mid nodes of edges along a curved rim onto it, or onto a column that cuts the footprint."""
    if _is_lifted(scene):
        if mesh.bent is not None:
            return middle
        return _on_lifted_rim(mesh, scene, edges, middle)
    on_rim = np.isin(edges, mesh.rim).all(axis=1)
    if scene.jaw is not None and (scene.jaw.is_curved or isinstance(scene.body, Scanned)):
        chosen = on_rim & np.isin(_key(mesh, edges), _facet_edges(mesh, [JAW]))
        middle = middle.copy()
        middle[chosen] = _at_edge(scene, JAW, middle[chosen])
    both = on_rim & np.isin(_key(mesh, edges), _facet_edges(mesh, [PROBE]))
    if not (scene.probe.is_curved or isinstance(scene.body, Scanned)):
        return middle
    beyond = np.zeros(len(mesh.points), dtype=bool)
    if scene.is_cut:
        beyond[mesh.rim] = np.abs(scene.cut_face.distance(mesh.points[mesh.rim])) < _CLOSE * scene.column
    of_column = both & beyond[edges].all(axis=1)
    middle = middle.copy()
    middle[of_column] = scene.cut_face.project(middle[of_column])
    chosen = both & ~of_column
    middle[chosen] = _at_edge(scene, PROBE, middle[chosen])
    return middle


def _at_edge(scene: Scene, group: str, points: FloatArray) -> FloatArray:
    """Return the nearest points (n, 3) of a footprint's edge, plane or on triangles, to ``points`` (n, 3) near it."""
    frame, tool = scene.frame_of(group), scene.tools[group]
    local = frame.local(points)
    local[:, :2] = tool.to_edge(local[:, :2])
    if isinstance(scene.body, Scanned):
        return scene.body.lift(frame, local[:, :2])[0]
    return frame.world(local)


def _is_lifted(scene: Scene) -> bool:
    """Return whether a CAD kernel cut the footprint out of a surface; on triangles its edge was lifted before."""
    return not (isinstance(scene.body, Scanned) or scene.is_flat)


def _on_lifted_rim(mesh: MeshArrays, scene: Scene, edges: IntArray, middle: FloatArray) -> FloatArray:
    """Move the mid nodes of edges along a rim onto the curve where the footprint's edge, lifted, meets the surface."""
    keys, beside = _key(mesh, edges), [name for name in mesh.facets if name != PROBE and name not in MIRROR.values()]
    chosen = np.isin(edges, mesh.rim).all(axis=1) & np.isin(keys, _facet_edges(mesh, [PROBE]))
    chosen &= np.isin(keys, _facet_edges(mesh, beside))
    middle = middle.copy()
    middle[chosen] = _lifted(scene, middle[chosen])
    return middle


def _lifted(scene: Scene, points: FloatArray) -> FloatArray:
    """Return the points of the lifted rim that are nearest, in the probe's plane, to points near the rim."""
    flat = scene.probe.to_edge(scene.frame.local(points)[:, :2])
    found, _ = scene.body.lift(scene.frame, flat)
    if not np.all(np.linalg.norm(found - points, axis=1) < _OFF_RIM * scene.probe.half_width):
        raise MeshError("the mesh does not follow the footprint's edge: use a smaller rim")
    return found


def _on_rim_nodes(mesh: MeshArrays, scene: Scene) -> MeshArrays:
    """Move the corners of elements on a rim that is not plane exactly onto it: the kernel has a tolerance."""
    if mesh.bent is not None or not (_is_lifted(scene) and scene.probe.is_curved):
        return mesh
    points = mesh.points.copy()
    moved = _lifted(scene, points[mesh.rim])
    for plane in scene.cutting:
        axis, _ = scene.plane(plane)
        on_plane = np.abs(points[mesh.rim, axis]) < _CLOSE * scene.body.extent
        moved[on_plane, axis] = points[mesh.rim, axis][on_plane]
    points[mesh.rim] = moved
    return replace(mesh, points=points)


def _on_sides(mesh: MeshArrays, scene: Scene, edges: IntArray, middle: FloatArray, keys: IntArray) -> FloatArray:
    """Move the mid nodes of edges in a curved surface of the body, or of the column, onto that surface."""
    surfaces = [surface for group in scene.body.surfaces().values() for surface in group]
    surfaces += [scene.cut_face] if scene.is_cut else []
    outer, middle = np.isin(keys, _facet_edges(mesh, mesh.facets)), middle.copy()
    for surface in (surface for surface in surfaces if surface.is_curved):
        on_side = np.abs(surface.distance(mesh.points)) < _CLOSE * scene.body.extent
        chosen = outer & on_side[edges].all(axis=1)
        if scene.is_ball and surface is scene.cut_face:
            # An edge between two of its points may also cross the top, or a plane of symmetry.
            chosen &= np.isin(keys, _facet_edges(mesh, [FIXED]))
        elif isinstance(surface, Ovoid):
            # The ellipsoid is the whole boundary: an edge between two of its points may cross a plane of symmetry.
            chosen &= np.isin(keys, _facet_edges(mesh, [name for name in mesh.facets if name not in MIRROR.values()]))
        middle[chosen] = surface.project(middle[chosen])
    return middle


def _on_embedded(mesh: MeshArrays, scene: Scene, edges: IntArray, middle: FloatArray) -> FloatArray:
    """Move the mid nodes of edges in the surface of an embedded region onto it, and onto a column that cuts it."""
    if not scene.body.embedded:
        return middle
    inner = [] if mesh.regions is None else [edge_keys(interfaces(mesh), len(mesh.points))]
    inner += [_facet_edges(mesh, [FREE])] if scene.body.cavities else []
    between = np.isin(_key(mesh, edges), np.concatenate([*inner, np.empty(0, dtype=np.int64)]))
    used = np.unique(edges[between])
    middle, close = middle.copy(), _CLOSE * scene.body.extent
    for surface_of_region in (piece.surface for piece in scene.body.embedded):
        surfaces: list[Surface] = [surface_of_region]
        on_side = np.zeros(len(mesh.points), dtype=bool)
        on_side[used] = np.abs(surface_of_region.distance(mesh.points[used])) < close
        chosen = between & on_side[edges].all(axis=1)
        middle[chosen] = surface_of_region.project(middle[chosen])
        if scene.is_cut:
            beyond = np.abs(scene.cut_face.distance(mesh.points)) < close
            both = chosen & beyond[edges].all(axis=1)
            surfaces.append(scene.cut_face)
            for surface in _ALTERNATIONS * surfaces:
                middle[both] = surface.project(middle[both])
    return middle


def interfaces(mesh: MeshArrays) -> IntArray:
    """Return the triangles (k, 3) between two regions."""
    if mesh.interfaces is not None or mesh.regions is None:
        return np.empty((0, 3), dtype=np.int64) if mesh.interfaces is None else mesh.interfaces
    corners = np.sort(mesh.cells[:, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]].reshape(-1, 3), axis=1)
    order = np.lexsort(corners.T)
    sorted_corners, owner = corners[order], np.repeat(mesh.regions, 4)[order]
    twins = np.all(sorted_corners[1:] == sorted_corners[:-1], axis=1) & (owner[1:] != owner[:-1])
    return np.asarray(sorted_corners[1:][twins])


def _key(mesh: MeshArrays, edges: IntArray) -> IntArray:
    return edges[:, 0] * len(mesh.points) + edges[:, 1]


def _facet_edges(mesh: MeshArrays, names: object) -> IntArray:
    """Return keys of the edges of the boundary triangles in the named groups."""
    facets = np.concatenate([mesh.facets[name] for name in names])  # type: ignore[attr-defined]
    return np.unique(edge_keys(facets, len(mesh.points)))


def _singular_rim(mesh: MeshArrays, scene: Scene) -> IntArray:
    """Return the points of the rim at which the displacement goes like r^½: of a second jaw it may, or not."""
    if scene.jaw is None:
        return mesh.rim
    within = [mesh.facets[name].ravel() for name, tool in scene.tools.items() if tool.has_singular_edge]
    return np.intersect1d(mesh.rim, np.concatenate(within))


def _quarter_points(rim: IntArray, points: FloatArray, edges: IntArray, middle: FloatArray) -> FloatArray:
    """Move the mid node of every edge with exactly one end on the ``rim`` to a quarter of its length from there."""
    ends = np.isin(edges, rim)
    for here in (0, 1):
        chosen = ends[:, here] & ~ends[:, 1 - here]
        start, end = points[edges[chosen, here]], points[edges[chosen, 1 - here]]
        # A curved edge keeps its bulge, which at a quarter of the length is 3/4 of that in the middle.
        bulge = middle[chosen] - (start + end) / 2
        middle[chosen] = start + (end - start) / 4 + 0.75 * bulge
    return middle


def _unfold(
    points: FloatArray,
    corners: IntArray,
    straight: FloatArray,
    middle: FloatArray,
    of_cell: Int32Array,
    milder: FloatArray,
    agree: Callable[[BoolArray], tuple[BoolArray, bool]],
) -> None:
    """Replace the mid nodes of folded cells by ``milder`` ones, then those of neighbours that this folds, and so on.

    ``straight`` are the middles of edges: cells with no other mid nodes, nearly all, cannot be folded.
    """
    bad, are_any = np.zeros(len(corners), dtype=bool), True
    while are_any:
        bent = (middle != straight).any(axis=1)
        curved = np.flatnonzero(bent[of_cell].any(axis=1) & ~bad)
        nodes = np.concatenate([points[corners[curved]], middle[of_cell[curved]]], axis=1)
        folded = curved[folded_cells(nodes)]
        bad[folded], chosen = True, np.zeros(len(middle), dtype=bool)
        chosen[of_cell[folded]] = True
        chosen, are_any = agree(chosen)
        middle[chosen] = milder[chosen]


def folded_cells(nodes: FloatArray) -> BoolArray:
    """Return a mask of cells, by their nodes (n, 10, 3), whose map folds at a quadrature point of the stiffness."""
    corners = nodes[:, :4]
    straight = determinants(np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0))
    by_node = np.ascontiguousarray(nodes.transpose(1, 0, 2)).reshape(nodes.shape[1], -1)
    least = np.full(len(nodes), np.inf)
    for gradients in _gradients():
        columns = (gradients.T @ by_node).reshape(3, len(nodes), 3)
        least = np.minimum(least, determinants(columns))
    return np.asarray(least < _LEAST_JACOBIAN * straight)


@cache
def _gradients() -> FloatArray:
    """Return gradients of the quadratic shape functions at interior points near every corner, and between corners.

    Their shape is (points, 10, 3).
    """
    weights = [np.full(4, 0.25)]
    for corner in range(4):
        weights += [np.where(np.arange(4) == corner, w, (1 - w) / 3) for w in (0.9, 0.7)]
    for i, j in EDGES:
        weights.append(np.where(np.isin(np.arange(4), (i, j)), 0.45, 0.05))
    slope = np.vstack([-np.ones(3), np.eye(3)])  # gradients of the barycentric coordinates
    gradients = []
    for w in weights:
        corner_part = (4 * w - 1)[:, None] * slope
        edge_part = np.array([4 * (w[i] * slope[j] + w[j] * slope[i]) for i, j in EDGES])
        gradients.append(np.vstack([corner_part, edge_part]))
    return np.array(gradients)
