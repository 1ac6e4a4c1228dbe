"""The true surfaces of a body: its skin, the walls between its regions, and the curves along which they meet."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.organ.prepare import on_segments
from epsmesh.mesh.organ.sheet import FIXED, FREE, WALL, Sheet
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.skin import Skin
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.triangles import Triangles


@dataclass(frozen=True, eq=False)
class Faces:
    """The ``skin``, the line at which the support ends on it, ``level`` (n, 2, 3) in m, and the ``walls``, if any."""

    skin: Surface
    level: FloatArray
    walls: Complex | None = None

    def project(self, sheet: Sheet) -> FloatArray:
        """Return the points of a sheet, each on the face or the curve that it belongs to; ends of curves stay."""
        moved = sheet.points.copy()
        of_skin = np.ones(len(moved), dtype=bool)
        if self.walls is not None:
            of_skin[:] = False
            of_skin[sheet.skin.facets] = True
        moved[of_skin] = self.skin.project(sheet.points[of_skin])
        for sides, points in self._within(sheet):
            moved[points] = self._surfaces[sides].project(sheet.points[points])
        line = np.unique(sheet.border(FIXED, FREE))
        moved[line] = on_segments(sheet.points[line], self.level)
        if self.walls is None:
            return moved
        ends = _ends(sheet)
        for regions, points in _curves(sheet.facets, sheet.sides, sheet.junctions).items():
            here = np.unique(points)
            if regions in self._curves:
                moved[here] = on_segments(sheet.points[here], self._curves[regions])
        moved[ends] = sheet.points[ends]
        return moved

    def distance(self, sheet: Sheet) -> FloatArray:
        """Return the distance (m) of each point of a sheet from the face that it is in, 0 for those of curves."""
        distance = np.zeros(len(sheet.points))
        of_skin = np.unique(sheet.skin.facets)
        distance[of_skin] = self.skin.distance(sheet.points[of_skin])
        for sides, points in self._within(sheet):
            distance[points] = self._surfaces[sides].distance(sheet.points[points])
        return distance

    def _within(self, sheet: Sheet) -> list[tuple[tuple[int, int], IntArray]]:
        """Return the points of each wall that are not in its border, by the regions on its sides."""
        if self.walls is None:
            return []
        border, inner, found = np.unique(sheet.junctions), sheet.kind == WALL, []
        for behind, before in np.unique(sheet.sides[inner], axis=0).tolist():
            mine = inner & (sheet.sides == (behind, before)).all(axis=1)
            found.append(((behind, before), np.setdiff1d(np.unique(sheet.facets[mine]), border)))
        return found

    @cached_property
    def _surfaces(self) -> dict[tuple[int, int], Skin]:
        assert self.walls is not None
        found = {}
        for behind, before in np.unique(self.walls.sides, axis=0).tolist():
            mine = (self.walls.sides == (behind, before)).all(axis=1)
            found[behind, before] = Skin(Triangles(self.walls.points, self.walls.facets[mine]))
        return found

    @cached_property
    def _curves(self) -> dict[frozenset[int], FloatArray]:
        assert self.walls is not None
        walls = self.walls
        sheet = Sheet(walls.points, walls.facets, np.full(len(walls.facets), WALL), np.empty((0, 2), dtype=np.int64))
        found = _curves(walls.facets, walls.sides, sheet.junctions)
        return {regions: walls.points[edges] for regions, edges in found.items()}


def _curves(facets: IntArray, sides: IntArray, junctions: IntArray) -> dict[frozenset[int], IntArray]:
    """Return the edges of junctions by the regions that meet there."""
    count = int(facets.max(initial=0)) + 1
    keys = junctions @ np.array([count, 1])
    order = np.argsort(keys)
    meeting: list[set[int]] = [set() for _ in keys]
    for k in range(3):
        ends = np.sort(facets[:, [k, (k + 1) % 3]], axis=1) @ np.array([count, 1])
        at = np.minimum(np.searchsorted(keys, ends, sorter=order), max(len(keys) - 1, 0))
        for facet in np.flatnonzero(keys[order[at]] == ends) if len(keys) else ():
            meeting[order[at[facet]]].update(sides[facet].tolist())
    found: dict[frozenset[int], list[int]] = {}
    for number, regions in enumerate(meeting):
        found.setdefault(frozenset(regions), []).append(number)
    return {regions: junctions[numbers] for regions, numbers in found.items()}


def _ends(sheet: Sheet) -> IntArray:
    """Return the points where junctions end, meet each other, or meet the level of the support."""
    edges = np.vstack([sheet.junctions, sheet.border(FIXED, FREE)])
    meeting = np.bincount(edges.ravel(), minlength=len(sheet.points))
    on_junction = np.zeros(len(sheet.points), dtype=bool)
    on_junction[sheet.junctions] = True
    return np.flatnonzero(on_junction & (meeting != 2))
