"""What is asked of a surface before tissue is meshed in it: closed, one piece, outward, of an organ's size."""

from pipeline.shapes.arrays import FloatArray, IntArray, np
from pipeline.shapes.files.edges import Edges
from pipeline.shapes.files.raw import Raw
from pipeline.shapes.files.weld import drop_unused, weld
from pipeline.shapes.triangles import SurfaceError, Triangles, doubled_normals, enclosed

# What a tool may press on (m).
SMALLEST, LARGEST = 1e-3, 2.0
_UNITS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
_MEND = "`repair = true`, or MeshLab"


def made_whole(raw: Raw, unit: float) -> tuple[Triangles, tuple[str, ...]]:
    """Return the surface in metres, welded and turned outwards, and what was done to it.

    Raises:
        SurfaceError: if it does not bound one piece of tissue; says what was found, and what mends it.
    """
    check_numbers(raw)
    points, facets, notices = welded(raw)
    points = points * unit
    check_size(points, unit)
    facets, more = without_doubles(points, facets)
    notices += more
    edges = Edges(facets)
    check_edges(points, edges)
    check_shells(points, edges)
    volume = enclosed(points, facets)
    if volume < 0:
        facets = facets[:, ::-1]
        notices += ("all facets were seen from inside: turned",)
    points, facets = drop_unused(points, facets)
    return Triangles(points, np.ascontiguousarray(facets)), notices


def check_numbers(raw: Raw) -> None:
    """Refuse what is no number, and what has no facets."""
    if not len(raw.facets):
        raise SurfaceError("has no facets: export the surface, not the points or an empty scene")
    (wrong,) = np.nonzero(~np.isfinite(raw.points).all(axis=1))
    if len(wrong):
        values = ", ".join(f"{c:g}" for c in raw.points[wrong[0]])
        raise SurfaceError(
            f"{len(wrong):,} points are not finite, such as number {wrong[0] + 1:,}: ({values}): export it again"
        )


def welded(raw: Raw) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    """Return points and facets with every point once."""
    points, number = weld(raw.points)
    return points, number[raw.facets], ()


def check_size(points: FloatArray, unit: float) -> None:
    """Refuse what is too small or too large for an organ: most likely, the unit is another one."""
    extent = float(np.ptp(points, axis=0).max())
    if SMALLEST <= extent <= LARGEST:
        return
    fitting = [f'"{name}"' for name, size in _UNITS.items() if SMALLEST <= extent / unit * size <= LARGEST]
    hint = f"unit = {' or '.join(fitting)} would fit" if fitting else "no usual unit makes an organ of it"
    raise SurfaceError(
        f"is {extent:.3g} m across, allowed are {SMALLEST * 1e3:g} mm to {LARGEST:g} m; "
        f"its numbers span {extent / unit:.4g}: {hint}"
    )


def without_doubles(points: FloatArray, facets: IntArray) -> tuple[IntArray, tuple[str, ...]]:
    """Return facets without those that have two corners in one point."""
    flat = (facets == np.roll(facets, 1, axis=1)).any(axis=1)
    if not flat.any():
        return facets, ()
    return facets[~flat], (f"{flat.sum():,} facets with two corners in one point left out",)


def check_edges(points: FloatArray, edges: Edges) -> None:
    """Refuse holes, fins and facets seen from opposite sides."""
    if len(edges.fins):
        where = _place(points[edges.half[edges.fins[0]]].mean(axis=0))
        raise SurfaceError(f"{len(edges.fins):,} edges have more than two facets, such as at {where}: {_MEND}")
    if len(edges.open):
        where = _place(points[edges.half[edges.open[0]]].mean(axis=0))
        raise SurfaceError(f"not closed: {len(edges.open):,} edges have one facet alone, such as at {where}: {_MEND}")
    if len(edges.turned):
        where = _place(points[edges.half[edges.turned[0, 0]]].mean(axis=0))
        raise SurfaceError(
            f"at {len(edges.turned):,} edges the two facets are seen from opposite sides, such as at {where}: {_MEND}"
        )


def check_shells(points: FloatArray, edges: Edges) -> None:
    """Refuse more than one piece, and pieces that hang together by a point."""
    count, _ = edges.shells
    if count > 1:
        raise SurfaceError(f"{count:,} separate shells, where one bounds the tissue: delete the others, or {_MEND}")
    pinched = edges.pinched()
    if len(pinched):
        raise SurfaceError(
            f"{len(pinched):,} points join two parts that have nothing else in common, "
            f"such as at {_place(points[pinched[0]])}: {_MEND}"
        )
    size = np.linalg.norm(doubled_normals(points, edges.facets), axis=1).sum() / 2
    if abs(enclosed(points, edges.facets)) < 1e-6 * size**1.5:
        raise SurfaceError("its facets enclose no volume: it is a sheet; export a closed surface")


def _place(point: FloatArray) -> str:
    x, y, z = 1e3 * point
    return f"({x:.4g}, {y:.4g}, {z:.4g}) mm"
