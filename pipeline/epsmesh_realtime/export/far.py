"""R, the regular part of the Green's function, on a body's boundary for forces all over a region of its face.

Both far tables of a model derive from it. R (m/N for E = 1) is solved for forces at the Chebyshev nodes of a quarter of
the region, or of a radius. Symmetry gives it for their images: reflections of a box, rotations of a round body.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from itertools import product
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve.far_field import PointForce
from epsmesh.solve.greens_function import OnBoundary, each_on_boundary
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.terms import AddedTerm
from epsmesh.stages import stage
from epsmesh_realtime.export.compliance import per_newton
from epsmesh_realtime.export.disc import Disc
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.region import Region
from epsmesh_realtime.export.tabulate import extrema, ratios_of

# Intervals from the middle to the end of the region; number of places held out for the test.
_SIZE, _HELD_OUT = 6, 4
# Nearest triangles searched for the one that contains a point; Newton steps on a curved triangle.
_NEAREST, _STEPS = 24, 6

Place = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A symmetry (3, 3) of the body, with the interpolation from its nodes to the moved nodes."""

    motion: FloatArray
    nodes: IntArray
    weights: FloatArray

    def of(self, values: FloatArray) -> FloatArray:
        """Return the field (n, 3) of the moved force, from that of the force itself."""
        return np.asarray(np.einsum("nk,nki->ni", self.weights, values[self.nodes]) @ self.motion.T)


@dataclass(frozen=True, eq=False)
class LoadedBody:
    """A meshed body with a ``region`` of its face, and the point ``force`` at a place for a Poisson's ratio.

    ``law`` gives the tissues in units of μ at the face, for its Poisson's ratio; None if there is one tissue. R is not
    tested within ``next`` (m) of a force. A node is on the face if its height differs by at most ``off`` (m). ``doubt``
    is the error of R by the mesh, times the distance to the nearest side or the bottom, beyond what tests show. Each of
    ``ranks`` has the whole mesh, and solves for some of the places. ``terms`` are capsules of its regions.
    """

    mesh: BodyMesh
    region: Region
    force: Callable[[Place, float], PointForce]
    law: Callable[[float], MaterialLaw | None] = lambda _: None
    next: float = 0.0
    off: float = 0.0
    doubt: float = 0.0
    ranks: Ranks = ALONE
    terms: tuple[AddedTerm, ...] = ()

    @cached_property
    def boundary(self) -> OnBoundary:
        """The boundary without forces. All ranks have the same mesh, and so the same numbers on it."""
        return OnBoundary.of(self.mesh)

    def solve(self, places: Sequence[Place], poisson: float) -> OnBoundary:
        """Return R (m/N, E = 1) for a force at each place; collective. What earlier exports have solved is read."""
        nodes = self.boundary.nodes

        def each(some: Sequence[Place]) -> Iterator[FloatArray]:
            forces = [self.force(place, poisson) for place in some]
            found = each_on_boundary(self.mesh, self.boundary, forces, self.law(poisson), self.terms)
            return (per_newton(force) * values for force, values in zip(forces, found, strict=True))

        # Meshes may differ from one export to the next.
        mesh = sha256(nodes.tobytes() + self.boundary.triangles.tobytes()).hexdigest()
        what = f"places solved for the surface, ν = {poisson:.3g}"
        values = self.ranks.keeping(places, each, what, (mesh, self.region, poisson))
        return replace(self.boundary, values=np.array(values))


