"""What holds facets together: their edges, shells and fans round points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.arrays import IntArray
from pipeline.shapes.triangles import half_edges


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of ``facets`` (m, 3): each of its 3m half edges, sorted so that those of one edge follow each other."""

    facets: IntArray

    @cached_property
    def half(self) -> IntArray:
        """From which point to which (3m, 2): half edge 3f + k is that of facet f from its corner k to the next one."""
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
        """How many facets each edge has."""
        starts = np.nonzero(np.diff(self._keys[self.order], prepend=-1))[0]
        return np.diff(starts, append=len(self.order))

    @cached_property
    def open(self) -> IntArray:
        """Half edges whose edge has this one facet alone, in their direction."""
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
        """Pairs whose two facets are seen from opposite sides: both run along their edge the same way."""
        return self.pairs[self.half[self.pairs[:, 0], 0] == self.half[self.pairs[:, 1], 0]]

    @cached_property
    def shells(self) -> tuple[int, IntArray]:
        """How many shells there are, and that of each facet (m,): facets hang together over edges with two facets."""
        return components(self.pairs // 3, len(self.facets))

    def pinched(self) -> IntArray:
        """Return the points in which more than one fan of facets meets; all edges have two facets."""
        # The corner of a facet at the start of its half edge goes with that at the end of the other facet's.
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
    """Return how many parts ``count`` things fall into that ``links`` (n, 2) tie together, and the part of each."""
    from scipy.sparse import coo_array  # noqa: PLC0415 (a fifth of a second, which studies without files do without)
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    graph = coo_array((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    return int(parts), part.astype(np.int64)


def oriented(edges: Edges) -> tuple[IntArray, IntArray | None]:
    """Return facets turned so that all of a shell are seen from one side, and which ones were turned: the fewer.

    None instead of these, and the facets as they are, if a shell has but one side.
    """
    facets, count = edges.facets, len(edges.facets)
    first, second = edges.pairs.T
    flip = (edges.half[first, 0] == edges.half[second, 0]).astype(np.int64)
    # Each facet twice, as it is and turned: what hangs together is seen from the same side.
    a, b = first // 3, second // 3
    links = np.concatenate([np.stack([a, b + flip * count], 1), np.stack([a + count, b + (1 - flip) * count], 1)])
    parts, part = components(links, 2 * count)
    as_is, turned = part[:count], part[count:]
    if (as_is == turned).any():
        return facets, None
    kept = np.bincount(as_is, minlength=parts)
    chosen = (kept[as_is] < kept[turned]) | ((kept[as_is] == kept[turned]) & (as_is > turned))
    return np.where(chosen[:, None], facets[:, ::-1], facets), np.nonzero(chosen)[0]
