"""First touch of probe and surface, and contact area with sub-element resolution.

Depths count from the first touch of the surface, undeformed or deformed by loads.

At a distance x from the edge of contact the pressure is K x^½ and the gap outside (4 K / 3 E*) x^{3/2}, wherever the
probe's surface is smooth (K. L. Johnson, Contact Mechanics, 1985, ch. 4 and 5). Nodes near the edge thus give their
distance from it. Each counts with the share of its own area inside the edge, so area and radius vary smoothly.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve.contact.elements import FreeResponse
from epsmesh.solve.contact.facets import FACET_CORNERS
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.touching import ContactSolution

# Search for the first touch: sampling points along an edge of each facet, rounds of refinement, the factor by which a
# round is finer, and the number of nearest facets that are refined.
_ALONG, _ROUNDS, _CLOSER, _NEAREST = 8, 4, 0.25, 12


@dataclass(frozen=True)
class Touch:
    """Heights (m) of the probe's surface above points (n, 3) of the undeformed one; the smallest is ``first``."""

    height: Callable[[FloatArray], FloatArray]
    first: float = 0.0

    def heights(
        self, candidates: Candidates, loaded: FreeResponse | None = None, known: Candidates | None = None
    ) -> FloatArray:
        """Return the height (n, m) of the probe above each of the ``candidates`` at first touch.

        The response to loads is given at the nodes of the ``known`` candidates; None if they are the same.
        """
        heights = self.height(candidates.points) - self.first
        if loaded is None:
            return heights
        known = known or candidates
        moved = loaded.moved if known is candidates else _interpolated(known, loaded.moved, candidates)
        return np.asarray(heights - moved - self.sag(known, loaded.moved))

    def sag(self, candidates: Candidates, moved: FloatArray) -> float:
        """Return how much farther (m) the probe moves to touch the surface whose nodes loads ``moved`` (n) along z.

        The gaps are those of linear laws, above undeformed places: a move across the axis changes none.
        """
        return self.least(candidates, moved) - self.least(candidates, np.zeros_like(moved))

    def sag_at(self, candidates: Candidates, points: FloatArray) -> float:
        """Return how much farther (m) the probe moves to touch the surface with its nodes at deformed ``points``."""
        still = np.zeros(len(candidates))
        return self.least(replace(candidates, points=points), still) - self.least(candidates, still)

    def least(self, candidates: Candidates, moved: FloatArray) -> float:
        """Return the smallest gap (m) to a surface whose nodes are ``moved`` (n), m, towards the probe."""
        x, moved, step = candidates.points[candidates.facets], moved[candidates.facets], 1.0
        facets = np.arange(len(moved))
        middle = np.full((len(facets), FACET_CORNERS), 1 / FACET_CORNERS)
        for _ in range(_ROUNDS):
            places = middle[:, None] + step * (_grid()[None] - 1 / FACET_CORNERS)
            places = np.maximum(places, 0.0) / np.maximum(places, 0.0).sum(axis=2, keepdims=True)
            values = candidates.shape.values(places.reshape(-1, FACET_CORNERS)).reshape(*places.shape[:2], -1)
            points = np.einsum("mqk,mkx->mqx", values, x[facets])
            gaps = self.height(points.reshape(-1, 3)).reshape(points.shape[:2])
            gaps = gaps - np.einsum("mqk,mk->mq", values, moved[facets])
            nearest = np.argsort(gaps.min(axis=1))[:_NEAREST]
            middle, facets = places[nearest, gaps[nearest].argmin(axis=1)], facets[nearest]
            step *= _CLOSER
        return float(gaps.min())


def _interpolated(candidates: Candidates, values: FloatArray, other: Candidates) -> FloatArray:
    """Return nodal ``values`` (n) at the nodes of another degree."""
    found = np.empty(len(other))
    found[other.facets] = values[candidates.facets] @ candidates.shape.values(other.shape.corners).T
    return found


