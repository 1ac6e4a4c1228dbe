"""Untangling: removal of self-intersections and folds of a surface, so that its volume can be meshed."""

from math import cos, radians

import numpy as np
from scipy.sparse import coo_array

from epsmesh.arrays import BoolArray, IntArray
from epsmesh.mesh.organ.sheet import WALL, Sheet, TangledError
from epsmesh.shapes.files.crossings import crossings

# Neighbouring facets with a smaller angle between them are folded: a tetrahedron between them would be flat. A fold of
# the file itself may have the second angle.
_FOLDED, _SHARPEST = radians(10.0), radians(1.0)
# Facets with a height below this share of their longest edge are slivers, on which tetrahedra fail; those above the
# second share may remain.
_THIN, _THINNEST = 1e-3, 1e-6
# Rounds of moving the points of bad facets; after the second number of rounds their neighbours are moved, too.
_ROUNDS, _WIDER = 12, 4


def bad_facets(sheet: Sheet) -> BoolArray:
    """Return a mask of facets that cross others, are slivers, or are folded onto a neighbour."""
    return crossing_facets(sheet) | _misshapen(sheet, _FOLDED, _THIN)


def crossing_facets(sheet: Sheet) -> BoolArray:
    """Return a mask of facets that cross others."""
    found = np.zeros(len(sheet.facets), dtype=bool)
    found[crossings(sheet.points, sheet.facets)] = True
    return found


def _misshapen(sheet: Sheet, angle: float, height: float) -> BoolArray:
    """Return a mask of facets with an angle (rad) to a neighbour, or a height (share), below these limits."""
    found = sheet.heights < height
    _, sides, turned = sheet.neighbours()
    normals = sheet.normals
    found[sides[turned * (normals[sides[:, 0]] * normals[sides[:, 1]]).sum(axis=1) < -cos(angle)]] = True
    return found


def untangled(sheet: Sheet, stay: IntArray) -> Sheet:
    """Return the sheet with points of bad facets moved to the middle of their neighbours, until no facet is bad.

    The points ``stay`` do not move. Points on sharp edges, and at junctions, do not move at first, and those between
    other groups remain in their level.

    Raises:
        TangledError: if bad facets remain.
    """
    edges, sides, _ = sheet.neighbours()
    groups, kinds, count = sheet.group[sides], sheet.kind[sides], len(sheet.points)
    level = np.unique(edges[(kinds[:, 0] != kinds[:, 1]) & (kinds != WALL).all(axis=1)])
    fixed = np.zeros(count, dtype=bool)
    fixed[stay] = fixed[edges[groups[:, 0] != groups[:, 1]]] = fixed[sheet.sharp] = True
    ends = np.vstack([edges, edges[:, ::-1]])
    beside = coo_array((np.ones(len(ends)), tuple(ends.T)), shape=(count, count)).tocsr()
    share = beside.sum(axis=1)
    fillable: Sheet | None = None
    for number in range(_ROUNDS):
        crossing = crossing_facets(sheet)
        bad = crossing | _misshapen(sheet, _FOLDED, _THIN)
        if not bad.any():
            return sheet
        if fillable is None and not (crossing.any() or _misshapen(sheet, _SHARPEST, _THINNEST).any()):
            fillable = sheet
        if number == 0:
            first = sheet.points[sheet.facets[bad]]
        if number == _WIDER:
            fixed[:] = False
            fixed[stay] = True
            # Facets that remain bad are the start of the next rounds.
            stubborn = sheet.points[sheet.facets[bad]]
        moved = np.zeros(count)
        moved[sheet.facets[bad]] = 1.0
        for _ in range(number // _WIDER):
            moved += beside @ moved
        chosen = (moved > 0) & ~fixed
        points = sheet.points.copy()
        points[chosen] = (beside @ sheet.points / share[:, None])[chosen]
        points[level, 2] = sheet.points[level, 2]
        sheet = Sheet(points, sheet.facets, sheet.group, sheet.sharp)
    if fillable is not None:
        return fillable
    raise TangledError.at(np.vstack([stubborn, first]))
