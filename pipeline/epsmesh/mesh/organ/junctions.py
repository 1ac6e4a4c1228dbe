"""Junctions, the curves in which regions meet, made as coarse as elements are.

`mmgs` divides their edges, but keeps all of their points. So edges that are too short are contracted here, with all
facets that meet there.
"""

from collections import defaultdict
from collections.abc import Callable
from heapq import heapify, heappop, heappush
from math import dist

import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.organ.remesh import remesh
from epsmesh.mesh.organ.sheet import Sheet, compact
from epsmesh.mesh.organ.untangle import crossing_facets
from epsmesh.shapes.files.crossings import cross, dot, less

# An edge is contracted below this length, in units of elements, if its curve moves by at most the second.
_SHORT, _MOVES = 0.7, 0.15
# Shorter edges are contracted whatever becomes of the facets there: the next remeshing moves these.
_TINY = 0.2
# Largest turn of a facet by a contraction (cosine), and its least height as a share of its longest edge.
_TURN, _HEIGHT = 0.3, 0.02
# Attempts, in which more and more points stay around facets that would cross others.
_TRIES = 4
# Sizes of the first remeshing, in units of the facets', and their growth from each one to the next.
_FIRST, _FASTER = 2.0, 2.5

_Point = tuple[float, float, float]


def coarsened(
    sheet: Sheet, size: Callable[[FloatArray], FloatArray], deviation: float, as_is: Callable[[Sheet], BoolArray]
) -> Sheet:
    """Return a divided sheet with elements of a ``size`` (m) that is reached in steps, from that of its facets.

    It stays within ``deviation`` (m); the facets marked ``as_is`` do not change.
    """
    now = _FIRST * float(np.median(sheet.extents))
    largest = float(size(sheet.points).max())
    while True:
        sheet = contracted(sheet, np.minimum(size(sheet.points), now), np.unique(sheet.facets[as_is(sheet)]))
        sheet = remesh(sheet, np.minimum(size(sheet.points), now), deviation, as_is=as_is(sheet))
        if now >= largest:
            return sheet
        now *= _FASTER


def contracted(sheet: Sheet, size: FloatArray, stay: IntArray) -> Sheet:
    """Return the sheet with short edges of its junctions contracted; ``size`` (n), in m, is that of elements.

    Ends of junctions, points where they meet other edges to be kept, and the points ``stay`` remain. So do all points
    around facets that would then cross others.
    """
    junctions = sheet.junctions
    if not len(junctions):
        return sheet
    on_curve = np.unique(junctions)
    points = cKDTree(sheet.points[on_curve])
    already = int(crossing_facets(sheet).sum())
    for number in range(1, _TRIES + 1):
        made = _contracted(sheet, junctions, size, stay)
        crossing = crossing_facets(made)
        if crossing.sum() <= already or number == _TRIES:
            break
        reach = number * made.extents[crossing] / 2
        near = points.query_ball_point(made.centres[crossing], reach)
        stay = np.union1d(stay, on_curve[np.concatenate(near).astype(int)])
    return made


def _contracted(sheet: Sheet, junctions: IntArray, size: FloatArray, stay: IntArray) -> Sheet:
    edges, sides, _ = sheet.neighbours()
    kept = np.unique(np.vstack([junctions, edges[np.diff(sheet.group[sides], axis=1)[:, 0] != 0]]), axis=0)
    fixed = np.bincount(np.vstack([kept, np.sort(sheet.sharp, axis=1)]).ravel(), minlength=len(sheet.points)) != 2
    fixed[stay] = True
    curves = _Curves(sheet, junctions, fixed.tolist(), size.tolist())
    curves.contract()
    left = np.array([number for number, facet in enumerate(curves.facets) if facet])
    return compact(Sheet(sheet.points, np.array(curves.facets_left()), sheet.group[left], sheet.sharp))[0]


