"""Data and helpers shared by all formats: polygons as in a file, and numbers as text."""

import warnings
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.triangles import SurfaceError

# Most facets of a surface that will be remeshed: a whole body scanned at 1 mm has fewer.
MOST_FACETS = 2_000_000


@dataclass(frozen=True)
class Raw:
    """Points (n, 3) in the unit of a file, triangles (m, 3) between them, and notices about ignored parts."""

    points: FloatArray
    facets: IntArray
    notices: tuple[str, ...] = ()


def limit(facets: int) -> None:
    """Refuse too many facets, before memory is allocated for them."""
    if facets > MOST_FACETS:
        raise SurfaceError(
            f"{facets:,} facets, more than {MOST_FACETS:,}: fewer give the same force. "
            "Simplify it, in MeshLab by Quadric Edge Collapse Decimation, in 3D Slicer by Surface Toolbox, Decimate"
        )


def numbers(text: bytes) -> FloatArray | None:
    """Return the numbers of a text, None if it contains anything else."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # numpy warns where text is not a number
        try:
            return np.fromstring(text, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def table(rows: list[bytes], mark: float) -> tuple[FloatArray, IntArray] | None:
    """Return the numbers in ``rows`` and how many each row has; None if there is anything else.

    ``mark`` is a number that does not occur, used as separator.
    """
    values = numbers(f" {mark!r} ".encode().join([*rows, b""]))
    if values is None:
        return None
    (ends,) = np.nonzero(values == mark)
    if len(ends) != len(rows):
        return None
    counts = np.diff(ends, prepend=-1) - 1
    return np.delete(values, ends), counts


def whole(values: FloatArray) -> IntArray:
    """Return point numbers as integers.

    Raises:
        SurfaceError: if one of them is not an integer.
    """
    wrong = ~np.isfinite(values) | (values != np.floor(values))
    if wrong.any():
        raise SurfaceError(f"a facet names point {values[wrong][0]:g}, which is not an integer: export it again")
    return values.astype(np.int64)


def is_number(word: bytes) -> bool:
    """Return whether a word is a number."""
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def triangulate(points: FloatArray, corners: IntArray, counts: IntArray) -> IntArray:
    """Return triangles of polygons; ``counts`` (m,) are the numbers of ``corners`` of each.

    A polygon with more than three corners is cut from a corner from which all triangles have the same orientation.

    Raises:
        SurfaceError: if a polygon has fewer than three corners, or no such corner.
    """
    if len(counts) and counts.min() < 3:
        raise SurfaceError(f"a facet with {counts.min()} corners, but a facet needs three: write it out as triangles")
    starts = np.cumsum(counts) - counts
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    limit(int((counts - 2).sum()))
    groups, order = [], []
    for count in np.unique(counts):
        (which,) = np.nonzero(counts == count)
        polygons = corners[starts[which][:, None] + np.arange(count)]
        with np.errstate(all="ignore"):  # check_numbers reports values that are not finite
            groups.append(_fans(points, polygons).reshape(-1, 3))
        order.append(np.repeat(which, count - 2))
    return np.concatenate(groups)[np.argsort(np.concatenate(order), kind="stable")]


def _fans(points: FloatArray, polygons: IntArray) -> IntArray:
    """Return the triangles (m, k - 2, 3) of polygons (m, k)."""
    count = polygons.shape[1]
    normals = sum(
        np.cross(points[polygons[:, i]], points[polygons[:, (i + 1) % count]]) for i in range(count)
    )  # Newell's
    best = np.zeros((len(polygons), count - 2, 3), dtype=np.int64)
    undone: BoolArray = np.ones(len(polygons), dtype=bool)
    for first in range(count):
        turned = np.roll(polygons[undone], -first, axis=1)
        fan = np.stack(
            [np.stack([turned[:, 0], turned[:, i], turned[:, i + 1]], axis=1) for i in range(1, count - 1)], 1
        )
        a, b, c = (points[fan[..., k]] for k in range(3))
        same = np.einsum("mij,mj->mi", np.cross(b - a, c - a), normals[undone]).min(axis=1) >= 0
        (where,) = np.nonzero(undone)
        best[where[same]] = fan[same]
        undone[where[same]] = False
        if not undone.any():
            return best
    x, y, z = points[polygons[undone][0, 0]]
    raise SurfaceError(
        f"a facet of {count} corners at ({x:.4g}, {y:.4g}, {z:.4g}) folds inwards: write it out as triangles "
        "(MeshLab: Turn into a Pure-Triangular Mesh)"
    )
