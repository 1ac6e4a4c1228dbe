"""Bodies bounded by triangles from a scan: frames of probes on them, and their size."""

from math import inf
from typing import ClassVar

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.closed import FarSizes
from epsmesh.shapes.facetted import Facetted, skin_of
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.rays import facing, pierce
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.triangles import Triangles, closed_edges, doubled_normals

# The normal is the mean below the footprint, from a sunflower pattern of rays over a disc. It is computed twice, since
# the disc turns with it.
_RAYS, _TURNS = 400, 2
_GOLDEN = 2.399963229728653  # rad
# Radius of the disc for the normal, as a share of the body's extent, if no footprint is known.
_AROUND = 0.02
_STEEP = 1e-9
_SAME = 1e-12
# Normals are averaged within this share of a footprint's radius.
_OF_FOOTPRINT, _MOST_CELLS = 0.1, 400
# Limit of the curvature, in units of area over bend: folded surfaces have 9 to 38, a liver 2, voxel steps more.
_MOST_CURVED = 40.0
# Finest and coarsest deviation of elements' facets from the surface, in units of the largest elements. It goes like the
# square of the growth of sizes, as the error of chords goes like that of sizes. It is coarsest at the growth for an
# error bar of 2 %.
FINE, _COARSE = 0.02, 0.1


class Scanned(Facetted):
    """A body bounded by scanned triangles."""

    is_smooth: ClassVar[bool] = True

    # ---- under a probe --------------------------------------------------------------------------------

    def frame(self, at: tuple[float, ...], axis: Vector | None = None, around: float = 0.0) -> Frame:
        """Return the frame at two or three coordinates (m).

        The normal is the area-weighted mean within a disc of radius ``around`` (m), not that of one facet.
        """
        point, facet = self.touched(at)
        inward = -doubled_normals(self.triangles.points, self.triangles.facets[facet : facet + 1])[0]
        frame = _frame(point, inward, inward if axis is None else axis)
        for _ in range(_TURNS):
            inward = self._mean_normal(frame, around or _AROUND * self.extent)
            frame = _frame(point, inward, inward if axis is None else axis)
        return frame

    def frame_below(self, at: tuple[float, ...], axis: Vector | None, around: float) -> Frame:
        """Return the frame with the mean normal within a disc of radius ``around`` (m)."""
        return self.frame(at, axis, around)

    def _mean_normal(self, frame: Frame, radius: float) -> FloatArray:
        """Return the mean inward normal, area-weighted, of the tissue below a disc."""
        number = np.arange(_RAYS)
        r, angle = radius * np.sqrt((number + 0.5) / _RAYS), _GOLDEN * number
        points, normals = self.lift(frame, np.column_stack([r * np.cos(angle), r * np.sin(angle)]))
        hit = np.isfinite(points[:, 0])
        if hit.sum() < _RAYS / 2:
            return np.array(frame.normal)
        # Rays have equal areas across the axis, and 1 / cos of it on the surface.
        cosine = normals[hit] @ np.array(frame.outward)
        vector: FloatArray = -(normals[hit] / np.maximum(cosine, _STEEP)[:, None]).sum(axis=0)
        return vector

    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along a probe's axis enter the connected surface around the contact, and normals there.

        Points (n, 3), in m, are NaN for lines that miss it. Normals are area-weighted means over facets within about a
        tenth of the points' extent, since normals of single facets are as noisy as the image.
        """
        local, facets = frame.local(self.triangles.points), self.triangles.facets
        patch = facets[facing(local, facets, float(np.abs(points).max(initial=0.0)))]
        hit, height = pierce(local, patch, points)
        found = hit >= 0
        result = frame.world(np.column_stack([points, height]))
        normals = np.full((len(points), 3), np.nan)
        if found.any():
            around = _OF_FOOTPRINT * float(np.hypot(points[:, 0], points[:, 1]).max())
            normals[found] = _smoothed(self.triangles.points, local, patch, hit[found], points[found], around)
        return result, normals

    def gap(self, point: Vector) -> float:
        """Return infinity: there are no face edges, and `lift` shows where a footprint misses the surface."""
        return inf

    # ---- geometry -------------------------------------------------------------------------------------

    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return the one surface."""
        return {"skin": (skin_of(self.triangles),)}

    @property
    def bend(self) -> float:
        """Half of the smallest extent (m) along x, y or z: a few elements then fit through the body everywhere."""
        low, high = self.triangles.bounds
        return min(high[0] - low[0], high[1] - low[1], high[2] - low[2]) / 2

    @property
    def curvature(self) -> float:
        """Twice the surface integral (m) of the mean curvature; voxel steps count only if elements resolve them."""
        return min(self.triangles.curvature, _MOST_CURVED * self.triangles.area / self.bend)

    def deviation(self, far: FarSizes, *, straight: bool) -> float:
        """Return the deviation of elements' facets from the surface far from a tool, for the growth of sizes there.

        It is in units of the largest elements. It is small where not all middles of edges come back to the surface: in
        ``straight`` elements, of degree 1, and at junctions of regions.
        """
        is_rough = straight or self.partition is not None
        return FINE if is_rough else min(max(_COARSE * far.relative**2, FINE), _COARSE)

    def outline(self) -> list[FloatArray]:
        """Return silhouettes along x, y and z as lines: edges between facets that face opposite sides."""
        return _silhouettes(self.triangles)


