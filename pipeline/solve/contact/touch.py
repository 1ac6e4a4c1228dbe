"""Where the probe first touches the surface, as it is or as loads have bent it: depths count from there."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.contact.candidates import Candidates
from pipeline.solve.contact.elements import FreeResponse

# Points on each facet where the first touch is looked for, along an edge.
_ALONG = 12


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
        values = candidates.shape.values(_grid())
        points = np.einsum("qk,mkx->mqx", values, candidates.points[candidates.facets]).reshape(-1, 3)
        moved = np.einsum("qk,mk->mq", values, loaded.moved[candidates.facets]).ravel()
        heights = self.height(points)
        return float((heights - moved).min() - heights.min())


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
