"""A closed surface of triangles inside a body: signed distances, points on it, and its thickness."""

from functools import cached_property
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.closed import Closed, FarSizes
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.skin import Skin
from epsmesh.shapes.triangles import Triangles, doubled_normals

# Points at which the thickness is found. The tenth of the surface where it is thinnest counts as no thinner than the
# rest: edges, tips and noise.
_POINTS, _THIN = 4000, 0.1
# The same for a region that meets others: along every junction it is a wedge.
_THIN_PART = 0.4
# Rounds in which a ball inside the surface shrinks until it contains no other point: three or four suffice for most.
_ROUNDS = 30
# A ball ends at points of which its centre sees the first one under a larger angle (cosine); nearer ones are noise.
_APART, _SAME = 0.5, 1e-6
# Half of the thickness, in units of volume over area, is 1 of a sheet and 3 of a ball: no shape has more, but for
# rounding.
_MOST_OF_SHEET = 3.4
# A surface is thin if its area is so many squares of its thickness: a sheet 10, a thread 60 times as long as thick.
_SHEET = 200.0
# Fractions of a low-discrepancy sequence in two dimensions (M. Roberts, 2018).
_PLASTIC = np.array([0.7548776662466927, 0.5698402909980532])


class Shell(Closed):
    """The closed surface of ``triangles``, which ``is_part`` of a body whose regions meet, or not."""

    LEAST: ClassVar[str] = "half of its thickness"

    def __init__(self, triangles: Triangles, *, is_part: bool = False):
        self.triangles = triangles
        self._thin = _THIN_PART if is_part else _THIN
        self._skin = Skin(triangles)

    # ---- surface --------------------------------------------------------------------------------------

    def distance(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of each point, positive outside."""
        return -self._skin.depth(points)

    def project(self, points: FloatArray) -> FloatArray:
        """Return the nearest points."""
        return self._skin.project(points)

    @property
    def volume(self) -> float:
        """Enclosed volume (m³)."""
        return self.triangles.volume

    @property
    def bounds(self) -> tuple[Vector, Vector]:
        """Lowest and highest coordinates (m)."""
        return self.triangles.bounds

    @property
    def identity(self) -> str:
        """Hash of its triangles."""
        return self.triangles.hash

    def sample(self, count: int) -> FloatArray:
        """Return its corners, and ``count`` points spread over its facets by their areas."""
        return np.vstack([self.triangles.points, self._spread(count)[0]])

    def _spread(self, count: int) -> tuple[FloatArray, IntArray]:
        """Return points (count, 3) spread over the facets by their areas, and the facet of each."""
        points, facets = self.triangles.points, self.triangles.facets
        total = np.cumsum(np.linalg.norm(doubled_normals(points, facets), axis=1))
        number = np.arange(count)
        facet = np.searchsorted(total, (number + 0.5) / count * total[-1])
        u, v = ((number[:, None] + 0.5) * _PLASTIC % 1).T
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        a, b, c = (points[facets[facet, k]] for k in range(3))
        return a + u[:, None] * (b - a) + v[:, None] * (c - a), facet

    # ---- thickness ------------------------------------------------------------------------------------

    @cached_property
    def thin(self) -> tuple[FloatArray, FloatArray]:
        """Points (n, 3) on it, and half of the thickness (n) inside it there, both in m.

        That is the radius of the largest ball inside that touches the surface there (J. Ma, S. Bae, S. Choi, The Visual
        Computer 28, 2012), without those between neighbouring points. It is at least that of most of the points.
        """
        from scipy.spatial import cKDTree  # noqa: PLC0415 (only when a file is read)

        points, facet = self._spread(_POINTS)
        normals = self._normals[facet]
        tree, radius = cKDTree(points), np.full(len(points), self.triangles.extent)
        shrinks = np.arange(len(points))
        for _ in range(_ROUNDS):
            own, normal, r = points[shrinks], normals[shrinks], radius[shrinks]
            centres = own - r[:, None] * normal
            _, nearest = tree.query(centres)
            other = points[nearest]
            apart = own - other
            reach = 2 * (apart * normal).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                smaller = (apart**2).sum(axis=1) / reach
            shorter = (nearest != shrinks) & (reach > 0) & (smaller < r * (1 - _SAME))
            smaller = np.where(shorter, smaller, r)
            new = own - smaller[:, None] * normal
            angle = ((own - new) * (other - new)).sum(axis=1) / smaller**2
            goes_on = shorter & (angle < _APART)
            shrinks = shrinks[goes_on]
            radius[shrinks] = smaller[goes_on]
        half = np.maximum(radius, np.quantile(radius, self._thin))
        sheet = self.volume / self.triangles.area
        # A sheet thinner than the distance between the points: no ball meets its other side.
        return points, np.full_like(half, sheet) if half.min() > _MOST_OF_SHEET * sheet else half

    @cached_property
    def _normals(self) -> FloatArray:
        """Outward unit normals of the facets, as means of those at their corners: single facets are noisy."""
        points, facets = self.triangles.points, self.triangles.facets
        vectors = doubled_normals(points, facets)
        corners = np.column_stack(
            [np.bincount(facets.ravel(), np.repeat(vectors[:, k], 3), minlength=len(points)) for k in range(3)]
        )
        mean = corners[facets].sum(axis=1)
        return mean / np.linalg.norm(mean, axis=1, keepdims=True)

    @property
    def least(self) -> float:
        """Half of its thickness (m) where it is thin."""
        return float(self.thin[1].min())

    @property
    def is_thin(self) -> bool:
        """Whether it is a thin sheet or a long thread, on which elements by its thickness are many."""
        return self.triangles.area > _SHEET * (2 * self.least) ** 2

    def crossing(self, other: Triangles) -> Vector | None:
        """Return a place (m) at which a facet crosses or touches one of an ``other`` surface."""
        from epsmesh.shapes.files.crossings import crossings  # noqa: PLC0415 (only when a file is read)

        both = self.triangles, other
        ends = np.array([one.bounds for one in both])
        low, high = ends[:, 0].max(axis=0), ends[:, 1].min(axis=0)
        near = []
        for one in both:
            corners = one.points[one.facets]
            near.append(one.facets[((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)])
        if not all(map(len, near)):
            return None
        points, facets = np.vstack([one.points for one in both]), np.vstack([near[0], near[1] + len(both[0].points)])
        pairs = crossings(points, facets)
        pairs = pairs[(pairs < len(near[0])).sum(axis=1) == 1]
        if not len(pairs):
            return None
        x, y, z = map(float, points[facets[pairs[0]]].mean(axis=(0, 1)))
        return x, y, z

    def sizes(self, far: FarSizes) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points (n, 3), element sizes (n) by the thickness there, and equal areas (n) of parts around them."""
        points, half = self.thin
        away = np.linalg.norm(points - np.array(far.contact), axis=1)
        return points, far.size_on(half, away), np.full(len(half), self.triangles.area / len(half))

    # ---- symmetry -------------------------------------------------------------------------------------

    def has_axis(self, within: float) -> bool:
        """Return False: shapes from files are not tested for symmetry."""
        return False

    def is_mirrored(self, axis: int) -> bool:
        """Return False: shapes from files are not tested for symmetry."""
        return False
