"""Where the probe first touches the surface, as it is or as loads have bent it: depths count from there."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.contact.candidates import Candidates
from pipeline.solve.contact.elements import FreeResponse
from pipeline.solve.contact.facet import FACET_CORNERS

# Points on each facet where the first touch is looked for, along an edge; and then, so many times, nearer to the best
# of each of the nearest facets.
_ALONG, _ROUNDS, _CLOSER, _NEAREST = 8, 4, 0.25, 12


@dataclass(frozen=True)
class Touch:
    """Heights (m) of the probe's surface above points (n, 3) of the undeformed one, the least of them ``first``."""

    height: Callable[[FloatArray], FloatArray]
    first: float = 0.0

    def heights(
        self, candidates: Candidates, loaded: FreeResponse | None = None, known: Candidates | None = None
    ) -> FloatArray:
        """Return how far the probe is above each of the ``candidates`` (n, m) when it first touches the surface.

        What loads do is that of the nodes of the ``known`` candidates, None where they are the same.
        """
        heights = self.height(candidates.points) - self.first
        if loaded is None:
            return heights
        known = known or candidates
        moved = loaded.moved if known is candidates else _interpolated(known, loaded.moved, candidates)
        return np.asarray(heights - moved - self.sag(known, loaded))

    def sag(self, candidates: Candidates, loaded: FreeResponse) -> float:
        """Return how much farther (m) the probe goes until it touches the surface that loads have bent."""
        moved = loaded.moved[candidates.facets]
        return self._first(candidates, moved) - self._first(candidates, np.zeros_like(moved))

    def _first(self, candidates: Candidates, moved: FloatArray) -> float:
        """Return the least gap (m) to the surface that is ``moved`` (m, k) at the nodes of its facets."""
        x, facets, step = candidates.points[candidates.facets], np.arange(len(moved)), 1.0
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
