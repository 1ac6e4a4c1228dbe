"""The half plane of an ellipsoid of revolution: half an ellipse, meshed in its own coordinates.

A point is r = a ρ sin φ, z = c (ρ cos φ - 1): the touched pole is the origin, φ is the angle from it, and ρ = 1 is the
surface. The rectangle 0 <= φ <= π, -1 <= ρ - 1 <= 0 is halved into boxes, as for a cylinder, by distances in space; its
lower side, ρ = 0, is a single point. Boxes are cut into triangles with straight sides. Triangles with a side on the
surface are curved to fit it, by polynomials of degree 4 that meet it at five points per side.
"""

import time
from dataclasses import dataclass
from math import acos, asin, hypot, pi

import numpy as np

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.boxes import halve_boxes, triangulate
from epsmesh.mesh.meridian import AXIS, KINK, Grading, MeridianArrays, mildness, name_edges, ratio
from epsmesh.mesh.round_fields import Resolution, RoundField
from epsmesh.scene.model import FIXED, FREE, PROBE

# Degree of the sides on the surface.
ORDER = 4
# Largest angle φ of a triangle, in units of the growth: a quarter and a twelfth of π gave the same F.
_WIDEST = pi / 6


@dataclass(frozen=True)
class EllipticMeridian:
    """An ellipsoid about the z axis, centred on the origin, under a disc on its upper pole; lengths in metres.

    ``radius`` is its semi-axis across z, ``semi_height`` that along z. Its surface is fixed below the level
    z = ``fixed``. The footprint is the part that projects along z into the disc of ``probe_radius``. ``kinks`` are
    radii (m) within it at which the prescribed displacement is not smooth. ``fields`` has that of its stiffness.

    Raises:
        ValueError: if that disc is as wide as the body.
    """

    radius: float
    semi_height: float
    probe_radius: float
    fixed: float
    kinks: tuple[float, ...] = ()
    fields: tuple[RoundField | None, ...] = ()

    def __post_init__(self) -> None:
        """Raise an error for a footprint without an edge."""
        if not self.probe_radius < self.radius:
            raise ValueError(
                f"a probe of radius {self.probe_radius:g} m covers all of an ellipsoid of {self.radius:g} m"
            )

    @property
    def unit(self) -> float:
        """Radius a (m) of the footprint: the unit of length of the mesh."""
        return self.probe_radius

    def mesh(self, grading: Grading) -> MeridianArrays:
        """Mesh the half plane: the same input gives the same arrays, bit for bit."""
        start = time.perf_counter()
        outline = _Outline.of(self)
        points, cells, _ = triangulate(_boxes(outline, grading, Resolution(self.fields, self.unit, outline.place)))
        groups = name_edges(outline.sides, points)
        (centre,) = np.nonzero(points[:, 1] == -1)
        one = np.arange(len(points))
        one[centre] = centre[0]
        cells = one[cells]
        cells = cells[(np.diff(np.sort(cells, axis=1), axis=1) > 0).all(axis=1)]
        surface = np.vstack([edges for name, edges in groups.items() if name != AXIS])
        nodes, bent = _numbered(_bend(outline, points, cells, surface), cells)
        number = np.empty(len(points), dtype=np.int64)
        number[cells] = bent[:, :3]
        facets = {name: number[one[edges]] for name, edges in groups.items()}
        regions, places = np.zeros(len(cells), dtype=np.int64), np.array([place for _, place, _ in outline.singular])
        seconds = time.perf_counter() - start
        return MeridianArrays(nodes, bent, regions, facets, places, self.unit, seconds, ORDER, self.fields)


@dataclass(frozen=True)
class _Outline:
    """Semi-axes in units of a, and the angles φ at which the footprint ends and the support begins."""

    radius: float
    height: float
    probe: float
    support: float
    kinks: tuple[float, ...] = ()

    @staticmethod
    def of(meridian: EllipticMeridian) -> "_Outline":
        radius, height = (ratio(length, meridian.unit) for length in (meridian.radius, meridian.semi_height))
        level = ratio(meridian.fixed, meridian.unit) / height
        kinks = tuple(asin(ratio(kink, meridian.unit) / radius) for kink in meridian.kinks)
        return _Outline(radius, height, asin(1 / radius), acos(min(max(level, -1.0), 1.0)), kinks)

    @property
    def sides(self) -> list[tuple[tuple[float, float], tuple[float, float], str]]:
        """Ends, in the coordinates φ and ρ - 1, and group of each side that bounds the body or is its axis."""
        # A support that reaches into the footprint, which is refused later, must still share a corner with it.
        start = max(self.support, self.probe)
        parts = [(0.0, self.probe, PROBE), (self.probe, start, FREE), (start, pi, FIXED)]
        surface = [((low, 0.0), (high, 0.0), name) for low, high, name in parts if low < high]
        return [*surface, ((0.0, -1.0), (0.0, 0.0), AXIS), ((pi, -1.0), (pi, 0.0), AXIS)]

    @property
    def singular(self) -> list[tuple[float, FloatArray, float]]:
        """Angles and points (r, z) of singular displacement, and the largest element size there relative to the rim."""
        smallest = min(self.radius, self.height)
        rim = self.place(np.array([[self.probe, 0.0]]))[0]
        points = [(self.probe, rim, 1.0)]
        if self.probe < self.support < pi:
            edge = self.place(np.array([[self.support, 0.0]]))[0]
            points.append((self.support, edge, mildness(hypot(*(edge - rim)), self.radius, smallest)))
        return points + [(kink, self.place(np.array([[kink, 0.0]]))[0], KINK) for kink in self.kinks]

    def place(self, points: FloatArray) -> FloatArray:
        """Return r and z of points (..., 2) with coordinates φ and ρ - 1, with full relative accuracy near the pole."""
        angle, rho = points[..., 0], 1 + points[..., 1]
        r = self.radius * rho * np.sin(np.minimum(angle, pi - angle))
        z = self.height * (points[..., 1] - 2 * rho * np.sin(angle / 2) ** 2)
        return np.stack([r, z], axis=-1)


