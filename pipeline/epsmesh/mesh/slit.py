"""A slit inside a mesh: the nodes of its faces are doubled, except on its front.

A slit in a plane of symmetry needs no doubling: reflection makes the other face.
"""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.generate import MeshArrays, MeshError
from epsmesh.scene.model import PROBE, SLIT, Scene
from epsmesh.shapes.triangles import edge_keys


def open_slit(mesh: MeshArrays, scene: Scene) -> MeshArrays:
    """Return ``mesh``, of tetrahedra with four nodes each, cut open along its slit.

    Raises:
        MeshError: if a part of the slit stays closed.
    """
    faces = np.concatenate([mesh.facets[PROBE], mesh.facets[SLIT]])
    opened = np.zeros(len(mesh.points), dtype=bool)
    opened[faces] = True
    opened[_front(mesh, faces)] = False
    if not opened[faces].any(axis=1).all():
        raise MeshError("triangles of the slit have all of their corners on its front: use a smaller rim")
    twin = np.where(opened, len(mesh.points) + np.cumsum(opened) - 1, np.arange(len(mesh.points)))
    beyond = _is_beyond(mesh.points[mesh.cells].mean(axis=1), scene)
    cells = np.where(beyond[:, None], twin[mesh.cells], mesh.cells)
    facets = {
        name: np.where(_is_beyond(mesh.points[f].mean(axis=1), scene)[:, None], twin[f], f)
        for name, f in mesh.facets.items() if name not in (PROBE, SLIT)
    }  # fmt: skip
    facets |= {name: np.vstack([mesh.facets[name], twin[mesh.facets[name]]]) for name in (PROBE, SLIT)}
    points = np.vstack([mesh.points, mesh.points[opened]])
    return replace(mesh, points=points, cells=cells, facets=facets, rim=np.union1d(mesh.rim, twin[mesh.rim]))


def _front(mesh: MeshArrays, faces: IntArray) -> IntArray:
    """Return the points of the slit's front: edges of one of its triangles, not on the body's surface."""
    count = len(mesh.points)
    keys, times = np.unique(edge_keys(faces, count), return_counts=True)
    outer = np.concatenate([f for name, f in mesh.facets.items() if name not in (PROBE, SLIT)])
    front = np.setdiff1d(keys[times == 1], edge_keys(outer, count))
    return np.unique([front // count, front % count])


def _is_beyond(points: FloatArray, scene: Scene) -> BoolArray:
    """Return a mask of points (n, 3) on the far side of the slit's plane."""
    return np.asarray(scene.frame.local(points)[:, 1] > 0)
