"""Topology of facets: edges, shells, and fans around points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from epsmesh.arrays import IntArray
from epsmesh.shapes.triangles import half_edges


@dataclass(frozen=True, eq=False)
class Edges:
    """The 3m half edges of ``facets`` (m, 3), sorted so that those of one edge are consecutive."""

    facets: IntArray

    @cached_property
    def half(self) -> IntArray:
        """Start and end points (3m, 2): half edge 3f + k belongs to facet f, from its corner k to the next."""
        return half_edges(self.facets)

    @cached_property
    def order(self) -> IntArray:
        """Half edges (3m,), sorted by their edge."""
        return np.argsort(self._keys, kind="stable")

    @cached_property
    def _keys(self) -> IntArray:
        low, high = self.half.min(axis=1), self.half.max(axis=1)
        return low * (int(self.facets.max(initial=0)) + 1) + high

    @cached_property
    def counts(self) -> IntArray:
        """Number of facets of each edge."""
        starts = np.nonzero(np.diff(self._keys[self.order], prepend=-1))[0]
        return np.diff(starts, append=len(self.order))

    @cached_property
    def open(self) -> IntArray:
        """Half edges whose edge has a single facet, in their direction."""
        return self._first[self.counts == 1]

    @cached_property
    def fins(self) -> IntArray:
        """One half edge of each edge with more than two facets."""
        return self._first[self.counts > 2]

    @cached_property
    def _first(self) -> IntArray:
        return self.order[np.cumsum(self.counts) - self.counts]

    @cached_property
    def pairs(self) -> IntArray:
        """The two half edges (n, 2) of every edge with two facets."""
        starts = (np.cumsum(self.counts) - self.counts)[self.counts == 2]
        return self.order[starts[:, None] + np.arange(2)]

    @cached_property
    def turned(self) -> IntArray:
        """Pairs whose two facets have opposite orientation: both run along their edge in the same direction."""
        return self.pairs[self.half[self.pairs[:, 0], 0] == self.half[self.pairs[:, 1], 0]]

    @cached_property
    def shells(self) -> tuple[int, IntArray]:
        """Number of shells, and that of each facet (m,): facets are connected by edges with two facets."""
        return components(self.pairs // 3, len(self.facets))

    def pinched(self) -> IntArray:
        """Return the points at which several fans of facets meet; all edges must have two facets."""
        # The corner at the start of a facet's half edge is identified with the one at the end of the other facet's.
        first, second = self.pairs.T
        after = 3 * (second // 3) + (second + 1) % 3
        same = self.half[first, 0] == self.half[second, 1]
        links = [np.where(same, after, second), np.where(same, second, after)]
        starts = np.stack([first, links[0]], axis=1)
        ends = np.stack([3 * (first // 3) + (first + 1) % 3, links[1]], axis=1)
        count, fan = components(np.concatenate([starts, ends]), 3 * len(self.facets))
        corners = self.facets.ravel()
        fans = np.empty(count, dtype=np.int64)
        fans[fan] = corners
        points, times = np.unique(fans, return_counts=True)
        return points[times > 1]


def components(links: IntArray, count: int) -> tuple[int, IntArray]:
    """Return the number of connected components of ``count`` things with ``links`` (n, 2), and that of each thing."""
    from scipy.sparse import coo_array  # noqa: PLC0415 (0.2 s to import; only for studies with files)
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    return int(parts), part.astype(np.int64)


def oriented(edges: Edges) -> tuple[IntArray, IntArray | None]:
    """Return consistently oriented facets, and which ones were turned: the smaller set.

    For a one-sided shell return the facets unchanged, and None.
    """
    facets, count = edges.facets, len(edges.facets)
    first, second = edges.pairs.T
    flip = (edges.half[first, 0] == edges.half[second, 0]).astype(np.int64)
    # Each facet twice, as it is and turned: connected copies have the same orientation.
    a, b = first // 3, second // 3
    links = np.concatenate([np.stack([a, b + flip * count], 1), np.stack([a + count, b + (1 - flip) * count], 1)])
    parts, part = components(links, 2 * count)
    as_is, turned = part[:count], part[count:]
    if (as_is == turned).any():
        return facets, None
    kept = np.bincount(as_is, minlength=parts)
    chosen = (kept[as_is] < kept[turned]) | ((kept[as_is] == kept[turned]) & (as_is > turned))
    return np.where(chosen[:, None], facets[:, ::-1], facets), np.nonzero(chosen)[0]
