"""The far field of a model's visible surface: R on the boundary for a force anywhere in the region, as a few modes.

R (m/N for E = 1) is solved for at Chebyshev places of a quarter of the region, or of a radius, and carried to their
images: mirror images of a box, turned ones of a round body. What remains is of low rank: modes on the boundary, whose
amounts are polynomials of the place and of ν.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import FloatArray, IntArray
from pipeline.export.region import Region
from pipeline.mesh.distribute import BodyMesh
from pipeline.realtime.surface import SurfaceTable
from pipeline.shapes.body import Layered
from pipeline.solve.far_field import PointForce
from pipeline.solve.regular import OnBoundary, regular_on_boundary
from pipeline.stages import stage

# Intervals between the places from the middle to the end of the region; of Poisson's ratios; held-out places.
_SIZE, _POISSONS, _HELD_OUT = 6, 3, 4
# Modes are kept until they miss R × room by this share of its largest value.
_CUT = 0.03
# Triangles that are looked through for the one a point lies in, steps that find its place on a bent one.
_NEAREST, _STEPS = 24, 6
_WHOLE = 32767
# A quadratic triangle by its halves: corners, then the middles opposite to them.
_QUARTERS = ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5))

Place = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Image:
    """A motion (3, 3) that maps the body to itself, and the values at the moved nodes as sums of those at nodes."""

    motion: FloatArray
    nodes: IntArray
    weights: FloatArray

    def of(self, values: FloatArray) -> FloatArray:
        """Return the field (n, 3) for the moved force, from that for the force itself."""
        return np.asarray(np.einsum("nk,nki->ni", self.weights, values[self.nodes]) @ self.motion.T)


def has_surface(body: object) -> bool:
    """Tell whether a body is one material and its own mirror image or turned one, which is what is made use of here."""
    return isinstance(body, Layered) and not body.regions


@stage("far field")
def tabulate_surface(mesh: BodyMesh, region: Region, poissons: tuple[float, float], origin: FloatArray) -> SurfaceTable:
    """Return the modes of the whole boundary, and by how much of the depth they may be off at places held out.

    Raises:
        SolveError: if R cannot be solved for.
    """
    low, high = poissons
    ratios = (low + high) / 2 + (high - low) / 2 * np.cos(pi * np.arange(_POISSONS) / (_POISSONS - 1))
    sources = _sources(region)
    solved = [_solve(mesh, region, sources, float(ratio)) for ratio in ratios]
    boundary = solved[0]
    images = [_image(boundary, motion) for motion in _motions(region)]
    places = np.array([image.motion[:2, :2] @ source for source in sources for image in images])
    fields = np.array([
        [image.of(values).ravel() for values in found.values for image in images] for found in solved
    ])  # fmt: skip
    rooms = np.array([region.room(x, y) for x, y in places])
    modes = _modes((fields * rooms[:, None]).reshape(-1, fields.shape[-1]))
    basis = _basis(region, places)
    amounts = np.array([np.linalg.lstsq(basis, found @ modes, rcond=None)[0] for found in fields])
    table = _table(region, boundary, modes, amounts, poissons, origin)
    return _judged(table, mesh, region, float(ratios.mean()))


def _solve(mesh: BodyMesh, region: Region, places: Sequence[Place], poisson: float) -> OnBoundary:
    """Return R (m/N, E = 1) for a force at each place."""
    forces = [PointForce(poisson, (x, y, 0.0), region.room(x, y)) for x, y in places]
    found = regular_on_boundary(mesh, forces)
    # Of a unit of the field, 4πμ times the radius newtons, and E = 2 (1 + ν) μ.
    scales = np.array([2 * (1 + poisson) / (4 * pi * force.radius) for force in forces])
    return OnBoundary(found.nodes, found.triangles, scales[:, None, None] * found.values)


def _sources(region: Region) -> list[Place]:
    """Return the places that are solved for: the others are their images."""
    x, y = (reach * np.cos(pi * np.arange(_SIZE + 1) / (2 * _SIZE)) for reach in region.reach)
    if region.is_round:
        return [(float(r), 0.0) for r in x]
    pairs = [(float(a), float(b)) for a, b in product(x, y)]
    return [(a, b) for a, b in pairs if a >= b] if _is_square(region) else pairs


def _is_square(region: Region) -> bool:
    return not region.is_round and region.sides[0] == region.sides[1]


def _motions(region: Region) -> list[FloatArray]:
    """Return the motions that map the body to itself and its sources to all places."""
    if region.is_round:
        angles = 2 * pi * np.arange(4 * _SIZE + 1) / (4 * _SIZE + 1)
        return [np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]]) for t in angles]
    signs = [np.diag([a, b, 1.0]) for a, b in product((1.0, -1.0), repeat=2)]
    swap = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
    return [*signs, *(sign @ swap for sign in signs)] if _is_square(region) else signs


def _image(boundary: OnBoundary, motion: FloatArray) -> Image:
    """Find where on the boundary every node comes from."""
    points, corners = boundary.nodes @ motion, boundary.nodes[boundary.triangles]
    _, near = cKDTree(corners[:, :3].mean(axis=1)).query(points, k=min(_NEAREST, len(corners)))
    tried = corners[near]
    across = np.stack([tried[:, :, 1] - tried[:, :, 0], tried[:, :, 2] - tried[:, :, 0]], axis=-1)
    inverse = np.linalg.pinv(across)
    local = np.einsum("nkij,nkj->nki", inverse, points[:, None] - tried[:, :, 0])
    for _ in range(_STEPS):
        reached = np.einsum("nka,nkai->nki", _quadratic(local), tried)
        local = local + np.einsum("nkij,nkj->nki", inverse, points[:, None] - reached)
    local = np.clip(local, 0, 1)
    local /= np.maximum(local.sum(axis=-1, keepdims=True), 1)
    weights = _quadratic(local)
    missed = np.linalg.norm(np.einsum("nka,nkai->nki", weights, tried) - points[:, None], axis=-1)
    best, rows = missed.argmin(axis=1), np.arange(len(points))
    return Image(motion, boundary.triangles[near[rows, best]], weights[rows, best])


def _quadratic(local: FloatArray) -> FloatArray:
    """Return the six functions of a triangle at the last two of its barycentric coordinates (..., 2)."""
    b, c = local[..., 0], local[..., 1]
    a = 1 - b - c
    ends = [a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1)]
    return np.stack([*ends, 4 * b * c, 4 * a * c, 4 * a * b], axis=-1)


def _modes(fields: FloatArray) -> FloatArray:
    """Return orthonormal modes (values, rank) of fields (fields, values), as many as the largest error takes."""
    powers, turned = np.linalg.eigh(fields @ fields.T)
    order = np.argsort(powers)[::-1]
    kept = order[powers[order] > 1e-14 * powers[order[0]]]
    modes = (fields.T @ turned[:, kept]) / np.sqrt(powers[kept])
    amounts, largest = fields @ modes, np.abs(fields).max()
    low, high = 1, len(kept)
    while low < high:
        rank = (low + high) // 2
        missed = np.abs(fields - amounts[:, :rank] @ modes[:, :rank].T).max()
        low, high = (low, rank) if missed <= _CUT * largest else (rank + 1, high)
    return np.asarray(modes[:, :low])


def _basis(region: Region, places: FloatArray) -> FloatArray:
    """Return T_j(y/Y) T_i(x/X) at places, (places, terms); of a round region those with i + j up to the degree."""
    x, y = (np.polynomial.chebyshev.chebvander(places[:, i] / region.reach[i], 2 * _SIZE) for i in range(2))
    terms = np.einsum("nj,ni->nji", y, x)
    if region.is_round:
        terms = terms * (np.add.outer(*2 * [np.arange(2 * _SIZE + 1)]) <= 2 * _SIZE)
    return np.asarray(terms.reshape(len(places), -1))


def _table(
    region: Region, boundary: OnBoundary, modes: FloatArray, amounts: FloatArray, poissons: tuple[float, float],
    origin: FloatArray,
) -> SurfaceTable:  # fmt: skip
    size, rank = 2 * _SIZE + 1, modes.shape[1]
    nodes = np.cos(pi * np.arange(_POISSONS) / (_POISSONS - 1))
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, _POISSONS - 1))
    coefficients = np.einsum("pq,qtr->rpt", inverse, amounts).reshape(rank, _POISSONS, size, size)
    units = np.abs(modes).max(axis=0) / _WHOLE
    quarters = boundary.triangles[:, _QUARTERS].reshape(-1, 3)
    whole = np.round(modes / units).astype(np.float32).reshape(-1, 3, rank)
    return SurfaceTable(
        (boundary.nodes - origin).astype(np.float32), quarters.astype(np.int32), whole,
        (coefficients * units[:, None, None, None]).astype(np.float32), 0.0, region.reach, poissons,
    )  # fmt: skip


def _judged(table: SurfaceTable, mesh: BodyMesh, region: Region, poisson: float) -> SurfaceTable:
    """Return the table with what it misses R × room by at places that it was not made of."""
    rng = np.random.default_rng(0)
    shares = rng.uniform(-1, 1, (_HELD_OUT, 2)) / (np.sqrt(2) if region.is_round else 1)
    places = [(float(x), float(y)) for x, y in shares * region.reach]
    found = _solve(mesh, region, places, poisson)
    missed = 0.0
    for (x, y), values in zip(places, found.values, strict=True):
        difference = table.far(x, y, poisson, 0.0) - values
        missed = max(missed, region.room(x, y) * float(np.linalg.norm(difference, axis=1).max()))
    return replace(table, error=missed)
