"""Surfaces of embedded regions in a body of triangles, as triangles that follow the size field."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.generate import MeshError
from epsmesh.mesh.organ.base import settled
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.prepare import merged
from epsmesh.mesh.organ.remesh import remesh
from epsmesh.mesh.organ.sheet import FREE, Sheet, edges_of
from epsmesh.shapes.closed import Closed
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.triangles import edge_keys

# Points of the initial surface of an ellipsoid, and passes of remeshing: only in the second pass points are dense
# enough for sizes that change fast.
_POINTS, _PASSES = 1000, 2
# Largest deviation of chords from the surface, in units of half of its smallest thickness: the field rules the sizes.
# On coarse meshes it grows with the square of most sizes, as that of chords does, from so large ones on, up to a limit.
_DEVIATION, _FROM, _MOST_DEVIATION, _MOST_SIZES = 0.12, 0.8, 0.48, 0.5
# Largest change of the volume by chords, which curved edges restore; or by the chords of halved edges. Beyond, elements
# are smaller by these factors.
_EXCESS, _FINER = 0.1, (1.0, 1.5, 2.0)
_NO_EDGES = np.empty((0, 2), dtype=np.int64)


def embedded_surfaces(regions: Sequence[Embedded], field: Field) -> list[tuple[FloatArray, IntArray]]:
    """Return points (n, 3), in m, and facets (m, 3) of the surface of each region; points are on the true surface.

    Points whose facets would turn over stay within chords of it.

    Raises:
        MeshError: if the remesher fails.
    """
    return [_to_sizes(region, field) for region in regions]


def _to_sizes(region: Embedded, field: Field) -> tuple[FloatArray, IntArray]:
    surface = region.surface
    points, facets = _triangles(surface)
    given = Sheet(points, facets, np.full(len(facets), FREE), _NO_EDGES)
    size = float(np.quantile(field.at(points), _MOST_SIZES)) / (_FROM * surface.least)
    most = _DEVIATION + field.sizes.coarseness * (_MOST_DEVIATION - _DEVIATION)
    deviation = min(_DEVIATION * max(size, 1.0) ** 2, most) * surface.least
    for finer in _FINER:
        sheet = given
        for _ in range(_PASSES):
            sheet = remesh(sheet, field.at(sheet.points) / finer, deviation / finer)
            sheet = settled(sheet, surface.project(sheet.points))
        edges_of(sheet.facets)
        for made in (sheet, *([_halved(sheet, surface)] if field.sizes.coarseness else [])):
            if abs(excess := made.volume / surface.volume - 1) <= _EXCESS:
                return sheet.points, sheet.facets
    raise MeshError(f"the volume in the remeshed surface of {region.name} has changed by {excess:+.2%}")


def _halved(sheet: Sheet, surface: Closed) -> Sheet:
    """Return the sheet with its edges halved, on the true surface: nearly that of curved edges."""
    count = len(sheet.points)
    keys, inverse = np.unique(edge_keys(sheet.facets, count), return_inverse=True)
    middle = surface.project((sheet.points[keys // count] + sheet.points[keys % count]) / 2)
    a, b, c = sheet.facets.T
    w, u, v = (count + inverse).reshape(-1, 3).T
    facets = np.stack([a, w, v, w, b, u, v, u, c, u, v, w], axis=1).reshape(-1, 3)
    return Sheet(np.vstack([sheet.points, middle]), facets, np.repeat(sheet.group, 4), sheet.sharp)


def _triangles(surface: Closed) -> tuple[FloatArray, IntArray]:
    """Return the facets of a surface, oriented outward."""
    if isinstance(surface, Shell):
        return merged(surface.triangles.points, surface.triangles.facets)
    assert isinstance(surface, Ovoid)
    return _evenly(surface)


def _evenly(surface: Ovoid) -> tuple[FloatArray, IntArray]:
    """Return points spread evenly over the surface, and the facets between them, oriented outward."""
    points = surface.sample(_POINTS)
    on_ball = (points - np.array(surface.centre)) / np.array(surface.axes)
    facets = ConvexHull(on_ball).simplices.astype(np.int64)
    inward = np.linalg.det(on_ball[facets]) < 0
    facets[inward] = facets[inward][:, ::-1]
    return points, facets
