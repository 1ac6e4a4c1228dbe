"""The triangles that bound a body, each with the cell that it belongs to and the group that it is in."""

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import IntArray

# The corners of a tetrahedron's face, by the corner that it lies opposite to.
FACES = np.array(((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)))


@dataclass(frozen=True)
class Boundary:
    """Faces of cells: face ``opposite[i]`` of cell ``cells[i]`` is in group ``groups[i]``, a position in ``names``."""

    cells: IntArray
    opposite: IntArray
    groups: IntArray
    names: tuple[str, ...]


def boundary(cells: IntArray, facets: dict[str, IntArray]) -> Boundary:
    """Find the groups of triangles ``facets`` (k, 3 each) among the faces of ``cells``, by their corners (m, 4).

    Raises:
        ValueError: if a triangle is the face of no cell.
    """
    names = tuple(facets)
    triangles = np.sort(np.vstack([facets[name] for name in names]), axis=1)
    groups = np.repeat(np.arange(len(names)), [len(facets[name]) for name in names])
    # Points of the boundary numbered among themselves: three of their numbers fit one integer.
    points = np.unique(triangles)
    number = np.full(max(int(cells.max()), int(points[-1])) + 1, -1, dtype=np.int64)
    number[points] = np.arange(len(points))
    known = _keys(number[triangles], len(points))
    order = np.argsort(known)
    found = []
    for opposite, face in enumerate(FACES):
        corners = np.sort(number[cells[:, face]], axis=1)
        near = np.flatnonzero(corners[:, 0] >= 0)
        keys = _keys(corners[near], len(points))
        place = np.minimum(np.searchsorted(known, keys, sorter=order), len(known) - 1)
        hit = known[order[place]] == keys
        found.append(np.column_stack([near[hit], np.full(hit.sum(), opposite), groups[order[place[hit]]]]))
    faces = np.vstack(found)
    if len(faces) < len(triangles):
        raise ValueError(f"{len(triangles) - len(faces)} triangles of the boundary are the face of no cell")
    return Boundary(faces[:, 0], faces[:, 1], faces[:, 2], names)


def _keys(triples: IntArray, base: int) -> IntArray:
    return np.asarray((triples[:, 0] * base + triples[:, 1]) * base + triples[:, 2])
