"""Surfaces without needles and specks, which remeshers drop: those of marching cubes are full of them."""

import numpy as np
from scipy.sparse import coo_array

from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.organ.sheet import FIXED, FREE, Sheet

# A facet is a speck or a needle whose area is less than this, for its longest edge, or whose edges are this short, for
# those of the surface.
_FLAT, _SHORT = 0.02, 0.1
_ROUNDS = 8


def evened(sheet: Sheet) -> Sheet:
    """Return the sheet with the points of its specks and needles moved towards the middle of their neighbours.

    Those on the support's edge and on sharp edges stay. What moves is put back onto the true surface later.
    """
    stay = np.union1d(sheet.border(FIXED, FREE), sheet.sharp)
    ends = np.concatenate([sheet.facets[:, [0, 1]], sheet.facets[:, [1, 2]], sheet.facets[:, [2, 0]]])
    count = len(sheet.points)
    beside = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
    number = np.asarray(beside.sum(axis=1)).ravel()
    points = sheet.points.copy()
    for _ in range(_ROUNDS):
        moving = np.setdiff1d(np.unique(sheet.facets[_is_speck(points, sheet.facets)]), stay)
        if not len(moving):
            break
        points[moving] = (beside[moving] @ points) / number[moving, None]
    return Sheet(points, sheet.facets, sheet.group, sheet.sharp)


def _is_speck(points: FloatArray, facets: IntArray) -> np.ndarray:
    a, b, c = (points[facets[:, k]] for k in range(3))
    edges = np.stack([np.linalg.norm(x, axis=1) for x in (b - a, c - b, a - c)])
    double = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return (double < _FLAT * edges.max(axis=0) ** 2) | (edges.min(axis=0) < _SHORT * np.median(edges))


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
