"""Borders of regions around a contact: as fine as elements there, on their true curves, and cut at its edge.

Walls between the regions are divided with them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.generate import GeometryError
from epsmesh.mesh.organ.faces import Faces
from epsmesh.mesh.organ.sheet import WALL, Sheet, edges_of

# A point of a border is moved onto the footprint's edge within this share of the edge that crosses it. A border passes
# a corner of the footprint within the second share of the elements there.
_NEAR, _AT_CORNER = 0.3, 0.2


class GrazingError(GeometryError):
    """A border runs along the footprint's edge at a ``place`` (3), in m, and meets it twice within an element."""

    def __init__(self, place: FloatArray):
        x, y, z = 1e3 * place
        super().__init__(
            f"regions meet at the body's surface along the footprint's edge at ({x:.4g}, {y:.4g}, {z:.4g}) mm: move "
            "the probe a little"
        )


@dataclass(frozen=True, eq=False)
class Bordered:
    """A ``sheet`` whose ``borders`` (k, 2), inside a ``patch`` of its facets, end at or pass the footprint's edge.

    ``local`` (n, 2) are its points in the probe's plane, ``rim`` (m, 2) points of the footprint's edge there, and
    ``on_rim`` (m) the points of the sheet that they are, -1 for none.
    """

    sheet: Sheet
    patch: IntArray
    local: FloatArray
    borders: IntArray
    rim: FloatArray
    on_rim: IntArray


def borders_within(sheet: Sheet, patch: IntArray) -> IntArray:
    """Return the edges (k, 2) at which regions meet inside a ``patch`` of the sheet's facets, of the body's surface."""
    (outer,) = np.nonzero(sheet.kind != WALL)
    edges, facets = edges_of(sheet.facets[outer])
    behind = sheet.sides[outer, 0][facets]
    return edges[(behind[:, 0] != behind[:, 1]) & np.isin(outer[facets], patch).all(axis=1)]


def divided_to(sheet: Sheet, edges: IntArray, faces: Faces, size: Callable[[FloatArray], FloatArray]) -> Sheet:
    """Return the sheet with ``edges`` (k, 2) of its borders as short as ``size`` (m) is, on their true curves."""
    first = len(sheet.points)
    while len(edges):
        ends = sheet.points[edges]
        middle = ends.mean(axis=1)
        is_long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > size(middle)
        if not is_long.any():
            break
        new = len(sheet.points) + np.arange(is_long.sum())
        sheet, _ = divided(sheet, edges[is_long], middle[is_long])
        halves = [np.column_stack([ends, new]) for ends in edges[is_long].T]
        edges = np.vstack([edges[~is_long], *halves])
    if len(sheet.points) > first:
        sheet = replace(sheet, points=np.vstack([sheet.points[:first], faces.project(sheet)[first:]]))
    return sheet


def divided(sheet: Sheet, edges: IntArray, places: FloatArray) -> tuple[Sheet, IntArray]:
    """Return the sheet with a new point in each of ``edges`` (k, 2), at ``places`` (k, 3), and all facets there halved.

    The new points are the last ones, in this order. The second result are the facets (m) from which those of the sheet
    were made.
    """
    facets, made_of = sheet.facets, np.arange(len(sheet.facets))
    for new, (a, b) in enumerate(edges.tolist(), start=len(sheet.points)):
        beside = ((facets == a) | (facets == b)).sum(axis=1) == 2
        halves = [np.where(facets[beside] == end, new, facets[beside]) for end in (a, b)]
        facets = np.vstack([facets[~beside], *halves])
        made_of = np.concatenate([made_of[~beside], made_of[beside], made_of[beside]])
    return Sheet(np.vstack([sheet.points, places]), facets, sheet.group[made_of], sheet.sharp), made_of


