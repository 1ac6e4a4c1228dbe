"""Surfaces that divide a body into regions, and meet along curves where three or more regions do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.shapes.triangles import enclosed

# Number of what is outside of the body, and of the body's own tissue; regions follow from 1.
OUTSIDE, TISSUE = -1, 0


@dataclass(frozen=True, eq=False)
class Complex:
    """Facets between the regions of a body.

    ``points`` (n, 3) in m are distinct. ``facets`` (m, 3) are point numbers. ``sides`` (m, 2) are the numbers of the
    regions behind and before each facet; before it is the side to which its normal points. -1 is outside, 0 the body's
    own tissue, k the body's region number k.
    """

    points: FloatArray
    facets: IntArray
    sides: IntArray

    @staticmethod
    def nested(surfaces: Sequence[tuple[FloatArray, IntArray]]) -> "Complex":
        """Return a body's surface and closed surfaces within it, which do not touch: points and facets of each."""
        starts = np.cumsum([0, *(len(points) for points, _ in surfaces)])
        facets = [corners + start for (_, corners), start in zip(surfaces, starts[:-1], strict=True)]
        behind = np.repeat(np.arange(len(surfaces)), [len(corners) for corners in facets])
        before = np.where(behind == TISSUE, OUTSIDE, TISSUE)
        return Complex(
            np.vstack([points for points, _ in surfaces]), np.vstack(facets), np.column_stack([behind, before])
        )

    @property
    def regions(self) -> IntArray:
        """Numbers of its regions, in ascending order, without what is outside."""
        numbers = np.unique(self.sides)
        return np.asarray(numbers[numbers != OUTSIDE])

    def walls(self) -> tuple[IntArray, IntArray]:
        """Return the pairs of neighbours (k, 2), lower first, in order of appearance, and that of each facet (m)."""
        pairs = np.sort(self.sides, axis=1)
        walls, first, number = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        return walls[order], np.argsort(order)[number.ravel()]

    def boundary(self, region: int) -> IntArray:
        """Return the facets (k, 3) around a region, counterclockwise seen from outside of it."""
        behind, before = (self.sides == region).T
        return np.vstack([self.facets[behind], self.facets[before][:, ::-1]])

    def volume(self, region: int) -> float:
        """Return the volume (m³) of a region."""
        used, corners = np.unique(self.boundary(region), return_inverse=True)
        return enclosed(self.points[used], corners.reshape(-1, 3))
