"""The half plane (r, z) of an axisymmetric scene, meshed by triangles that are graded towards every singular point.

The half plane is a rectangle, or a stack of rectangles if the body has layers. It is halved into boxes until each is
small enough for its place, and boxes are cut into triangles. This takes milliseconds, gives the same mesh with every
version of every library, and allows elements of 1e-9 of the body; gmsh 4.8 aborts the process at 1e-7.

Lengths of the mesh are in units of the footprint's radius a, rounded to 12 digits: a body of a millimetre and one of
ten metres give the same mesh.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot, inf, isqrt
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.boxes import halve_boxes, triangulate
from epsmesh.mesh.distribute import exterior_facets
from epsmesh.mesh.round_fields import Resolution, RoundField
from epsmesh.scene.model import CUT, FIXED, FREE, PROBE
from epsmesh.shapes.support import HeldOnHalfPlane

Corner = tuple[float, float]

AXIS = "axis"
JOINT = "joint"

# A more slender body is meshed with stretched boxes: nothing varies over a thickness far from the contact.
_MOST_SLENDER = 1000
# Where two fixed faces meet the displacement goes like r to a power between 1 (ν = 0.5) and 1.7, not 1/2.
_MILD = 1e3
# Below a kink of the tool, pressure has at most a logarithmic singularity.
KINK = 1e3


@dataclass(frozen=True)
class Grading:
    """Element size: ``floor`` at the probe's edge, growing by ``growth`` per unit of distance, at most ``cap``.

    ``floor`` is in units of a, ``cap`` in units of the smaller of the body's height and radius, or of a thousandth of
    the larger. At an edge of the support at distance D the floor is (D/a)² times larger, since the squared strain there
    is smaller by that factor.
    """

    floor: float = 1e-6
    growth: float = 1.0
    cap: float = 4.0

    def near(self, distance: FloatArray, factor: float, least: float) -> FloatArray:
        """Return sizes at distances (n,) from a singular point whose floor is ``factor`` times larger, or ``least``."""
        return min(self.floor * factor, least) + self.growth * distance


def mildness(distance: float, radius: float, smallest: float) -> float:
    """Return the size of elements at an edge of the support, relative to the rim, at a ``distance`` from it.

    Lengths are in units of a: the body's ``radius``, and its ``smallest`` extent.
    """
    return min(max(1.0, min(distance, radius) ** 2), max(1.0, 100 * smallest))


@dataclass(frozen=True)
class MeridianArrays:
    """A mesh of the meridian, in units of ``unit`` metres.

    ``points`` (n, 2) are (r, z), ``cells`` (m, 3) the triangles, ``regions`` (m,) their region numbers. ``facets`` maps
    the name of a boundary group to its edges (k, 2). ``singular`` (s, 2) are the points to which the mesh is graded.
    With a higher ``order`` cells have more nodes, corners first, in the order of the elements. ``fields`` are those of
    the regions by number.
    """

    points: FloatArray
    cells: IntArray
    regions: IntArray
    facets: dict[str, IntArray]
    singular: FloatArray
    unit: float
    seconds: float
    order: int = 1
    fields: tuple[RoundField | None, ...] = ()

    def field_of(self, region: int) -> Callable[[FloatArray], FloatArray] | None:
        """Return the field of a region, at points (n, 2) of the mesh; None if its stiffness is constant."""
        field = self.fields[region] if self.fields else None
        return None if field is None else lambda points: field.at(self.unit * points)


class RegionMesh(NamedTuple):
    """The dolfinx ``mesh`` of a region on this process alone, the ``facets`` of each group, and its ``field``."""

    mesh: Any
    facets: dict[str, Int32Array]
    field: Callable[[FloatArray], FloatArray] | None = None


@dataclass(frozen=True)
class Meridian:
    """A cylinder about the z axis, top at z = 0, under a disc on its axis; lengths in metres.

    ``fixed`` is the support: the bottom, the side, both, or the boundary below the level z = ``fixed`` < 0. Only
    r < ``column`` of the body is kept; the cut face is free, or fixed if ``column_fixed``. ``interfaces`` are the
    heights z (m), from the top down, between layers, which are regions 1, 2, ... of the mesh. The part below all of
    them is another layer if ``is_filled``, else region 0. ``kinks`` are radii (m) within the disc at which the
    prescribed displacement is not smooth. The rings ``lost``, pairs of radii (m) from the innermost on, are not in
    contact. ``fields`` are those of the stiffness of the regions by number, none if it is constant.
    """

    radius: float
    height: float
    probe_radius: float
    fixed: HeldOnHalfPlane = "bottom"
    column: float = inf
    column_fixed: bool = False
    interfaces: tuple[float, ...] = ()
    is_filled: bool = False
    kinks: tuple[float, ...] = ()
    lost: tuple[tuple[float, float], ...] = ()
    fields: tuple[RoundField | None, ...] = ()

    @property
    def is_cut(self) -> bool:
        """Whether a column is cut out of the body."""
        return self.column < self.radius

    @property
    def kept_radius(self) -> float:
        """Radius (m) of the kept part of the body."""
        return min(self.column, self.radius)

    @property
    def unit(self) -> float:
        """Radius a (m) of the footprint on the kept part: the unit of length of the mesh."""
        return min(self.probe_radius, self.kept_radius)

    @property
    def held_below(self) -> float:
        """Height z (m) below which the outer face is fixed: 0 for all of it, -height for none."""
        if self.is_cut:
            return 0.0 if self.column_fixed else -self.height
        if isinstance(self.fixed, str):
            return 0.0 if "sides" in self.fixed else -self.height
        return min(max(self.fixed, -self.height), 0.0)

    @property
    def bottom_held(self) -> bool:
        """Whether the bottom face is fixed."""
        return "bottom" in self.fixed if isinstance(self.fixed, str) else self.fixed >= -self.height

    def mesh(self, grading: Grading) -> MeridianArrays:
        """Mesh the half plane: the same input gives the same arrays, bit for bit."""
        start = time.perf_counter()
        singular = _singular_points(self)
        boxes = _boxes(self, singular, grading)
        points, cells, box = triangulate(boxes)
        regions = self.regions_of(boxes)[box]
        corners, groups = _outline(self)
        facets = name_edges(list(zip(corners, [*corners[1:], corners[0]], groups, strict=True)), points)
        places = np.array([(r, z) for r, z, _ in singular]).reshape(-1, 2)
        seconds = time.perf_counter() - start
        return MeridianArrays(points, cells, regions, facets, places, self.unit, seconds, fields=self.fields)

    def regions_of(self, boxes: FloatArray) -> IntArray:
        """Return the region number (n,) of boxes (n, 4) of the half plane."""
        layer = np.sum(boxes[:, 2, None] < np.array(_interfaces(self)), axis=1)  # number of interfaces above it
        return np.where((layer < len(self.interfaces)) | self.is_filled, layer + 1, 0)


def split_regions(arrays: MeridianArrays) -> dict[int, MeridianArrays]:
    """Return a mesh of each region, by its number; a single region is the mesh itself."""
    numbers = np.unique(arrays.regions)
    if len(numbers) == 1:
        return {int(numbers[0]): arrays}
    return {int(number): _part(arrays, arrays.regions == number) for number in numbers}


def _part(arrays: MeridianArrays, chosen: BoolArray) -> MeridianArrays:
    """Return the mesh of the chosen cells."""
    kept, cells = np.unique(arrays.cells[chosen], return_inverse=True)
    number = np.full(len(arrays.points), -1)
    number[kept] = np.arange(len(kept))
    edges = {name: number[pairs] for name, pairs in arrays.facets.items()}
    facets = {name: pairs[np.all(pairs >= 0, axis=1)] for name, pairs in edges.items()}
    facets = {name: pairs for name, pairs in facets.items() if len(pairs)}
    return replace(
        arrays, points=arrays.points[kept], cells=cells.reshape(-1, 3), regions=arrays.regions[chosen], facets=facets
    )


def meridian_mesh(arrays: MeridianArrays) -> RegionMesh:
    """Return the mesh of ``arrays`` on this process alone, and the facets of each group.

    Boundary edges without a group are interfaces with other regions. The field is that of the first cell's region.
    """
    mesh = compat.create_mesh(MPI.COMM_SELF, arrays.cells, arrays.points, arrays.order)
    exterior, ends = exterior_facets(mesh)
    key = np.array([len(arrays.points), 1])
    facets = {
        name: exterior[np.isin(ends @ key, np.sort(edges, axis=1) @ key)] for name, edges in arrays.facets.items()
    }
    facets[JOINT] = np.setdiff1d(exterior, np.concatenate([*facets.values()]))
    return RegionMesh(mesh, facets, arrays.field_of(int(arrays.regions[0])))


def name_edges(sides: Sequence[tuple[Corner, Corner, str]], points: FloatArray) -> dict[str, IntArray]:
    """Return the edges along ``sides``, by group; a side has two corners and a group."""
    facets: dict[str, list[IntArray]] = {}
    for start, end, name in sides:
        fixed = 0 if start[0] == end[0] else 1
        low, high = sorted((start[1 - fixed], end[1 - fixed]))
        along = points[:, 1 - fixed]
        (chosen,) = np.nonzero((points[:, fixed] == start[fixed]) & (along >= low) & (along <= high))
        chosen = chosen[np.argsort(along[chosen])]
        facets.setdefault(name, []).append(np.column_stack([chosen[:-1], chosen[1:]]))
    return {name: np.vstack(edges) for name, edges in facets.items()}


def mesh_order(mesh: Any) -> int:
    """Return the order of the triangles of a mesh, which have (n + 1)(n + 2)/2 nodes."""
    return (isqrt(8 * compat.geometry_dofs(mesh).shape[1] + 1) - 3) // 2


def ratio(length: float, unit: float) -> float:
    """Return ``length`` in units of ``unit``, rounded to 12 digits."""
    return float(f"{length / unit:.12g}")


def _outline(meridian: Meridian) -> tuple[list[tuple[float, float]], list[str]]:
    """Corners of the meridian in units of a, counter-clockwise, and the group of the edge that starts at each."""
    a = meridian.unit
    radius, height = ratio(meridian.kept_radius, a), ratio(meridian.height, a)
    level = ratio(meridian.held_below, a)
    corners, groups = [(0.0, -height)], [FIXED if meridian.bottom_held else FREE]
    outer = CUT if meridian.is_cut else FREE
    if level > -height:
        corners.append((radius, -height))
        groups.append(FIXED)
    if level < 0:
        corners.append((radius, level))
        groups.append(outer)
    corners.append((radius, 0.0))
    groups.append(FREE)
    if radius > 1:
        corners.append((1.0, 0.0))
        groups.append(PROBE)
    else:
        groups[-1] = PROBE
    for inner, end in reversed(meridian.lost):
        corners.append((ratio(end, a), 0.0))
        groups.append(FREE)
        if inner > 0:
            corners.append((ratio(inner, a), 0.0))
            groups.append(PROBE)
    corners.append((0.0, 0.0))
    groups.append(AXIS)
    return corners, groups


def _interfaces(meridian: Meridian) -> list[float]:
    """Heights of the interfaces between layers, in units of a, from the top."""
    return [ratio(height, meridian.unit) for height in meridian.interfaces]


def _singular_points(meridian: Meridian) -> list[tuple[float, float, float]]:
    """Points (r, z) of singular displacement, and the element size there relative to the rim."""
    corners, groups = _outline(meridian)
    radius = max(r for r, _ in corners)
    smallest = min(radius, -min(z for _, z in corners))
    points = []
    for (r, z), before, after in zip(corners, [groups[-1], *groups[:-1]], groups, strict=True):
        held = {PROBE: 2, FIXED: 1}  # the rest is free
        if AXIS in (before, after) or not {before, after} & set(held):
            continue
        factor = mildness(hypot(r - 1, z), radius, smallest)
        points.append((r, z, factor if held.get(before) != held.get(after) else _MILD * factor))
    points += [(ratio(radius, meridian.unit), 0.0, KINK) for radius in meridian.kinks]
    ends = _interfaces(meridian)
    return points + [(radius, z, _MILD * mildness(hypot(radius - 1, z), radius, smallest)) for z in ends]


def _boxes(meridian: Meridian, singular: list[tuple[float, float, float]], grading: Grading) -> FloatArray:
    """Halve each layer of the meridian along the longer side of its boxes until all are small enough.

    The boxes are (n, 4) of r0, r1, z0, z1.
    """
    corners = np.array(_outline(meridian)[0])
    (r_end, _), (_, z_end) = corners.max(axis=0), corners.min(axis=0)
    most = grading.cap * max(min(r_end, -z_end), max(r_end, -z_end) / _MOST_SLENDER)
    ends = [0.0, *_interfaces(meridian), float(z_end)]
    kinks = [ratio(radius, meridian.unit) for radius in meridian.kinks]
    marks = [np.unique([*corners[:, 0], *kinks]), np.unique([*corners[:, 1], *ends])]
    # Boxes smaller than the distances between marks have all of the marks among their corners.
    least = min(np.diff(m).min() for m in marks) / 4
    resolution = Resolution(meridian.fields, meridian.unit)

    def judge(boxes: FloatArray) -> tuple[BoolArray, BoolArray]:
        r0, r1, z0, z1 = boxes.T
        size = np.full(len(boxes), most)
        for r, z, factor in singular:
            distance = np.hypot(np.maximum(np.maximum(r0 - r, r - r1), 0), np.maximum(np.maximum(z0 - z, z - z1), 0))
            size = np.minimum(size, grading.near(distance, factor, least))
        longest = np.maximum(r1 - r0, z1 - z0)
        large = longest > size
        large[~large] = resolution.large(boxes[~large], longest[~large], meridian.regions_of(boxes[~large]))
        return large, z1 - z0 > r1 - r0

    layers = [(0.0, r_end, low, high) for high, low in pairwise(ends)]
    return halve_boxes(np.array(layers), marks, judge)
