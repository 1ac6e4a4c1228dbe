"""From facets as a file holds them to a surface that bounds tissue."""

import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.shapes.files import check
from pipeline.shapes.files.edges import Edges
from pipeline.shapes.files.mend import joined, without_flats
from pipeline.shapes.files.raw import Raw
from pipeline.shapes.files.repair import repaired
from pipeline.shapes.files.smooth import smoothed
from pipeline.shapes.files.weld import drop_unused
from pipeline.shapes.triangles import SurfaceError, Triangles, enclosed


def made_whole(
    raw: Raw, unit: float, repair: bool = False, smooth: float | None = None, may_cross: bool = True
) -> tuple[Triangles, tuple[str, ...]]:
    """Return the surface in metres, welded and turned outwards, and what was done to it.

    ``smooth`` is a length (m); facets are searched for crossings if they ``may_cross``.

    Raises:
        SurfaceError: if it does not bound one piece of tissue; says what was found, and what mends it.
    """
    check.check_numbers(raw)
    check.check_size(raw.points, raw.facets, unit)
    points, facets, notices = joined(raw.points, raw.facets)
    edges, more = _without_flats(points, Edges(facets))
    notices += more
    if repair:
        points, facets, more = repaired(points, edges.facets, unit)
        edges, notices = Edges(facets), notices + more
    check.check_whole(points, edges, unit, may_cross)
    if smooth:
        points, facets, more = smoothed(points, edges.facets, smooth / unit)
        edges, notices = Edges(facets), notices + more
        _check_smoothed(points, edges, unit)
    facets, more = _outward(points, edges.facets)
    points, facets = drop_unused(points, facets)
    return Triangles(points * unit, np.ascontiguousarray(facets)), (*raw.notices, *notices, *more)


def _check_smoothed(points: FloatArray, edges: Edges, unit: float) -> None:
    try:
        check.check_whole(points, edges, unit)
    except SurfaceError as error:
        found = str(error).partition(": ")[0]
        raise SurfaceError(f"once smoothed, {found}: another length of `smooth`, or none") from error


def _without_flats(points: FloatArray, edges: Edges) -> tuple[Edges, list[str]]:
    """Return facets of which none is without area, where all edges have two facets."""
    if not (edges.counts == 2).all():
        return edges, []
    facets, notices = without_flats(points, edges.facets)
    return (Edges(facets), notices) if notices else (edges, [])


def _outward(points: FloatArray, facets: IntArray) -> tuple[IntArray, list[str]]:
    if enclosed(points, facets) > 0:
        return facets, []
    return facets[:, ::-1], ["all its facets were inverted, seen from within: turned"]
