"""Loose tissue in a mesh: the nodes between it and the tissue that it touches are doubled, at the same places."""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import BoolArray, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.generate import MeshArrays, MeshError
from epsmesh.scene.model import BELOW, LOOSE
from epsmesh.shapes.regions import Loose
from epsmesh.shapes.triangles import edge_keys, facet_keys

_FACETS = np.array([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)])


def part_loose(mesh: MeshArrays, loose: Loose) -> MeshArrays:
    """Return ``mesh``, of four or ten nodes per cell, with ``loose`` tissue parted from all other.

    Raises:
        MeshError: if it touches none.
    """
    assert mesh.regions is not None
    is_upper = np.isin(mesh.regions, loose.parts)
    if loose.height is not None:
        is_upper = mesh.points[mesh.cells[:, :4], 2].mean(axis=1) > loose.height
    of_upper, of_lower = (_facets(mesh.cells[chosen]) for chosen in (is_upper, ~is_upper))
    own = facet_keys(of_upper)
    between = of_upper[np.isin(own, facet_keys(of_lower))]
    if not len(between):
        raise MeshError(f"{loose.name} touches no other tissue: its contact is with none")
    doubled = np.zeros(len(mesh.points), dtype=bool)
    doubled[between] = True
    doubled[_middles(mesh, between)] = True
    twin = np.where(doubled, len(mesh.points) + np.cumsum(doubled) - 1, np.arange(len(mesh.points)))

    def parted(corners: IntArray, beside: BoolArray) -> IntArray:
        """Return triangles or cells with the nodes of loose tissue where they are ``beside`` it."""
        return np.where(beside[:, None], twin[corners], corners)

    facets = {name: parted(triangles, np.isin(facet_keys(triangles), own)) for name, triangles in mesh.facets.items()}
    return replace(
        mesh,
        points=np.vstack([mesh.points, mesh.points[doubled]]),
        cells=parted(mesh.cells, is_upper),
        facets=facets | {LOOSE: twin[between], BELOW: between},
        rim=np.union1d(mesh.rim, twin[mesh.rim]),
    )


def _facets(cells: IntArray) -> IntArray:
    return cells[:, _FACETS].reshape(-1, 3)


def _middles(mesh: MeshArrays, between: IntArray) -> IntArray:
    """Return the mid nodes of the edges of triangles, none of a mesh of four nodes per cell."""
    if mesh.cells.shape[1] == 4:
        return np.empty(0, dtype=np.int64)
    ends, middles = mesh.cells[:, EDGES].reshape(-1, 2), mesh.cells[:, 4:].ravel()
    keys = np.sort(ends, axis=1) @ np.array([len(mesh.points), 1])
    return np.asarray(middles[np.isin(keys, edge_keys(between, len(mesh.points)))])
