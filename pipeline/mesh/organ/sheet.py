"""Triangulated surfaces whose facets belong to named groups, and the borders between the groups."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.generate import MeshError
from pipeline.scene import model
from pipeline.shapes.triangles import closed_edges, doubled_normals, enclosed, half_edges

# Group numbers; the remesher keeps the groups apart.
FREE, FIXED, PROBE = 1, 2, 3


def group_names() -> dict[int, str]:
    """Return the groups' names in meshes."""
    return {FREE: model.FREE, FIXED: model.FIXED, PROBE: model.PROBE}


@dataclass(frozen=True)
class Sheet:
    """A closed surface: ``points`` (n, 3) in m, ``facets`` (m, 3), and the group (m) of each facet.

    ``sharp`` (k, 2) are edges to be kept, besides those between groups.
    """

    points: FloatArray
    facets: IntArray
    group: IntArray
    sharp: IntArray

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
        return enclosed(self.points, self.facets)

    def border(self, one: int, other: int | None = None) -> IntArray:
        """Return edges (k, 2), lower number first, between facets of group ``one`` and the ``other`` (default: any)."""
        edges, facets = edges_of(self.facets)
        groups = self.group[facets]
        mine = groups == one
        theirs = ~mine if other is None else groups == other
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
