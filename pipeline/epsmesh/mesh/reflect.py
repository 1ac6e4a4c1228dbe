"""Whole meshes by reflection of a part in the planes of symmetry that bound it.

A scene with mirror symmetry is always meshed by reflection. Its discrete solution is then symmetric, too, and the half
or quarter model gives the same force to rounding.
"""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.generate import MeshArrays
from epsmesh.scene.model import JAW, MIRROR, PROBE
from epsmesh.shapes.grasp import MIDDLE

# Reflection inverts tetrahedra: corners 2 and 3 are swapped, and with them the mid nodes of their edges.
_TURNED = {4: [0, 1, 3, 2], 10: [0, 1, 3, 2, 4, 6, 5, 8, 7, 9]}
# The axis normal to a plane, and where on it the plane is (m).
Place = tuple[int, float]
NOWHERE: Place = (2, 0.0)


def reflect(mesh: MeshArrays, planes: tuple[str, ...], middle: Place = NOWHERE) -> MeshArrays:
    """Return ``mesh`` joined with its mirror images in ``planes`` ("x": x = 0, "y": y = 0), which bound it.

    ``middle`` is the place of the plane between two jaws, where that is one of them.
    """
    for plane in planes:
        mesh = _reflect_once(mesh, plane, middle)
    return mesh


def reflect_vectors(mesh: MeshArrays, vectors: FloatArray, planes: tuple[str, ...]) -> FloatArray:
    """Return a mirror-symmetric vector field (n, 3) at the points of ``reflect(mesh, planes)``."""
    for plane in planes:
        images = vectors[~_on_plane(mesh, plane)]
        images[:, "xy".index(plane)] *= -1
        vectors, mesh = np.vstack([vectors, images]), _reflect_once(mesh, plane, NOWHERE)
    return vectors


def reflect_labels(mesh: MeshArrays, labels: IntArray, count: int, plane: str) -> IntArray:
    """Return labels (n), below ``count``, of the points of ``reflect(mesh, (plane,))``: those of images differ."""
    return np.concatenate([labels, labels[~_on_plane(mesh, plane)] + count])


def _reflect_once(mesh: MeshArrays, plane: str, middle: Place) -> MeshArrays:
    (axis, at), name = middle if plane == MIDDLE else ("xy".index(plane), 0.0), MIRROR[plane]
    points, on_plane = mesh.points.copy(), _on_plane(mesh, plane)
    points[on_plane, axis] = at
    image = np.where(on_plane, np.arange(len(points)), len(points) + np.cumsum(~on_plane) - 1)
    mirrored = points[~on_plane]
    mirrored[:, axis] = 2 * at - mirrored[:, axis]
    facets = {key: np.vstack([f, image[f]]) for key, f in mesh.facets.items() if key != name}
    if plane == MIDDLE:
        facets |= {PROBE: mesh.facets[PROBE], JAW: image[mesh.facets[PROBE]]}
    return replace(
        mesh,
        points=np.vstack([points, mirrored]),
        cells=np.vstack([mesh.cells, image[mesh.cells][:, _TURNED[mesh.cells.shape[1]]]]),
        facets=facets,
        rim=np.union1d(mesh.rim, image[mesh.rim]),
        regions=None if mesh.regions is None else np.tile(mesh.regions, 2),
        interfaces=None,
    )


def _on_plane(mesh: MeshArrays, plane: str) -> np.ndarray:
    """Return a mask of the points in a plane that bounds the mesh."""
    # Facets have corners only: a mid node is in the plane if both ends of its edge are.
    marked = np.zeros(len(mesh.points), dtype=bool)
    marked[mesh.facets[MIRROR[plane]]] = True
    return marked | _mid_nodes_within(mesh.cells, marked)


def _mid_nodes_within(cells: IntArray, corner: np.ndarray) -> np.ndarray:
    """Return a mask of mid nodes of edges with both ends in the plane."""
    marked = np.zeros_like(corner)
    if cells.shape[1] == 10:
        for number, (i, j) in enumerate(EDGES, start=4):
            marked[cells[:, number]] |= corner[cells[:, i]] & corner[cells[:, j]]
    return marked
