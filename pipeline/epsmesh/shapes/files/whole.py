"""From the facets of a file to a surface that bounds tissue."""

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files import check
from epsmesh.shapes.files.edges import Edges
from epsmesh.shapes.files.mend import joined, without_flats
from epsmesh.shapes.files.raw import Raw
from epsmesh.shapes.files.repair import repaired
from epsmesh.shapes.files.weld import drop_unused
from epsmesh.shapes.triangles import SurfaceError, Triangles, enclosed

# Largest relative change of the volume by `smooth`.
MOST_VOLUME = 0.05


def made_whole(
    raw: Raw, unit: float, repair: bool = False, smooth: float | None = None, may_cross: bool = True
) -> tuple[Triangles, tuple[str, ...]]:
    """Return the surface in metres, welded and oriented outward, and notices of what was changed.

    ``smooth`` is a length (m); facets are searched for crossings if they ``may_cross``.

    Raises:
        SurfaceError: if it does not bound one piece of tissue; the message says what was found and how to repair it.
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
        points, facets, more = _smoothed(points, edges.facets, smooth / unit)
        edges, notices = Edges(facets), notices + more
        _check_smoothed(points, edges, unit)
    facets, more = _outward(points, edges.facets)
    points, facets = drop_unused(points, facets)
    return Triangles(points * unit, np.ascontiguousarray(facets)), (*raw.notices, *notices, *more)


def _smoothed(points: FloatArray, facets: IntArray, length: float) -> tuple[FloatArray, IntArray, list[str]]:
    """Return a surface without bumps shorter than ``length`` (in the unit of the points), and notices.

    Coordinates pass the filter 1 / (1 + (k length)⁴) of their wave numbers k, as Taubin's (SIGGRAPH 1995), but in one
    step and independent of the facets' size. Waves four times as long as 2π ``length`` keep .996 of their height, and a
    ball of ten times the ``length`` .9996 of its radius.

    Raises:
        SurfaceError: if the volume changes by more than 5 %.
    """
    points, facets = drop_unused(points, facets)
    import igl  # noqa: PLC0415 (0.1 s to import, which other files do not need)
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    stiffness, mass = -igl.cotmatrix(points, facets), igl.massmatrix(points, facets, igl.MASSMATRIX_TYPE_BARYCENTRIC)
    before = enclosed(points, facets)

    # 1 / (1 + w²) is the real part of 1 / (1 + iw): one solve, whose matrix couples direct neighbours only.
    solve = splu(
        (mass + 1j * length**2 * stiffness).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
    )
    weights = mass.diagonal()[:, None]
    middle = points.mean(axis=0)
    result: FloatArray = middle + np.ascontiguousarray(solve.solve((weights * (points - middle)).astype(complex)).real)
    change = enclosed(result, facets) / before - 1
    moved = float(np.linalg.norm(result - points, axis=1).max())
    if not abs(change) <= MOST_VOLUME:
        raise SurfaceError(
            f"`smooth` would change the volume by {change:+.1%}, allowed are {MOST_VOLUME:.0%}: use a smaller length"
        )
    return result, facets, [f"smoothed: volume {change:+.2%}, points moved by {moved / length:.2g} of `smooth` at most"]


def _check_smoothed(points: FloatArray, edges: Edges, unit: float) -> None:
    try:
        check.check_whole(points, edges, unit)
    except SurfaceError as error:
        found = str(error).partition(": ")[0]
        raise SurfaceError(f"after smoothing, {found}: use another length of `smooth`, or none") from error


def _without_flats(points: FloatArray, edges: Edges) -> tuple[Edges, list[str]]:
    """Return facets all of which have an area, if all edges have two facets."""
    if not (edges.counts == 2).all():
        return edges, []
    facets, notices = without_flats(points, edges.facets)
    return (Edges(facets), notices) if notices else (edges, [])


def _outward(points: FloatArray, facets: IntArray) -> tuple[IntArray, list[str]]:
    if enclosed(points, facets) > 0:
        return facets, []
    return facets[:, ::-1], ["all its facets were inverted: turned"]
