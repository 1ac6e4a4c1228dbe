"""Surfaces without specks, which remeshers drop: those of marching cubes are full of them."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.generate import MeshError
from pipeline.mesh.organ.sheet import Sheet, edges_of

# Points nearer than this to each other, for the edges of the surface, are one.
_SAME = 0.05


def merged(points: FloatArray, facets: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a closed surface with points that are next to each other made one, itself where that would open it."""
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
    # Two facets with the same corners, once a speck between them is gone, lie upon each other.
    _, first, number = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True)
    corners = corners[number[first.ravel()] == 1]
    try:
        edges_of(corners)
    except MeshError:
        return points, facets
    used = np.zeros(groups, dtype=bool)
    used[corners] = True
    return middles[used], (np.cumsum(used) - 1)[corners]


def closed(sheet: Sheet) -> Sheet:
    """Return the sheet with the holes closed that a remesher leaves where it drops a facet."""
    pairs = np.concatenate([sheet.facets[:, [0, 1]], sheet.facets[:, [1, 2]], sheet.facets[:, [2, 0]]])
    base = len(sheet.points)
    keys, back = pairs @ np.array([base, 1]), pairs @ np.array([1, base])
    alone = ~np.isin(keys, back)
    if not alone.any():
        return sheet
    # Round a hole one goes against its facets.
    following = {end: start for start, end in pairs[alone].tolist()}
    owner = dict(zip(pairs[alone][:, 1].tolist(), np.tile(sheet.group, 3)[alone].tolist(), strict=True))
    facets, groups = [], []
    while following:
        first = min(following)
        loop, point = [first], following.pop(first)
        while point != first and point in following:
            loop.append(point)
            point = following.pop(point)
        facets += [(first, loop[k], loop[k + 1]) for k in range(1, len(loop) - 1)]
        groups += [owner[first]] * (len(loop) - 2)
    if not facets:
        return sheet
    return Sheet(
        sheet.points, np.vstack([sheet.facets, facets]), np.concatenate([sheet.group, groups]), sheet.sharp
    )  # fmt: skip
