"""Triangulated surfaces whose facets belong to named groups, and the borders between the groups.

They may divide a body into regions: facets inside it then meet each other, and the body's surface, along junctions.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.generate import MeshError
from epsmesh.scene import model
from epsmesh.shapes.complex import OUTSIDE
from epsmesh.shapes.triangles import closed_edges, doubled_normals, edge_keys, enclosed, half_edges

# Kinds of facets, of the body's surface and inside the body. A group has one kind, and the same regions on both sides:
# their numbers are added in multiples of these. The remesher keeps the groups apart.
WALL, FREE, FIXED, PROBE, JAW = 0, 1, 2, 3, 4
_KINDS, _REGIONS = 5, 1024


class TangledError(MeshError):
    """A surface bounds no volume at ``places`` (n, 3), within a distance ``reach`` (n) of each, all in m."""

    def __init__(self, places: FloatArray, reach: FloatArray, what: str = "the remeshed surface crosses itself"):
        self.places, self.reach = places, reach
        x, y, z = 1e3 * places[0]
        super().__init__(f"{what} at ({x:.4g}, {y:.4g}, {z:.4g}) mm; `smooth`, or `repair`, may help there")

    @staticmethod
    def at(corners: FloatArray, *what: str) -> "TangledError":
        """Return the error for facets or cells by their ``corners`` (n, k, 3), in m."""
        return TangledError(corners.mean(axis=1), np.ptp(corners, axis=1).max(axis=1), *what)


def group_names() -> dict[int, str]:
    """Return the groups' names in meshes."""
    return {FREE: model.FREE, FIXED: model.FIXED, PROBE: model.PROBE, JAW: model.JAW}


def groups_of(kind: IntArray, sides: IntArray) -> IntArray:
    """Return the groups (m) of facets by their kind (m) and the regions (m, 2) behind and before them."""
    return np.asarray(kind + _KINDS * (sides[:, 1] - OUTSIDE + _REGIONS * sides[:, 0]))