def _frame(point: FloatArray, normal: FloatArray, axis: FloatArray | Vector) -> Frame:
    """Return the frame with these vectors, and ``along`` as the projection of x normal to the axis."""
    unit, inward = map(_unit, (axis, normal))
    start = (1.0, 0.0, 0.0) if abs(unit[0]) < 0.9 else (0.0, 1.0, 0.0)
    x, y, z = ((float(v[0]), float(v[1]), float(v[2])) for v in (point, inward, unit))
    return Frame(x, y, z).turned(start)


def _unit(vector: FloatArray | Vector) -> FloatArray:
    """Return the unit vector; one that is vertical within rounding is exact."""
    unit = np.array(vector) / np.linalg.norm(vector)
    return np.where(np.abs(unit) < _SAME, 0.0, unit) + 0.0 if np.abs(unit).max() > 1 - _SAME else unit


def _smoothed(
    points: FloatArray, local: FloatArray, patch: IntArray, hit: IntArray, places: FloatArray, around: float
) -> FloatArray:
    """Return unit normals (n, 3) at ``places`` (n, 2) in the facets ``hit``, averaged with their surroundings."""
    vectors, middle = doubled_normals(points, patch), local[patch].mean(axis=1)[:, :2]
    size = max(around, float(np.finfo(float).tiny))
    low = np.minimum(middle.min(axis=0), places.min(axis=0)) - 2 * size
    cell, own = (np.floor((p - low) / size).astype(np.int64) for p in (middle, places))
    counts = np.maximum(cell.max(axis=0), own.max(axis=0)) + 2
    total = np.zeros((*np.minimum(counts, _MOST_CELLS), 3))
    inside = (cell < _MOST_CELLS - 1).all(axis=1)
    np.add.at(total, tuple(cell[inside].T), vectors[inside])
    result = vectors[hit].copy()
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            at = np.clip(own + np.array((i, j)), 0, np.array(total.shape[:2]) - 1)
            result += total[at[:, 0], at[:, 1]]
    return result / np.linalg.norm(result, axis=1, keepdims=True)


def _silhouettes(triangles: Triangles) -> list[FloatArray]:
    points = triangles.points
    edges, owner = closed_edges(triangles.facets)
    normals = doubled_normals(points, triangles.facets)
    lines = []
    for axis in range(3):
        side = normals[:, axis] > 0
        lines += list(points[edges[side[owner[:, 0]] != side[owner[:, 1]]]])
    return lines