class _Curves:
    """Facets around the points of curves, in lists, because every contraction changes few of them."""

    def __init__(self, sheet: Sheet, junctions: IntArray, fixed: list[bool], size: list[float]):
        self.points: list[_Point] = [(x, y, z) for x, y, z in sheet.points.tolist()]
        self.facets: list[list[int]] = sheet.facets.tolist()
        self._fixed, self._size = fixed, size
        self._beside: dict[int, set[int]] = defaultdict(set)
        self._along: dict[int, set[int]] = defaultdict(set)
        for a, b in junctions.tolist():
            self._along[a].add(b)
            self._along[b].add(a)
        on_curve = np.zeros(len(sheet.points), dtype=bool)
        on_curve[junctions] = True
        for number in np.flatnonzero(on_curve[sheet.facets].any(axis=1)).tolist():
            for point in self.facets[number]:
                if on_curve[point]:
                    self._beside[point].add(number)
        self._queue = [(self._length(a, b), a, b) for a, b in junctions.tolist()]
        heapify(self._queue)

    def facets_left(self) -> list[list[int]]:
        """Return the facets that were not contracted."""
        return [facet for facet in self.facets if facet]

    def contract(self) -> None:
        """Contract short edges, the shortest first."""
        while self._queue:
            length, a, b = heappop(self._queue)
            if b not in self._along[a] or length > _SHORT * min(self._size[a], self._size[b]):
                continue
            for gone, stays in ((a, b), (b, a)):
                if not self._fixed[gone] and self._moved(gone, stays):
                    break

    def _length(self, a: int, b: int) -> float:
        return dist(self.points[a], self.points[b])

    def _moved(self, gone: int, stays: int) -> bool:
        """Move a point of a curve to its neighbour if all facets there remain good; return whether they do."""
        if len(self._along[gone]) != 2:  # a curve of two points
            return False
        (other,) = self._along[gone] - {stays}
        both = {number for number in self._beside[gone] if stays in self.facets[number]}
        apexes = {point for number in both for point in self.facets[number]} - {gone, stays}
        if other in self._along[stays] or self._ring(gone) & self._ring(stays) != apexes:
            return False
        is_tiny = self._length(gone, stays) < _TINY * self._size[gone]
        if not is_tiny and self._off(gone, stays, other) > _MOVES * self._size[gone]:
            return False
        changed = {}
        for number in self._beside[gone] - both:
            facet = [stays if point == gone else point for point in self.facets[number]]
            if not (is_tiny or self._is_good(self.facets[number], facet)):
                return False
            changed[number] = facet
        for number in both:
            for point in self.facets[number]:
                if point in self._beside:
                    self._beside[point].discard(number)
            self.facets[number] = []
        for number, facet in changed.items():
            self.facets[number] = facet
            self._beside[stays].add(number)
        del self._beside[gone], self._along[gone]
        for here, there in ((stays, other), (other, stays)):
            self._along[here].discard(gone)
            self._along[here].add(there)
        heappush(self._queue, (self._length(stays, other), stays, other))
        return True

    def _ring(self, point: int) -> set[int]:
        return {corner for number in self._beside[point] for corner in self.facets[number]} - {point}

    def _off(self, gone: int, stays: int, other: int) -> float:
        """Return the distance (m) of a point from the edge between its neighbours."""
        a, b = self.points[stays], self.points[other]
        along, to = less(b, a), less(self.points[gone], a)
        share = min(max(dot(along, to) / max(dot(along, along), 1e-300), 0.0), 1.0)
        return dist(to, (share * along[0], share * along[1], share * along[2]))

    def _is_good(self, before: list[int], after: list[int]) -> bool:
        old, new = self._normal(before), self._normal(after)
        doubled = dot(new, new) ** 0.5
        longest = max(self._length(after[k], after[k - 1]) for k in range(3))
        return doubled > _HEIGHT * longest**2 and dot(old, new) > _TURN * dot(old, old) ** 0.5 * doubled

    def _normal(self, facet: list[int]) -> _Point:
        a, b, c = (self.points[point] for point in facet)
        return cross(less(b, a), less(c, a))
