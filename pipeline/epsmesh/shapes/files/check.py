"""Checks of a surface before it is meshed: closed, one piece, oriented outward, and of an organ's size.

Messages give places in the file's own numbers, so that other programs find them.
"""

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.files.crossings import crossings
from epsmesh.shapes.files.edges import Edges, components, oriented
from epsmesh.shapes.files.mend import flats
from epsmesh.shapes.files.raw import Raw
from epsmesh.shapes.triangles import SurfaceError, doubled_normals, enclosed

# Smallest and largest extent (m) of a body.
SMALLEST, LARGEST = 1e-3, 2.0
_UNITS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
# Facets are an open sheet if they enclose less than this share of the volume of a ball of the same area.
_SHEET = 1e-4
# Most points of a shell that are tested for being inside another one.
_SAMPLES = 60


def check_whole(points: FloatArray, edges: Edges, unit: float, may_cross: bool = True) -> None:
    """Refuse a surface that does not bound one piece of tissue; skip the test for crossings unless ``may_cross``."""
    check_edges(points, edges, unit)
    check_shells(points, edges, unit)
    if may_cross:
        check_crossings(points, edges.facets)


def check_numbers(raw: Raw) -> None:
    """Refuse numbers that are not finite, and a surface without facets."""
    if not len(raw.facets):
        raise SurfaceError("has no facets: export the surface, not points alone or an empty scene")
    (wrong,) = np.nonzero(~np.isfinite(raw.points).all(axis=1))
    if len(wrong):
        values = ", ".join(f"{c:g}" for c in raw.points[wrong[0]])
        raise SurfaceError(
            f"{len(wrong):,} of its points are not finite, such as point {wrong[0] + 1:,}, ({values}): export it again"
        )


def check_size(points: FloatArray, facets: IntArray, unit: float) -> None:
    """Refuse a size that no organ has: most likely, the unit is wrong."""
    extent = float(np.ptp(points[facets].reshape(-1, 3), axis=0).max())
    if SMALLEST <= extent * unit <= LARGEST:
        return
    fitting = [f'"{name}"' for name, size in _UNITS.items() if SMALLEST <= extent * size <= LARGEST]
    hint = f"unit = {' or '.join(fitting)} would fit" if fitting else "no usual unit makes an organ of it"
    raise SurfaceError(
        f"is {_length(extent * unit)} across, allowed are {_length(SMALLEST)} to {_length(LARGEST)}; its numbers span "
        f"{extent:.4g}: {hint}"
    )


def check_edges(points: FloatArray, edges: Edges, unit: float) -> None:
    """Refuse fins, holes and inconsistently oriented facets."""
    if len(edges.fins):
        where = _place(points[edges.half[edges.fins[0]]].mean(axis=0))
        raise SurfaceError(
            f"{len(edges.fins):,} edges have more than two facets (fins, inner walls, or parts that touch), "
            f"such as at {where}: `repair = true`, or MeshLab: Repair Non Manifold Edges"
        )
    if len(edges.open):
        raise SurfaceError(_holes(points, edges, unit))
    if len(edges.turned):
        _, flipped = oriented(edges)
        if flipped is None:
            raise SurfaceError("its facets form a one-sided surface, like a Möbius strip, which encloses no volume")
        where = _place(points[edges.facets[flipped[0]]].mean(axis=0))
        raise SurfaceError(
            f"{len(flipped):,} facets are inverted: their normals point opposite to those of their neighbours, "
            f"such as at {where}: `repair = true`, or MeshLab: Re-Orient All Faces Coherently"
        )


def _holes(points: FloatArray, edges: Edges, unit: float) -> str:
    ends = edges.half[edges.open]
    numbers, local = np.unique(ends, return_inverse=True)
    count, loop = components(local.reshape(-1, 2), len(numbers))
    lengths = np.bincount(
        loop[local.reshape(-1, 2)[:, 0]], np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1), count
    )
    largest = int(lengths.argmax())
    where = _place(points[numbers[loop == largest]].mean(axis=0))
    holes = "1 hole" if count == 1 else f"{count:,} holes, the largest"
    return (
        f"is not closed: {holes} with an edge {_length(float(lengths[largest]) * unit)} long "
        f"({len(ends):,} open edges in all), round {where}: `repair = true`, or MeshLab: Close Holes"
    )


