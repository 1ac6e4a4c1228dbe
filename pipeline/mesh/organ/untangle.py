"""Surfaces that neither cross themselves nor fold upon themselves: no volume could be filled otherwise."""

from math import cos, radians

import numpy as np
from scipy.sparse import coo_array

from pipeline.arrays import BoolArray, FloatArray, IntArray
from pipeline.mesh.generate import MeshError
from pipeline.mesh.organ.sheet import Sheet, edges_of
from pipeline.shapes.files.crossings import crossings

# Neighbours with less between them are folded: a tetrahedron in there would be flat. A fold of the file itself may be
# as sharp as the second angle.
_FOLDED, _SHARPEST = radians(10.0), radians(1.0)
# Facets whose height is this share of their longest edge are needles, on which tetrahedra fail; the second share may
# remain.
_THIN, _THINNEST = 1e-3, 1e-6
# Points of bad facets are moved so often; after so many rounds, those next to them are moved, too.
_ROUNDS, _WIDER = 12, 4


class TangledError(MeshError):
    """A surface is not that of a volume at ``places`` (n, 3), within the ``reach`` (n) round each, all in m."""

    def __init__(self, places: FloatArray, reach: FloatArray, what: str = "the surface, meshed anew, crosses itself"):
        self.places, self.reach = places, reach
        x, y, z = 1e3 * places[0]
        super().__init__(f"{what} at ({x:.4g}, {y:.4g}, {z:.4g}) mm; `smooth`, or `repair`, may mend the file there")

    @staticmethod
    def at(corners: FloatArray, *what: str) -> "TangledError":
        """Return the error for facets or cells by their ``corners`` (n, k, 3), in m."""
        return TangledError(corners.mean(axis=1), np.ptp(corners, axis=1).max(axis=1), *what)


def bad_facets(sheet: Sheet) -> BoolArray:
    """Tell which facets cross others, are needles, or are folded upon a neighbour."""
    return _crossing(sheet) | _misshapen(sheet, _FOLDED, _THIN)


def _crossing(sheet: Sheet) -> BoolArray:
    found = np.zeros(len(sheet.facets), dtype=bool)
    found[crossings(sheet.points, sheet.facets)] = True
    return found


def _misshapen(sheet: Sheet, angle: float, height: float) -> BoolArray:
    """Tell which facets have less than an ``angle`` (rad) to a neighbour, or a ``height`` (share) less than that."""
    found = sheet.heights < height
    _, sides = edges_of(sheet.facets)
    normals = sheet.normals
    found[sides[(normals[sides[:, 0]] * normals[sides[:, 1]]).sum(axis=1) < -cos(angle)]] = True
    return found


def untangled(sheet: Sheet, stay: IntArray) -> Sheet:
    """Return the sheet with the points of bad facets in the middle of their neighbours, until no facet is bad.

    The points ``stay`` do. Those on sharp edges do at first, and those between other groups remain in their level.

    Raises:
        TangledError: if that does not mend them.
    """
    edges, sides = edges_of(sheet.facets)
    groups, count = sheet.group[sides], len(sheet.points)
    level = np.unique(edges[groups[:, 0] != groups[:, 1]])
    fixed = np.zeros(count, dtype=bool)
    fixed[stay] = fixed[level] = fixed[sheet.sharp] = True
    ends = np.vstack([edges, edges[:, ::-1]])
    beside = coo_array((np.ones(len(ends)), tuple(ends.T)), shape=(count, count)).tocsr()
    share = beside.sum(axis=1)
    fillable: Sheet | None = None
    for number in range(_ROUNDS):
        crossing = _crossing(sheet)
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
            # What is not mended moves on from here.
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
