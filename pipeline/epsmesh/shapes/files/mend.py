"""Repairs that are always made, because they lose nothing, and reported."""

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.edges import Edges
from epsmesh.shapes.files.weld import weld

# Points of open edges closer than this share of the extent are identical: numbers in files have about six digits.
NEAR = 1e-5
# A facet has no area if its height is below this share of its longest edge.
FLAT = 1e-7
_PASSES = 20


def joined(points: FloatArray, facets: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """Return a surface with facets joined where their corners coincide, and a notice."""
    facets, notices = without_doubles(facets)
    if not len(Edges(facets).open):
        return points, facets, notices
    points, number = weld(points)
    facets, more = without_doubles(number[facets])
    edges = Edges(facets)
    if not len(edges.open):
        return points, facets, notices + more
    near = _near(points, np.unique(edges.half[edges.open]))
    if near is None:
        return points, facets, notices + more
    facets, last = without_doubles(near[facets])
    moved = int((near != np.arange(len(points))).sum())
    notice = f"{moved:,} points along gaps joined to their neighbours, at most {NEAR:g} of its extent away"
    return points, facets, [*notices, *more, notice, *last]


def _near(points: FloatArray, chosen: IntArray) -> IntArray | None:
    """Return, for each point, the first of the ``chosen`` points near it; None if no points are near each other."""
    from scipy.spatial import cKDTree  # noqa: PLC0415 (few files need it)

    reach = NEAR * float(np.ptp(points, axis=0).max())
    pairs = cKDTree(points[chosen]).query_pairs(reach, output_type="ndarray")
    if not len(pairs):
        return None
    result = np.arange(len(points))
    for first, second in chosen[np.sort(pairs, axis=1)[np.lexsort(pairs.T)]]:
        result[second] = min(result[second], result[first])
    return result


def without_doubles(facets: IntArray) -> tuple[IntArray, list[str]]:
    """Remove facets with two equal corners, and duplicates; return the others and notices."""
    notices = []
    flat = (facets == np.roll(facets, 1, axis=1)).any(axis=1)
    if flat.any():
        facets = facets[~flat]
        notices.append(f"{flat.sum():,} facets with two corners in one point left out")
    # Rotated so that the lowest number comes first, which keeps the orientation.
    shift = facets.argmin(axis=1)
    turned = facets[np.arange(len(facets))[:, None], (shift[:, None] + np.arange(3)) % 3]
    _, first = np.unique(_key(turned), return_index=True)
    if len(first) < len(facets):
        notices.append(f"{len(facets) - len(first):,} duplicate facets left out")
        facets = facets[np.sort(first)]
    return facets, notices


def _key(facets: IntArray) -> IntArray:
    """Return one number for each row of three."""
    count = int(facets.max(initial=0)) + 1
    if count**3 < 2**63:
        return (facets[:, 0] * count + facets[:, 1]) * count + facets[:, 2]
    return np.unique(facets, axis=0, return_inverse=True)[1].ravel()


def without_flats(points: FloatArray, facets: IntArray) -> tuple[IntArray, list[str]]:
    """Return a closed surface without facets whose corners are collinear.

    The longest edge of each such facet is flipped: its middle corner then splits the facet on the other side.
    """
    total = 0
    for _ in range(_PASSES):
        flat = flats(points, facets)
        if not len(flat):
            break
        turned = _turn(points, facets, flat)
        if turned is None:
            break
        facets, count = turned
        total += count
    return facets, [f"{total:,} edges beside facets without area flipped"] if total else []


def flats(points: FloatArray, facets: IntArray) -> IntArray:
    """Return the facets without area."""
    a, b, c = (points[facets[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    longest = np.max([np.einsum("ij,ij->i", edge, edge) for edge in (b - a, c - b, a - c)], axis=0)
    (found,) = np.nonzero(np.einsum("ij,ij->i", normal, normal) <= (FLAT * longest) ** 2)
    return found


def _lengths(points: FloatArray, facets: IntArray) -> FloatArray:
    """Return the lengths (m, 3) of edges, each from a corner to the next one."""
    corners = points[facets]
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)


def _turn(points: FloatArray, facets: IntArray, flat: IntArray) -> tuple[IntArray, int] | None:
    """Flip the longest edges of the ``flat`` facets, as far as no two of them are neighbours."""
    pairs = Edges(facets).pairs
    other = np.full(3 * len(facets), -1)
    other[pairs[:, 0]], other[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    longest = 3 * flat + _lengths(points, facets[flat]).argmax(axis=1)
    result, touched, count = facets.copy(), set[int](), 0
    for half in longest.tolist():
        across = int(other[half])
        facet, neighbour = half // 3, across // 3
        if across < 0 or touched & {facet, neighbour}:
            continue
        a, b, middle = (int(facets[facet, (half + k) % 3]) for k in range(3))
        far = int(facets[neighbour, (across + 2) % 3])
        if far == middle or int(facets[neighbour, across % 3]) != b:
            continue
        result[facet], result[neighbour] = (a, far, middle), (far, b, middle)
        # Their neighbours, too: the facet across an edge has changed.
        touched |= {facet, neighbour} | {int(other[3 * f + k]) // 3 for f in (facet, neighbour) for k in range(3)}
        count += 1
    return (result, count) if count else None