def check_shells(points: FloatArray, edges: Edges, unit: float) -> None:
    """Refuse several pieces, pieces joined at single points, and sheets."""
    count, shell = edges.shells
    facets = edges.facets
    if count > 1:
        raise SurfaceError(_shells(points, facets, shell, count, unit))
    pinched = edges.pinched()
    if len(pinched):
        raise SurfaceError(
            f"{len(pinched):,} points join parts that share nothing else there, such as "
            f"{_place(points[pinched[0]])}: `repair = true`, or MeshLab: Repair Non Manifold Vertices by Splitting"
        )
    area = float(np.linalg.norm(doubled_normals(points, facets), axis=1).sum()) / 2
    if abs(enclosed(points, facets)) < _SHEET * area**1.5 / (6 * np.sqrt(np.pi)):
        raise SurfaceError("encloses no volume: it is a sheet; export a closed surface, or thicken it")
    flat = flats(points, facets)
    if len(flat):
        where = _place(points[facets[flat[0]]].mean(axis=0))
        raise SurfaceError(
            f"{len(flat):,} facets have no area, such as at {where}: `repair = true`, or MeshLab: Remove T-Vertices"
        )


def shell_volumes(points: FloatArray, facets: IntArray, shell: IntArray, count: int) -> FloatArray:
    """Return the volume enclosed by each shell, in the cube of the points' unit."""
    a, b, c = (points[facets[:, k]] - points[facets[0, 0]] for k in range(3))
    volumes: FloatArray = np.bincount(shell, np.einsum("ij,ij->i", a, np.cross(b, c)), count) / 6
    return volumes


def _shells(points: FloatArray, facets: IntArray, shell: IntArray, count: int, unit: float) -> str:
    volumes = np.abs(shell_volumes(points, facets, shell, count)) * unit**3
    order = np.argsort(-volumes, kind="stable")
    sizes = ", ".join(f"{1e6 * v:.3g}" for v in volumes[order[:3]]) + (", …" if count > 3 else "")
    second = np.unique(facets[shell == order[1]])
    inside = _within(points, facets[shell == order[0]], second)
    how = "inside" if inside.all() else "beside" if not inside.any() else "across"
    return (
        f"has {count:,} separate shells, of {sizes} cm³, but one must bound the tissue; the second is {how} the first, "
        f"around {_place(points[second].mean(axis=0))}: delete what does not belong to it, or `repair = true` "
        "(keeps the largest), or unite them in MeshLab: Mesh Boolean: Union"
    )


def _within(points: FloatArray, facets: IntArray, chosen: IntArray) -> BoolArray:
    """Return a mask of points, sampled evenly from ``chosen``, that are inside closed facets."""
    some = chosen[:: -(-len(chosen) // _SAMPLES)]
    turns = np.zeros(len(some))
    for k, point in enumerate(points[some]):
        a, b, c = (points[facets[:, corner]] - point for corner in range(3))
        la, lb, lc = (np.linalg.norm(edge, axis=1) for edge in (a, b, c))
        # Solid angle of each facet: Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 125 (1983).
        dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
        below = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
        turns[k] = np.arctan2(np.einsum("ij,ij->i", a, np.cross(b, c)), below).sum() / (2 * np.pi)
    within: BoolArray = np.abs(turns) > 0.5
    return within


def check_crossings(points: FloatArray, facets: IntArray) -> None:
    """Refuse facets that cross or touch others."""
    found = crossings(points, facets)
    if len(found):
        where = _place(points[facets[found[0]]].mean(axis=(0, 1)))
        raise SurfaceError(
            f"{len(found):,} pairs of facets cross or overlap, such as at {where}: `repair = true`, "
            "or MeshLab: Select Self Intersecting Faces, delete them, Close Holes"
        )


def _place(point: FloatArray) -> str:
    x, y, z = point + 0.0
    return f"({x:.4g}, {y:.4g}, {z:.4g})"


def _length(metres: float) -> str:
    for unit, size in (("km", 1e3), ("m", 1.0), ("mm", 1e-3)):
        if metres >= size:
            return f"{metres / size:.3g} {unit}"
    return f"{metres * 1e3:.3g} mm"


def outside_out(points: FloatArray, facets: IntArray, edges: Edges) -> IntArray:
    """Return facets oriented outward from the tissue: outward on the largest shell, inward on those of hollows."""
    count, shell = edges.shells
    volumes = shell_volumes(points, facets, shell, count)
    wanted = np.where(np.arange(count) == np.argmax(np.abs(volumes)), 1, -1)
    return np.where((volumes * wanted < 0)[shell][:, None], facets[:, ::-1], facets)
