"""Poor tetrahedra between the two sides of a thin part, or flat below the surface: their points move along it.

gmsh cannot: all four corners of such a cell are in the surface, which it does not change.
"""

from itertools import product

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.organ.regions import Filled
from epsmesh.mesh.organ.sheet import FREE, Sheet
from epsmesh.shapes.surface import Surface

# Points of cells below this quality move, in rounds, one after the other.
_POOR, _ROUNDS = 0.1, 8
# Lengths of the moves that are tried, in units of the shortest edge at the point.
_LENGTHS = np.array([0.4, 0.2, 0.1, 0.05])
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if sum(map(abs, d)) in (1, 3)])
_MOVES = (_LENGTHS[:, None, None] * _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1, keepdims=True)).reshape(-1, 3)


def quality(corners: FloatArray) -> FloatArray:
    """Return the quality of tetrahedra (…, 4, 3): volume over the cube of the mean edge, 1 if regular, < 0 inverted."""
    edges = [corners[..., i, :] - corners[..., j, :] for i in range(4) for j in range(i)]
    volume = np.linalg.det(corners[..., 1:, :] - corners[..., :1, :])
    mean: FloatArray = np.mean([np.square(edge).sum(axis=-1) for edge in edges], axis=0)
    return np.asarray(np.sqrt(2) * volume / mean**1.5)


def relaxed(filled: Filled, sheet: Sheet, skin: Surface) -> FloatArray:
    """Return the points (n, 3) of a mesh with those of poor cells moved to where the poorest cell around is better.

    The first points are those of its ``sheet``. Those of the free surface stay on the ``skin``; edges between groups,
    sharp edges, and all points at regions and cavities stay as they are.
    """
    points = filled.points.copy()
    poor = filled.cells[quality(points[filled.cells]) < _POOR]
    on_skin, inside = _free(filled, sheet) if len(poor) else (np.zeros(len(points), dtype=bool),) * 2
    free = np.zeros(len(points), dtype=bool)
    free[poor] = (on_skin | inside)[poor]
    cells = filled.cells[free[filled.cells].any(axis=1)]
    for _ in range(_ROUNDS):
        values = quality(points[cells])
        worst = cells[np.argsort(values, kind="stable")[: (values < _POOR).sum()]].ravel()
        chosen = list(dict.fromkeys(worst[free[worst]].tolist()))
        if not chosen:
            break
        stars = [cells[(cells == point).any(axis=1)] for point in chosen]
        places = np.array([_places(points, point, star) for point, star in zip(chosen, stars, strict=True)])
        along = on_skin[chosen]
        places[along] = skin.project(places[along].reshape(-1, 3)).reshape(-1, *places.shape[1:])
        before = points.copy()
        for point, star, there in zip(chosen, stars, places, strict=True):
            corners = points[star]
            tried = np.where((star == point)[:, :, None], there[:, None, None, :], corners)
            least = quality(tried).min(axis=1)
            best = int(np.argmax(least))
            if least[best] > quality(corners).min():
                points[point] = there[best]
        if np.array_equal(points, before):
            break
    return points


def _places(points: FloatArray, point: int, star: IntArray) -> FloatArray:
    """Return the places (k, 3) at which a point of the cells ``star`` (m, 4) is tried."""
    others = np.unique(star[star != point])
    return np.asarray(points[point] + np.linalg.norm(points[others] - points[point], axis=1).min() * _MOVES)


def _free(filled: Filled, sheet: Sheet) -> tuple[BoolArray, BoolArray]:
    """Return masks of the points that may move along the skin, and of those that may move in the body."""
    count = len(filled.points)
    on_skin, inside = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    inside[: len(sheet.points)] = inside[filled.walls] = False
    on_skin[sheet.facets[sheet.kind == FREE]] = True
    edges, sides, _ = sheet.neighbours()
    on_skin[edges[np.diff(sheet.group[sides], axis=1)[:, 0] != 0]] = on_skin[sheet.sharp] = False
    if filled.regions is not None:
        lowest, highest = np.full(count, filled.regions.max()), np.full(count, filled.regions.min())
        for corner in filled.cells.T:
            np.minimum.at(lowest, corner, filled.regions)
            np.maximum.at(highest, corner, filled.regions)
        on_skin &= lowest == highest
        inside &= lowest == highest
    return on_skin, inside
