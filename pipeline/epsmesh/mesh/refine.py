"""Regular refinement: each tetrahedron of a curved mesh becomes eight.

The mid nodes of the mesh, on the true rim and sides, become points of the finer one, so that no geometry kernel is
needed. The octahedron in the middle of a tetrahedron is cut along its shortest diagonal (J. Bey, Computing 55, 355,
1995, has a fixed one).
"""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.generate import FLAT, MeshArrays, MeshError, determinants
from epsmesh.scene.model import MIRROR, PROBE
from epsmesh.shapes.triangles import edge_keys, half_edges

# Cells whose volumes are computed at once: their points fit into the cache.
_AT_ONCE = 2**14
# Mid nodes (of the ten of a cell) of the edges between two corners.
_MID = {tuple(map(int, edge)): 4 + number for number, edge in enumerate(EDGES)}
# Children at the corners.
_OUTER = [
    [corner, *(_MID[min(corner, other), max(corner, other)] for other in range(4) if other != corner)]
    for corner in range(4)
]
# The octahedron's diagonals, each with the four other mid nodes in a ring about it.
_DIAGONALS = [
    ((_MID[0, 1], _MID[2, 3]), (_MID[0, 2], _MID[0, 3], _MID[1, 3], _MID[1, 2])),
    ((_MID[0, 2], _MID[1, 3]), (_MID[0, 1], _MID[0, 3], _MID[2, 3], _MID[1, 2])),
    ((_MID[0, 3], _MID[1, 2]), (_MID[0, 1], _MID[0, 2], _MID[2, 3], _MID[1, 3])),
]


def _children() -> IntArray:
    """Return the nodes of the children (3, 8, 4) for each diagonal, all of positive volume."""
    at = np.vstack([np.zeros(3), np.eye(3)])
    at = np.vstack([at, at[EDGES].mean(axis=1)])
    result = np.array(
        [_OUTER + [[*ends, ring[i], ring[(i + 1) % 4]] for i in range(4)] for ends, ring in _DIAGONALS],
        dtype=np.int64,
    )
    inverted = np.linalg.det(at[result[..., 1:]] - at[result[..., :1]]) < 0
    result[inverted] = result[inverted][:, [0, 1, 3, 2]]
    return result


CHILDREN = _children()


def _carriers() -> IntArray:
    """Return, for each face (opposite a corner) of each child, the parent's face that it is part of, or -1."""
    faces = [{n for n in range(4) if n != face} | {_MID[e] for e in _MID if face not in e} for face in range(4)]
    result = np.full(CHILDREN.shape, -1, dtype=np.int64)
    for index in np.ndindex(*CHILDREN.shape):
        corners = set(np.delete(CHILDREN[index[:2]], index[2]).tolist())
        result[index] = next((face for face, nodes in enumerate(faces) if corners <= nodes), -1)
    return result


CARRIERS = _carriers()


class NotRefined(MeshError):
    """The refined cells of a mesh are unusable; one that gmsh makes may not be."""


def refined(mesh: MeshArrays) -> tuple[MeshArrays, IntArray]:
    """Return the tetrahedra (four nodes each) that a mesh with ten nodes per cell is cut into, eight for each in order.

    Points are those of ``mesh``. Also returned is, for each face of each of them, the face of the cell that it is part
    of, or -1 (opposite a corner, shape (8 m, 4)). Mid nodes of triangles that no cell has are the last point.

    Raises:
        NotRefined: if one of them is flat or inverted.
    """
    nodes, points = mesh.cells, mesh.points
    lengths = [np.linalg.norm(points[nodes[:, a]] - points[nodes[:, b]], axis=1) for (a, b), _ in _DIAGONALS]
    diagonal = np.argmin(lengths, axis=0)
    flat = CHILDREN[diagonal].reshape(len(nodes), 32)
    cells = np.take_along_axis(nodes, flat, axis=1).reshape(-1, 4)
    if not is_positive(points, cells):
        raise NotRefined("a refined tetrahedron is flat")
    fine = replace(
        mesh,
        cells=cells,
        facets={name: _cut(mesh, triangles) for name, triangles in mesh.facets.items()},
        rim=np.setdiff1d(np.union1d(mesh.rim, mid_nodes(mesh, rim_edges(mesh))), _beyond(mesh)),
        regions=None if mesh.regions is None else np.repeat(mesh.regions, 8),
        interfaces=None if mesh.interfaces is None else _cut(mesh, mesh.interfaces),
    )
    return fine, CARRIERS[diagonal].reshape(-1, 4)


def is_positive(points: FloatArray, cells: IntArray) -> bool:
    """Return whether all tetrahedra have a positive volume, and none is flat."""
    return all(_are_positive(points, cells[start : start + _AT_ONCE]) for start in range(0, len(cells), _AT_ONCE))


def _are_positive(points: FloatArray, cells: IntArray) -> bool:
    # By columns: numpy's determinants and extremes of small arrays take four times as long.
    a, b, c, d = (points[cells[:, corner]].T for corner in range(4))
    volume = determinants(np.stack([b - a, c - a, d - a]).swapaxes(1, 2))
    size = np.max([np.max(part, axis=0) - np.min(part, axis=0) for part in zip(a, b, c, d, strict=True)], axis=0)
    return bool((volume > FLAT * size**3).all())


def rim_edges(mesh: MeshArrays) -> IntArray:
    """Return the edges (k, 2) along the rim: between two of its points, at the end of the footprint."""
    count = len(mesh.points)
    keys, times = np.unique(edge_keys(mesh.facets[PROBE], count), return_counts=True)
    keys = keys[times == 1]
    for name in MIRROR.values():
        keys = np.setdiff1d(keys, edge_keys(mesh.facets[name], count)) if name in mesh.facets else keys
    edges = np.column_stack([keys // count, keys % count])
    return edges[np.isin(edges, mesh.rim).all(axis=1)]


def mid_nodes(mesh: MeshArrays, edges: IntArray) -> IntArray:
    """Return the mid nodes of edges (k, 2) of a mesh with ten nodes per cell; the last point for edges of no cell."""
    count = len(mesh.points)
    used = np.zeros(count, dtype=bool)
    used[edges] = True
    pairs = mesh.cells[:, EDGES]
    own = used[pairs].all(axis=2)
    ends = np.sort(pairs[own], axis=1)
    keys, first = np.unique(ends[:, 0] * count + ends[:, 1], return_index=True)
    nodes = mesh.cells[:, 4:][own][first]
    wanted = np.sort(edges, axis=1) @ np.array([count, 1])
    if not len(keys):
        return np.full(len(edges), count - 1)
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return np.where(keys[at] == wanted, nodes[at], count - 1)


def _cut(mesh: MeshArrays, triangles: IntArray) -> IntArray:
    """Return the four triangles that each of ``triangles`` (k, 3) is cut into, but for those without a known point."""
    ab, bc, ca = mid_nodes(mesh, half_edges(triangles)).reshape(-1, 3).T
    a, b, c = triangles.T
    cut = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1).reshape(-1, 3)
    beyond = _beyond(mesh)
    return cut[~np.isin(cut, beyond).all(axis=1)] if len(beyond) else cut


def _beyond(mesh: MeshArrays) -> IntArray:
    """Return the point that replaces those of other parts, if there is one: the last, which no cell has."""
    last = len(mesh.points) - 1
    return np.array([last])[: 0 if (mesh.cells == last).any() else 1]