def cut_at_rim(
    sheet: Sheet,
    patch: IntArray,
    local: FloatArray,
    rim: FloatArray,
    is_corner: BoolArray,
    to_edge: Callable[[FloatArray], FloatArray],
    lift: Callable[[FloatArray], FloatArray],
) -> Bordered:
    """Return the sheet with borders inside a ``patch`` of its facets cut where they cross the footprint's edge.

    ``local`` (n, 2) are its points in the probe's plane, ``rim`` (m, 2) those of the footprint's edge. The nearest of
    these moves to a crossing; where it is a corner, there is one more. ``to_edge`` and ``lift`` move points of the
    plane onto the edge, and onto the surface.

    Raises:
        GrazingError: if two points of borders meet the edge within a fraction of an element.
    """
    borders, edge = borders_within(sheet, patch), _Edge(rim, is_corner)
    local, points = local.copy(), sheet.points.copy()
    chains = [[a] for a in borders[:, 0].tolist()]
    cut: list[tuple[int, int]] = []
    new_places, new_local = [], []
    for number, share, along in _crossings(local, borders, rim):
        ends, is_end = borders[number], min(share, 1 - share) < _NEAR
        point = int(ends[int(share > 0.5)]) if is_end else len(points) + len(cut)
        if point in edge.owner:
            continue  # the border touches the edge there
        place = to_edge((local[ends].T @ np.array([1 - share, share]))[None])[0]
        place = edge.meet(along, place, point)
        at = lift(place[None])[0]
        if edge.is_crowded:
            raise GrazingError(at)
        if is_end:
            local[point], points[point] = place, at
        else:
            cut.append((chains[number][-1], int(ends[1])))
            chains[number].append(point)
            new_places.append(at)
            new_local.append(place)
    sheet = replace(sheet, points=points)
    if cut:
        sheet, made_of = divided(sheet, np.array(cut), np.array(new_places))
        (patch,) = np.nonzero(np.isin(made_of, patch))
        local = np.vstack([local, new_local])
        whole = [[*chain, end] for chain, end in zip(chains, borders[:, 1].tolist(), strict=True)]
        borders = np.array([pair for chain in whole for pair in pairwise(chain)])
    rim, owner = edge.ordered()
    beside = np.sort(np.column_stack([owner, np.roll(owner, -1)]), axis=1)
    borders = borders[~(np.sort(borders, axis=1)[:, None] == beside[None]).all(axis=-1).any(axis=1)]
    return Bordered(sheet, patch, local, borders, rim, owner)


class _Edge:
    """The footprint's edge, whose points (m, 2) move to where borders meet it; corners do not move.

    A position along it is the number of a point, plus the share of the edge to the next one.
    """

    def __init__(self, rim: FloatArray, is_corner: BoolArray):
        self._places, self._is_corner = list(rim), is_corner
        self._at = [float(k) for k in range(len(rim))]
        self.owner = [-1] * len(rim)

    def meet(self, along: float, place: FloatArray, point: int) -> FloatArray:
        """Let the ``point`` of a border be on the edge at a position ``along`` it, or at a corner next to that.

        Return its ``place`` (2), in m.
        """
        count = len(self._is_corner)
        nearest = round(along) % count
        is_near = abs(along - round(along)) < _AT_CORNER
        if self.owner[nearest] >= 0 or (self._is_corner[nearest] and not is_near):
            self._at.append(along)
            self._places.append(place)
            self.owner.append(point)
            return place
        if not self._is_corner[nearest]:
            self._at[nearest], self._places[nearest] = along, place
        self.owner[nearest] = point
        return self._places[nearest]

    @property
    def is_crowded(self) -> bool:
        """Whether two points of borders are closer together than a fraction of an element."""
        at = np.sort([at for at, point in zip(self._at, self.owner, strict=True) if point >= 0])
        gaps = np.diff([*at, at[0] + len(self._is_corner)])
        return bool(len(at) > 1 and gaps.min() < _AT_CORNER)

    def ordered(self) -> tuple[FloatArray, IntArray]:
        """Return its points (m, 2), and the points (m) of borders that they are, -1 for none."""
        order = np.argsort(self._at, kind="stable")
        return np.array(self._places)[order], np.array(self.owner)[order]


def _crossings(local: FloatArray, borders: IntArray, rim: FloatArray) -> list[tuple[int, float, float]]:
    """Return where borders cross the footprint's edge: their edge, the share of its length, and the position there."""
    start, other = local[borders[:, 0], None], rim[None]
    along, across = local[borders[:, 1], None] - start, np.roll(rim, -1, axis=0)[None] - other
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = _cross(along, across)
        s, t = _cross(other - start, across) / turned, _cross(other - start, along) / turned
        edges, segments = np.nonzero((s >= 0) & (s < 1) & (t >= 0) & (t < 1))
    return sorted((int(i), float(s[i, j]), float(j + t[i, j])) for i, j in zip(edges, segments, strict=True))


def are_within(rim: FloatArray, points: FloatArray) -> BoolArray:
    """Return a mask of the points (n, 2) within a closed line (m, 2)."""
    (x, y), end = points.T[:, :, None], np.roll(rim, -1, axis=0)
    crosses = (rim[:, 1] > y) != (end[:, 1] > y)
    right = (end[:, 0] - rim[:, 0]) * (y - rim[:, 1]) - (x - rim[:, 0]) * (end[:, 1] - rim[:, 1])
    return np.asarray((crosses & ((right > 0) == (end[:, 1] > rim[:, 1]))).sum(axis=1) % 2 == 1)


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])
