"""From facets as a file holds them to a surface that bounds tissue."""

from pipeline.shapes.arrays import FloatArray, IntArray, np
from pipeline.shapes.files import check
from pipeline.shapes.files.edges import Edges
from pipeline.shapes.files.mend import joined, without_flats
from pipeline.shapes.files.raw import Raw
from pipeline.shapes.files.weld import drop_unused
from pipeline.shapes.triangles import Triangles, enclosed


def made_whole(raw: Raw, unit: float) -> tuple[Triangles, tuple[str, ...]]:
    """Return the surface in metres, welded and turned outwards, and what was done to it.

    Raises:
        SurfaceError: if it does not bound one piece of tissue; says what was found, and what mends it.
    """
    check.check_numbers(raw)
    check.check_size(raw.points, raw.facets, unit)
    points, facets, notices = joined(raw.points, raw.facets)
    edges = Edges(facets)
    check.check_edges(points, edges, unit)
    facets, more = without_flats(points, facets)
    if more:
        edges = Edges(facets)
        check.check_edges(points, edges, unit)
    check.check_shells(points, edges, unit)
    check.check_crossings(points, facets)
    facets, last = _outward(points, facets)
    points, facets = drop_unused(points, facets)
    return Triangles(points * unit, np.ascontiguousarray(facets)), (*raw.notices, *notices, *more, *last)


def _outward(points: FloatArray, facets: IntArray) -> tuple[IntArray, list[str]]:
    if enclosed(points, facets) > 0:
        return facets, []
    return facets[:, ::-1], ["all its facets were inverted, seen from within: turned"]