@dataclass(frozen=True)
class Sheet:
    """A closed surface: ``points`` (n, 3) in m, ``facets`` (m, 3), and the group (m) of each facet.

    Facets inside it may divide the body. ``sharp`` (k, 2) are edges to be kept, besides those between groups.
    """

    points: FloatArray
    facets: IntArray
    group: IntArray
    sharp: IntArray

    @cached_property
    def kind(self) -> IntArray:
        """Kinds (m) of the facets."""
        return np.asarray(self.group % _KINDS)

    @property
    def sides(self) -> IntArray:
        """Numbers of the regions (m, 2) behind and before the facets."""
        behind, before = np.divmod(self.group // _KINDS, _REGIONS)
        return np.column_stack([behind, before + OUTSIDE])

    @property
    def is_divided(self) -> bool:
        """Whether there are facets inside the body."""
        return bool((self.kind == WALL).any())

    @property
    def skin(self) -> "Sheet":
        """The body's surface, with all points."""
        outer = self.kind != WALL
        return self if outer.all() else replace(self, facets=self.facets[outer], group=self.group[outer])

    @cached_property
    def junctions(self) -> IntArray:
        """Edges (k, 2) in which more than two facets of a divided body meet, lower number first."""
        if not self.is_divided:
            return np.empty((0, 2), dtype=np.int64)
        count = len(self.points)
        keys, times = np.unique(edge_keys(self.facets, count), return_counts=True)
        return np.column_stack(np.divmod(keys[times > 2], count))

    def neighbours(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return edges (k, 2), lower number first, two facets (k, 2) at each, and their relative orientation (k).

        That is -1 where one of them is counterclockwise seen from one side, and the other seen from the other side. At
        junctions there are several pairs of facets.

        Raises:
            MeshError: if the body's surface is not closed.
            TangledError: if that of a region is not.
        """
        if not self.is_divided:
            edges, facets = edges_of(self.facets)
            return edges, facets, np.ones(len(edges), dtype=np.int64)
        if (is_open := self.open_edges()).any():
            corners = self.points[self.facets[is_open.any(axis=1)]]
            raise TangledError.at(corners, "the remeshed surface of a region is not closed")
        pairs = half_edges(self.facets)
        ordered = np.sort(pairs, axis=1)
        order = np.lexsort((ordered[:, 1], ordered[:, 0]))
        is_first = np.ones(len(order), dtype=bool)
        is_first[1:] = (np.diff(ordered[order], axis=0) != 0).any(axis=1)
        (first,) = np.nonzero(is_first)
        count = np.diff([*first, len(order)])
        # Each facet at an edge and the next one; of two facets that is one pair.
        following = np.arange(1, len(order) + 1)
        last = first + count - 1
        following[last] = first
        one = np.setdiff1d(np.arange(len(order)), last[count == 2])
        here, there = order[one], order[following[one]]
        turned = np.where(pairs[here, 0] == pairs[there, 0], -1, 1)
        return ordered[here], np.column_stack([here // 3, there // 3]), turned

    def open_edges(self) -> BoolArray:
        """Return a mask (m, 3) of edges, from each corner to the next, at which a region beside them is not closed."""
        sides, keys = self.sides, edge_keys(self.facets, len(self.points)).reshape(-1, 3)
        found = np.zeros(keys.shape, dtype=bool)
        for region in np.unique(sides):
            mine = (sides == region).any(axis=1)
            _, number, times = np.unique(keys[mine], return_inverse=True, return_counts=True)
            found[mine] |= (times % 2 == 1)[number].reshape(-1, 3)
        return found

    @property
    def normals(self) -> FloatArray:
        """Unit normals (m, 3) of the facets."""
        normal = doubled_normals(self.points, self.facets)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)

    @property
    def heights(self) -> FloatArray:
        """Heights of the facets over their longest edges, as shares of these edges."""
        corners = self.points[self.facets]
        longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
        doubled = np.linalg.norm(doubled_normals(self.points, self.facets), axis=1)
        return np.divide(doubled, longest**2, out=np.zeros(len(corners)), where=longest > 0)

    @property
    def centres(self) -> FloatArray:
        """Centres (m, 3) of the facets."""
        middles: FloatArray = self.points[self.facets].mean(axis=1)
        return middles

    @property
    def extents(self) -> FloatArray:
        """Largest extents (m) of the facets along x, y or z."""
        sizes: FloatArray = np.ptp(self.points[self.facets], axis=1).max(axis=1)
        return sizes

    @property
    def volume(self) -> float:
        """Enclosed volume (m³)."""
        return enclosed(self.points, self.skin.facets)

    def border(self, one: int, other: int | None = None) -> IntArray:
        """Return edges (k, 2) between facets of the surface of kind ``one`` and the ``other`` (default: any other).

        The lower point number is first.
        """
        skin = self.skin
        edges, facets = edges_of(skin.facets)
        kinds = skin.kind[facets]
        mine = kinds == one
        theirs = ~mine if other is None else kinds == other
        return edges[mine.any(axis=1) & theirs.any(axis=1)]


def edges_of(facets: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (k, 2) of a closed surface, lower number first, and the two facets (k, 2) of each.

    Raises:
        MeshError: if it is not closed.
    """
    _, times = np.unique(np.sort(half_edges(facets), axis=1) @ np.array([facets.max() + 1, 1]), return_counts=True)
    if (times % 2).any():  # even numbers pass: where a surface touches itself it is repaired later
        raise MeshError("the remeshed surface is not closed")
    return closed_edges(facets)


def compact(sheet: Sheet) -> tuple[Sheet, IntArray]:
    """Renumber the points that facets use without gaps; return the new number of each point, too, -1 for none."""
    used = np.zeros(len(sheet.points), dtype=bool)
    used[sheet.facets] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    sharp = number[sheet.sharp]
    sharp = sharp[(sharp >= 0).all(axis=1)]
    return Sheet(sheet.points[used], number[sheet.facets], sheet.group, sharp), number