@cache
def _grid() -> FloatArray:
    """Return barycentric coordinates of points on a facet (q, 3)."""
    steps = np.arange(_ALONG + 1)
    pairs = [(i, j) for i in steps for j in steps if i + j <= _ALONG]
    first, second = np.array(pairs).T / _ALONG
    return np.column_stack([first, second, 1 - first - second])


# K, in units of the mean pressure times (2 / a)^½, where a is the smaller semi-axis of contact: value for a ball.
_INTENSITY = 1.5
# Width of a node's own area, in units of the side of a square of the same area.
_WIDTH = 1.3
# Smaller semi-axis of a ball's contact, in units of the root mean square of x weighted with its pressure.
_SEMI_AXIS = 5**0.5
# Fixed-point iteration for K and the area, which depend on each other: most rounds, and the change at which it ends.
_MOST_ROUNDS, _SMALL = 60, 1e-9


@dataclass(frozen=True)
class Area:
    """A contact area (m², normal to the axis) and its relative 95 % bar, for the element size alone."""

    value: float
    bar: float


def contact_area(
    candidates: Candidates, touched: ContactSolution, modulus: FloatArray, mirrored: tuple[int, ...] = ()
) -> Area:
    """Return the contact area of the modelled part, bounded by planes of symmetry normal to the axes ``mirrored``.

    ``modulus`` (n) is E / (1 - ν²) of the tissue at each candidate (Pa).
    """
    active, weights, reactions = touched.active, candidates.weights, touched.forces[:, -1]
    sure, near = float(weights[active].sum()), candidates.bordering(active) & (weights > 0)
    if not near.any():
        return Area(sure, 0.0)
    within = active[near]
    pressure = np.maximum(-reactions[near], 0.0) / weights[near] * within
    gap = np.maximum(touched.gap[near], 0.0) * ~within
    force, width = -float(reactions[active].sum()), _WIDTH * candidates.widths[near]
    of_contact = semi_axis(candidates.points[:, :2], -np.where(active, reactions, 0.0), mirrored)
    inner = sure - float(weights[near][within].sum())
    area = sure or float(weights[near].sum())
    for _ in range(_MOST_ROUNDS):
        intensity = _INTENSITY * force / area * np.sqrt(2 / max(of_contact, float(width.min())))
        inside = (pressure / intensity) ** 2 - (0.75 * modulus[near] * gap / intensity) ** (2 / 3)
        found = inner + float(weights[near] @ np.clip(0.5 + inside / width, 0.0, 1.0))
        if abs(found - area) <= _SMALL * area:
            break
        area = (area + found) / 2
    return Area(area, fitted.AREA * float(weights[near].sum()) / area)


def semi_axis(points: FloatArray, load: FloatArray, mirrored: tuple[int, ...]) -> float:
    """Return the smaller semi-axis (m) of the elliptic contact of a ball with the moments of ``load``."""
    points = points - np.where(np.isin([0, 1], mirrored), 0.0, load @ points / load.sum())
    moments = (points * load[:, None]).T @ points / load.sum()
    for axis in mirrored:
        moments[axis, 1 - axis] = moments[1 - axis, axis] = 0.0
    return _SEMI_AXIS * float(np.sqrt(max(np.linalg.eigvalsh(moments)[0], 0.0)))


def share_at_end(
    candidates: Candidates,
    active: BoolArray,
    ends_at: Callable[[FloatArray], BoolArray],
    turn: FloatArray | None = None,
) -> float:
    """Return the share of the facets of ``active`` nodes (n) that are where a tool ``ends_at``.

    Areas are normal to the last axis after a ``turn`` (3, 3).
    """
    edge = np.flatnonzero(candidates.is_edge)
    at_end = np.zeros(len(candidates), dtype=bool)
    at_end[edge] = ends_at(candidates.points[edge])
    seen = candidates if turn is None else replace(candidates, points=candidates.points @ turn.T)
    areas = seen.areas * active[candidates.facets].any(axis=1)
    return float(areas[at_end[candidates.facets].any(axis=1)].sum() / areas.sum())
