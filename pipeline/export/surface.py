"""The far field of a model's visible surface: R on the boundary for a force anywhere in the region, as a few modes.

R (m/N for E = 1) is solved for at Chebyshev places of a quarter of the region, or of a radius, and carried to their
images: mirror images of a box, turned ones of a round body. What remains is of low rank: modes on the boundary, whose
amounts are polynomials of the place and of ν.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import FloatArray, IntArray
from pipeline.export.ranks import ALONE, Ranks
from pipeline.export.region import Region
from pipeline.mesh.distribute import BodyMesh
from pipeline.realtime.surface import SurfaceTable
from pipeline.solve.far_field import PointForce
from pipeline.solve.material import MaterialLaw
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


@dataclass(frozen=True, eq=False)
class Pressed:
    """A meshed body whose ``region`` of the face is pressed on, and the forces that do so, of a Poisson's ratio.

    ``law`` tells the tissues in units of μ at the face, where they are several, for its Poisson's ratio. R is not
    judged ``next`` (m) to a force. Each of ``ranks`` has the whole mesh, and solves for some of the places.
    """

    mesh: BodyMesh
    region: Region
    force: Callable[[Place, float], PointForce]
    law: Callable[[float], MaterialLaw | None] = lambda _: None
    next: float = 0.0
    ranks: Ranks = ALONE

    def solve(self, places: Sequence[Place], poisson: float) -> OnBoundary:
        """Return R (m/N, E = 1) for a force at each place; collective."""
        # All ranks number the boundary alike: their meshes are one.
        boundary: list[OnBoundary] = []

        def solve(some: Sequence[Place]) -> list[FloatArray]:
            forces = [self.force(place, poisson) for place in some]
            boundary.append(regular_on_boundary(self.mesh, forces, self.law(poisson)))
            # Of a unit of the field, 4πμ times the radius newtons, and E = 2 (1 + ν) μ.
            scales = np.array([2 * (1 + poisson) / (4 * pi * force.radius) for force in forces])
            return list(scales[:, None, None] * boundary[0].values)

        values = np.array(self.ranks.together(places, solve))
        # The first rank has a share of whatever there is.
        return replace(self.ranks.on_first(lambda: boundary[0]), values=values)


@stage("far field")
def tabulate_surface(body: Pressed, poissons: tuple[float, float], origin: FloatArray) -> SurfaceTable:
    """Return the modes of the whole boundary, and by how much of the depth they may be off at places held out.

    Raises:
        SolveError: if R cannot be solved for.
    """
    region, (low, high) = body.region, poissons
    ratios = (low + high) / 2 + (high - low) / 2 * (_ends(_POISSONS - 1) if low < high else np.zeros(1))
    sources, held_out, middle = _sources(region), _held_out(region), len(ratios) // 2
    # Places held out are solved for with the others: a factorisation takes much longer than what it serves for.
    asked = [[*sources, *held_out] if number == middle else sources for number in range(len(ratios))]
    solved = [body.solve(places, float(ratio)) for places, ratio in zip(asked, ratios, strict=True)]
    boundary = solved[0]
    images = [_image(boundary, motion) for motion in _motions(region)]
    places = np.array([image.motion[:2, :2] @ source for source in sources for image in images])
    fields = np.array([
        [image.of(values).ravel() for values in found.values[: len(sources)] for image in images] for found in solved
    ])  # fmt: skip
    rooms = np.array([region.room(x, y) for x, y in places])
    modes = _modes((fields * rooms[:, None]).reshape(-1, fields.shape[-1]))
    basis = _basis(region, places)
    amounts = np.array([np.linalg.lstsq(basis, found @ modes, rcond=None)[0] for found in fields])
    table = _table(region, boundary, modes, amounts, poissons, origin)
    known = replace(boundary, values=solved[middle].values[len(sources) :])
    return _judged(table, body, float(ratios[middle]), held_out, known)


def _sources(region: Region) -> list[Place]:
    """Return the places that are solved for: the others are their images."""
    lines = [
        reach * _ends(2 * _SIZE)[: _SIZE + 1 if even else None]
        for reach, even in zip(region.reach, region.even, strict=True)
    ]
    if region.is_round:
        return [(float(r), 0.0) for r in lines[0]]
    pairs = [(float(a), float(b)) for a, b in product(*lines)]
    return [(a, b) for a, b in pairs if a >= b] if region.is_square else pairs


def _ends(size: int) -> FloatArray:
    """Return the extrema of T_size, from 1 to -1."""
    return np.asarray(np.cos(pi * np.arange(size + 1) / size))


def _motions(region: Region) -> list[FloatArray]:
    """Return the motions that map the body to itself and its sources to all places."""
    if region.is_round:
        angles = 2 * pi * np.arange(4 * _SIZE + 1) / (4 * _SIZE + 1)
        return [np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]]) for t in angles]
    x, y = ((1.0, -1.0) if even else (1.0,) for even in region.even)
    signs = [np.diag([a, b, 1.0]) for a, b in product(x, y)]
    swap = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
    return [*signs, *(sign @ swap for sign in signs)] if region.is_square else signs


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
    size, rank, count = 2 * _SIZE + 1, modes.shape[1], len(amounts)
    nodes = _ends(count - 1) if count > 1 else np.zeros(1)
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, count - 1))
    coefficients = np.einsum("pq,qtr->rpt", inverse, amounts).reshape(rank, count, size, size)
    units = np.abs(modes).max(axis=0) / _WHOLE
    quarters = boundary.triangles[:, _QUARTERS].reshape(-1, 3)
    whole = np.round(modes / units).astype(np.float32).reshape(-1, 3, rank)
    return SurfaceTable(
        (boundary.nodes - origin).astype(np.float32), quarters.astype(np.int32), whole,
        (coefficients * units[:, None, None, None]).astype(np.float32), 0.0, region.reach, poissons,
    )  # fmt: skip


def _held_out(region: Region) -> list[Place]:
    """Return places that no table is made of."""
    shares = np.random.default_rng(0).uniform(-1, 1, (_HELD_OUT, 2)) / (np.sqrt(2) if region.is_round else 1)
    return [(float(x), float(y)) for x, y in shares * region.reach]


def _judged(
    table: SurfaceTable, body: Pressed, poisson: float, places: list[Place], known: OnBoundary
) -> SurfaceTable:  # fmt: skip
    """Return the table with what it misses R × room by at ``places`` that it was not made of, where R is ``known``."""
    missed = 0.0
    for (x, y), values in zip(places, known.values, strict=True):
        centre = np.array(body.force((x, y), poisson).centre)
        clear = np.linalg.norm(known.nodes - centre, axis=1) >= body.next
        difference = (table.far(x, y, poisson) - values)[clear]
        missed = max(missed, body.region.room(x, y) * float(np.linalg.norm(difference, axis=1).max()))
    return replace(table, error=missed)
