"""Surfaces that divide a body into regions, and meet along curves where three or more regions do."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from types import MappingProxyType

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.triangles import Triangles

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
    def around(surface: Triangles) -> "Complex":
        """Return a body of one region."""
        return Complex(surface.points, surface.facets, np.tile([TISSUE, OUTSIDE], (len(surface.facets), 1)))

    def holding(
        self, surfaces: Mapping[int, tuple[FloatArray, IntArray]], within: Mapping[int, int] = MappingProxyType({})
    ) -> "Complex":
        """Return it with closed surfaces (m): points and facets by number of region.

        They are in the body's own tissue, or in the region that has the number ``within``.
        """
        start = np.cumsum([len(self.points), *(len(points) for points, _ in surfaces.values())])
        facets = [corners + offset for (_, corners), offset in zip(surfaces.values(), start, strict=False)]
        beside = [(number, within.get(number, TISSUE)) for number in surfaces]
        sides = [np.tile(pair, (len(corners), 1)) for pair, corners in zip(beside, facets, strict=True)]
        return Complex(
            np.vstack([self.points, *(points for points, _ in surfaces.values())]),
            np.vstack([self.facets, *facets]),
            np.vstack([self.sides, *sides]),
        )

    def renumbered(self, numbers: Sequence[int]) -> "Complex":
        """Return it with other numbers of its regions, in the order of theirs; the new order must be the same."""
        new = np.array([*numbers, OUTSIDE])
        return Complex(self.points, self.facets, new[self.sides])

    def without(self, hollow: Iterable[int]) -> "Complex":
        """Return it without the ``hollow`` regions, which do not meet the outside; -1 - k is the cavity number k."""
        return replace(self, sides=np.where(np.isin(self.sides, list(hollow)), OUTSIDE - self.sides, self.sides))

    @property
    def regions(self) -> IntArray:
        """Numbers of its regions, in ascending order, without what is outside."""
        numbers = np.unique(self.sides)
        return np.asarray(numbers[numbers > OUTSIDE])

    @cached_property
    def hash(self) -> str:
        """Hash of its points, facets and regions, by which meshes of it are identified; see :class:`Triangles`."""
        own = Triangles(self.points, self.facets).hash
        if len(self.regions) == 1:
            return own
        return sha256(f"{own} {self.sides.astype('<i8').tobytes().hex()}".encode()).hexdigest()

    @cached_property
    def skin(self) -> Triangles:
        """The body's surface."""
        return self._surface(self.boundary(OUTSIDE)[:, ::-1])

    @property
    def has_divided_skin(self) -> bool:
        """Whether several regions meet what is outside."""
        return len(np.unique(self.sides[self.sides[:, 1] == OUTSIDE, 0])) > 1

    @cached_property
    def _surfaces(self) -> dict[int, Triangles]:
        """Surfaces of regions that were asked for: what is found of one, such as its thickness, is kept by it."""
        return {}

    def surface(self, region: int) -> Triangles:
        """Return the surface of a region."""
        if region not in self._surfaces:
            self._surfaces[region] = self._surface(self.boundary(region))
        return self._surfaces[region]

    def _surface(self, facets: IntArray) -> Triangles:
        used, corners = np.unique(facets, return_inverse=True)
        return Triangles(self.points[used], corners.reshape(-1, 3))

    def boundary(self, region: int) -> IntArray:
        """Return the facets (k, 3) around a region, counterclockwise seen from outside of it."""
        behind, before = (self.sides == region).T
        return np.vstack([self.facets[behind], self.facets[before][:, ::-1]])

    def volume(self, region: int) -> float:
        """Return the volume (m³) of a region."""
        return self.surface(region).volume