def _boxes(outline: _Outline, grading: Grading, resolution: Resolution) -> FloatArray:
    """Halve the half plane along the side of each box that is longer in space, until all are small enough."""
    most = grading.cap * min(outline.radius, outline.height)
    marks = [np.unique([0.0, outline.probe, outline.support, pi, *outline.kinks]), np.array([-1.0, 0.0])]
    ends = outline.place(np.column_stack([marks[0], np.zeros(len(marks[0]))]))
    least = float(np.linalg.norm(np.diff(ends, axis=0), axis=1).min()) / 4

    def judge(boxes: FloatArray) -> tuple[BoolArray, BoolArray]:
        low, high, inner, outer = boxes.T
        size = np.full(len(boxes), most)
        for angle, place, factor in outline.singular:
            nearest = np.column_stack([np.clip(angle, low, high), outer])
            distance = np.linalg.norm(outline.place(nearest) - place, axis=1)
            size = np.minimum(size, grading.near(distance, factor, least))
        sine, cosine = np.sin((low + high) / 2), np.cos((low + high) / 2)
        wide = (high - low) * (1 + outer) * np.hypot(outline.radius * cosine, outline.height * sine)
        deep = (outer - inner) * np.hypot(outline.radius * sine, outline.height * cosine)
        is_wide = high - low > _WIDEST * grading.growth
        longest = np.maximum(wide, deep)
        large = (longest > size) | is_wide
        large[~large] = resolution.large(boxes[~large], longest[~large], np.zeros(np.sum(~large), dtype=int))
        return large, (deep > wide) & ~is_wide

    return halve_boxes(np.array([(0.0, pi, -1.0, 0.0)]), marks, judge)


def _bend(outline: _Outline, points: FloatArray, cells: IntArray, surface: IntArray) -> FloatArray:
    """Return the nodes (m, k, 2) of triangles of degree 4, with those of ``surface`` edges on the ellipse.

    The bulge of a side decays towards the opposite corner with the power for which the map is a polynomial of that
    degree (M. Lenoir, SIAM J. Numer. Anal. 23, 562, 1986).
    """
    weights = _barycentric()
    nodes = np.einsum("kc,mcd->mkd", weights, outline.place(points)[cells])
    key = np.array([len(points), 1])
    keys = np.sort(surface, axis=1) @ key
    for first, second in ((0, 1), (1, 2), (2, 0)):
        (bent,) = np.nonzero(np.isin(np.sort(cells[:, (first, second)], axis=1) @ key, keys))
        start, end = points[cells[bent, first], None], points[cells[bent, second], None]
        share = weights[:, first] + weights[:, second]
        along = np.divide(weights[:, second], share, out=np.zeros(len(share)), where=share > 0)[:, None]
        arc = outline.place(start * (1 - along) + end * along)
        chord = outline.place(start) * (1 - along) + outline.place(end) * along
        nodes[bent] += share[:, None] ** ORDER * (arc - chord)
    return nodes


def _numbered(nodes: FloatArray, cells: IntArray) -> tuple[FloatArray, IntArray]:
    """Number the nodes (m, k, 2) of all cells: return their coordinates (n, 2), and the node numbers of cells (m, k).

    A node is identified by the corners of its cell and the number of steps from the side opposite to each.
    """
    steps = np.rint(ORDER * _barycentric()).astype(np.int64)
    parts = np.where(steps > 0, cells[:, None, :] * ORDER + steps, 0)
    parts.sort(axis=2)
    base = int(parts.max()) + 1
    _, first, number = np.unique(parts @ np.array([base**2, base, 1]), return_index=True, return_inverse=True)
    return nodes.reshape(-1, 2)[first], number.reshape(nodes.shape[:2])


def _barycentric() -> FloatArray:
    """Barycentric coordinates (k, 3) of the nodes of a triangle, the corners first."""
    places = compat.triangle_nodes(ORDER)
    return np.column_stack([1 - places.sum(axis=1), places])
