"""Bodies with a surface of triangles: their size, and intersections with lines."""

from abc import abstractmethod
from functools import lru_cache
from math import inf
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.closed import Closed
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.frame import Frame, PlaceError
from epsmesh.shapes.rays import nearest_point, pierce
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.section import in_mm
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.skin import Skin
from epsmesh.shapes.triangles import Triangles

_FEW = 8  # cached surfaces with their search trees
_MANY = 10_000  # cached places, enough for a large study


class Facetted(Body):
    """A body bounded, exactly or approximately, by triangles."""

    is_round: ClassVar[bool] = False

    @property
    @abstractmethod
    def triangles(self) -> Triangles:
        """Its surface, in m."""

    @property
    def partition(self) -> Complex | None:
        """The surface with those between its regions (m), if regions meet it or each other."""
        return None

    @property
    def finest_step(self) -> float | None:
        """Smallest distance (m) of the voxels that its surface is made from; None without voxels."""
        return None

    @property
    def meeting(self) -> tuple[Embedded, ...]:
        """The regions of its partition."""
        numbers = () if self.partition is None else self.partition.regions.tolist()
        found = (piece for number, piece in enumerate(self.regions, start=1) if number in numbers)
        return tuple(piece for piece in found if isinstance(piece, Embedded))

    # ---- size -----------------------------------------------------------------------------------------

    @property
    def extent(self) -> float:
        """Largest extent (m) along x, y or z."""
        return self.triangles.extent

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest z (m)."""
        low, high = self.triangles.bounds
        return low[2], high[2]

    @property
    def volume(self) -> float:
        """Volume (m³) within the triangles."""
        return self.triangles.volume

    # ---- under a probe --------------------------------------------------------------------------------

    def touched(self, at: tuple[float, ...]) -> tuple[FloatArray, int]:
        """Return the surface point at two or three coordinates (m), and its facet: see :meth:`Body.frame`."""
        points, facets = self.triangles.points, self.triangles.facets
        if len(at) == 3:
            facet, point = nearest_point(points, facets, np.array(at))
            return point, facet
        hit, height = pierce(points, facets, np.array([at]))
        if hit[0] < 0:
            low, high = self.triangles.bounds
            raise PlaceError(
                f"no part of the surface is above or below x = {in_mm(at[0])}, y = {in_mm(at[1])}: it extends from "
                f"{in_mm(low[0])} to {in_mm(high[0])} in x and from {in_mm(low[1])} to {in_mm(high[1])} in y"
            )
        return np.array([*at, height[0]]), int(hit[0])

    def thickness(self, frame: Frame) -> float:
        """Return the distance (m) along the axis to the last point of tissue, hollows included."""
        return _thickness(self.triangles, frame)

    def reach(self, frame: Frame) -> float:
        """Return the largest distance (m) of a point from the axis."""
        return _reach(self.triangles, frame)

    def farthest(self, frame: Frame) -> float:
        """Return the largest distance (m) of a point from the contact."""
        return frame.farthest(self.triangles.points)

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points (n, 3) to the surface, negative outside."""
        return skin_of(self.triangles).depth(points)

    def room(self, surface: Closed) -> float:
        """Return the distance (m) to a ``surface`` inside; it is negative if hollows or spikes of the body cut it."""
        return _room(self.model_copy(update=dict.fromkeys(self.pieces, ())), surface)

    @property
    def face(self) -> str:
        """The extents."""
        low, high = self.triangles.bounds
        return " × ".join(in_mm(top - bottom) for bottom, top in zip(low, high, strict=True))

    # ---- symmetry -------------------------------------------------------------------------------------

    # Scanned or modelled shapes are not tested for symmetry: they have no mirror planes and no half plane.
    @property
    def half_sides(self) -> None:
        """None: no axis is known."""
        return


@lru_cache(_MANY)
def _room(body: Facetted, surface: Closed) -> float:
    (low, high), points = np.array(surface.bounds), body.triangles.points
    within = points[((points > low) & (points < high)).all(axis=1)]
    room = min(Body.room(body, surface), float(surface.distance(within).min()) if len(within) else inf)
    # Edges may cross although no corner of one surface is beyond the other.
    crosses = room > 0 and isinstance(surface, Shell) and surface.crossing(body.triangles)
    return 0.0 if crosses else room


@lru_cache(_FEW)
def skin_of(triangles: Triangles) -> Skin:
    """Return the surface with its search tree."""
    return Skin(triangles)


@lru_cache(_MANY)
def _thickness(triangles: Triangles, frame: Frame) -> float:
    _, height = pierce(-frame.local(triangles.points), triangles.facets, np.zeros((1, 2)))
    return max(float(height[0]), 0.0) if np.isfinite(height[0]) else 0.0


@lru_cache(_MANY)
def _reach(triangles: Triangles, frame: Frame) -> float:
    return frame.reach(triangles.points)