@dataclass(frozen=True, eq=False)
class FarFields:
    """R of a ``body`` for a force at each of its ``sources``, for each of ``ratios`` within ``poissons``.

    ``solved`` has a field for each ratio. The middle one ends with the fields of forces ``held_out`` for the test.
    ``motions`` are the symmetries of the body; they map the sources to all ``places``, source by source.
    """

    body: LoadedBody
    poissons: tuple[float, float]
    ratios: FloatArray
    sources: list[Place]
    held_out: list[Place]
    solved: list[OnBoundary]
    motions: list[FloatArray]

    @cached_property
    def places(self) -> FloatArray:
        """The places (n, 2), in m, of forces with a known field."""
        return np.array([motion[:2, :2] @ source for source in self.sources for motion in self.motions])

    @property
    def rooms(self) -> FloatArray:
        """The distance (n,), in m, from each place to the nearest side or the bottom."""
        return np.array([self.body.region.room(x, y) for x, y in self.places])

    @property
    def middle(self) -> int:
        """The index of the ratio for which held-out places are solved."""
        return len(self.ratios) // 2

    @property
    def known(self) -> FloatArray:
        """R (held-out places, n, 3) on the boundary."""
        return self.solved[self.middle].values[len(self.sources) :]

    def basis(self) -> FloatArray:
        """Return T_j(y/Y) T_i(x/X) at the places (n, terms); for a round region i + j is at most the degree."""
        region = self.body.region
        x, y = (np.polynomial.chebyshev.chebvander(self.places[:, i] / region.reach[i], 2 * _SIZE) for i in range(2))
        terms = np.einsum("nj,ni->nji", y, x)
        if region.is_round:
            terms = terms * (np.add.outer(*2 * [np.arange(2 * _SIZE + 1)]) <= 2 * _SIZE)
        return np.asarray(terms.reshape(len(self.places), -1))

    @property
    def degrees(self) -> tuple[int, int]:
        """The number of polynomials of y and of x in the basis."""
        return 2 * _SIZE + 1, 2 * _SIZE + 1

    def over_ratios(self, values: FloatArray) -> FloatArray:
        """Return the Chebyshev coefficients over ν of ``values`` (ν, ...) at the ratios."""
        count = len(self.ratios)
        nodes = extrema(count - 1) if count > 1 else np.zeros(1)
        return np.tensordot(np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, count - 1)), values, 1)


@stage("far field")
def far_fields(body: LoadedBody, poissons: tuple[float, float]) -> FarFields:
    """Return R on the whole boundary, for a range of Poisson's ratios; collective.

    Raises:
        SolveError: if it cannot be solved for.
    """
    region, ratios = body.region, ratios_of(poissons)
    sources, held_out, middle = _sources(region), _held_out(region), len(ratios) // 2
    # Held-out places are solved with the others: the factorisation dominates the time.
    asked = [[*sources, *held_out] if number == middle else sources for number in range(len(ratios))]
    solved = [body.solve(places, float(ratio)) for places, ratio in zip(asked, ratios, strict=True)]
    return FarFields(body, poissons, ratios, sources, held_out, solved, _motions(region))


def _sources(region: Region) -> list[Place]:
    """Return the places to solve; all others are their images."""
    if region.is_round and not region.is_axial:
        return Disc(region.reach[0], region.even, 2 * _SIZE).places
    lines = [
        reach * extrema(2 * _SIZE)[: _SIZE + 1 if even else None]
        for reach, even in zip(region.reach, region.even, strict=True)
    ]
    if region.is_round:
        return [(float(r), 0.0) for r in lines[0]]
    pairs = [(float(a), float(b)) for a, b in product(*lines)]
    return [(a, b) for a, b in pairs if a >= b] if region.is_square else pairs


def _motions(region: Region) -> list[FloatArray]:
    """Return the symmetries of the body, which map its sources to all places."""
    if region.is_axial:
        angles = 2 * pi * np.arange(4 * _SIZE + 1) / (4 * _SIZE + 1)
        return [np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]]) for t in angles]
    x, y = ((1.0, -1.0) if even else (1.0,) for even in region.even)
    signs = [np.diag([a, b, 1.0]) for a, b in product(x, y)]
    swap = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]])
    return [*signs, *(sign @ swap for sign in signs)] if region.is_square else signs


def _held_out(region: Region) -> list[Place]:
    """Return random places for the test."""
    shares = np.random.default_rng(0).uniform(-1, 1, (_HELD_OUT, 2)) / (np.sqrt(2) if region.is_round else 1)
    return [(float(x), float(y)) for x, y in shares * region.reach]


def symmetry_of(boundary: OnBoundary, motion: FloatArray) -> Symmetry:
    """Return a symmetry with the point of the boundary that it maps to each node."""
    return Symmetry(motion, *located(boundary, boundary.nodes @ motion))


def located(boundary: OnBoundary, points: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return, for each of ``points`` (n, 3), the six nodes of its triangle and their weights."""
    corners = boundary.nodes[boundary.triangles]
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
    return boundary.triangles[near[rows, best]], weights[rows, best]


def least_rank(most: int, suffices: Callable[[int], bool]) -> int:
    """Return the least rank from 1 to ``most`` that ``suffices`` (then all larger ones do), or ``most``."""
    low, high = 1, most
    while low < high:
        rank = (low + high) // 2
        low, high = (low, rank) if suffices(rank) else (rank + 1, high)
    return low


def _quadratic(local: FloatArray) -> FloatArray:
    """Return the six shape functions of a triangle at barycentric coordinates 2 and 3 (..., 2)."""
    b, c = local[..., 0], local[..., 1]
    a = 1 - b - c
    ends = [a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1)]
    return np.stack([*ends, 4 * b * c, 4 * a * c, 4 * a * b], axis=-1)
