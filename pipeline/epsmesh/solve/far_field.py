"""Far field of a tool on a plane face, coupled to a half ball that is cut out around the contact.

Far away a tool acts as a point force, up to terms of order a/r (bonded: it also pulls sideways) or (a/r)². One *unit*
of the far field is that of a force of 4πμε newtons a metre, with ε the radius of the half ball. It displaces the cut
face by about a metre. The body beyond the cut has one unknown, the amplitude of the far field, for which the
energy is stationary. The force is an upper bound: the neglected energy is of order (a/ε)³ (small, bonded) and (a/ε)⁵.

On a finite body the Green's function is the half-space's field u plus a regular part R, which is smooth at the force
(:mod:`epsmesh.solve.greens_function`) and stored as polynomials. Beyond a half sphere of radius ε, n outwards,

    twice the energy of u + R = that of u - 2 ∫ R·σ(u) n - R(0)·P - ∫ R·σ(R) n,

by Betti's theorem inside, where u has the force P and R has none.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import log, pi
from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import form
from epsmesh.solve.movement import Place

# Tolerances: no direction sideways below the centre, and a point at the centre, in units of the radius.
_TINY, _AT_CENTRE = 1e-14, 1e-9
# Highest degree of the polynomials for the regular part.
_POWER = 5
_EXPONENTS = np.array([e for e in product(range(_POWER + 1), repeat=3) if sum(e) <= _POWER])
# Quadrature points on the half sphere, from pole to rim and around it.
_UP, _ROUND = 16, 24


@dataclass(frozen=True)
class PointForce:
    """Half-space under a point force along -z at ``centre`` (J. Boussinesq, 1885), cut at ``radius`` (m) from it."""

    poisson: float
    centre: Place
    radius: float

    @property
    def ratio(self) -> float:
        """λ/μ of the half-space."""
        return 2 * self.poisson / (1 - 2 * self.poisson)

    @property
    def outward(self) -> Place:
        """The outward unit normal of the half-space."""
        return 0.0, 0.0, 1.0

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) of a unit, in m: ε/ρ times a function of the direction."""
        outward, distance = self._directions(points)
        cosine, softness = -outward[:, 2], 1 - 2 * self.poisson
        found = (cosine - softness / (1 + cosine))[:, None] * outward
        found[:, 2] = -(cosine**2 + 1 + softness)
        return self.radius / distance[:, None] * found

    def traction(self, points: FloatArray) -> FloatArray:
        """Return the traction (n, 3) of a unit on the half sphere through each point, in units of μ.

        It is σn with n pointing away from the centre.
        """
        outward, distance = self._directions(points)
        cosine = -outward[:, 2]
        found = ((1 - 2 * self.poisson) / (1 + cosine) - 3 * cosine)[:, None] * outward
        found[:, 2] = 3 * cosine**2
        return 2 * self.radius / distance[:, None] ** 2 * found

    def stress(self, points: FloatArray) -> FloatArray:
        """Return the stress (n, 3, 3) of a unit, in units of μ; zero at the centre itself."""
        offsets = points - np.array(self.centre)
        distance = np.linalg.norm(offsets, axis=1)
        away = distance > _AT_CENTRE * self.radius
        x, depth, r = offsets[away], -offsets[away, 2], distance[away]
        flat, across = x * (1, 1, 0), np.maximum(r**2 - depth**2, _TINY * r**2)
        share, softness = 1 / (r * (r + depth)), 1 - 2 * self.poisson
        found = np.zeros((len(points), 3, 3))
        found[away] = (-3 * depth / r**5)[:, None, None] * _outer(x)
        found[away] += (softness * (2 * share - depth / r**3) / across)[:, None, None] * _outer(flat)
        found[away] += (softness * (depth / r**3 - share))[:, None, None] * np.diag([1.0, 1.0, 0.0])
        return 2 * self.radius * found

    def stiffness(self, mu: float) -> float:
        """Return twice the strain energy (N/m) of a unit beyond the half ball: -∫ u·σn on its surface."""
        softness = 1 - 2 * self.poisson
        return 4 * pi * mu * self.radius * (2 + softness / 3 + softness**2 * (2 * log(2) - 1))

    def force(self, mu: float) -> float:
        """Return the force (N/m) of a unit."""
        return 4 * pi * mu * self.radius

    def moved(self, centre: Place) -> "PointForce":
        """Return the field of a force at another ``centre`` (m)."""
        return replace(self, centre=centre)

    def pull(self, space: Any, places: FloatArray) -> "Pull":
        """Return the boundary integrals of such stresses for the test functions of ``space``, points at ``places``."""
        return StressPull(space, places)

    def _directions(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (n, 3) from the centre, and distances (n), in m."""
        offsets = points - np.array(self.centre)
        distances = np.linalg.norm(offsets, axis=1)
        return offsets / distances[:, None], distances


class Pull(Protocol):
    """Boundary tractions of the half-space field of a point force."""

    def of(self, force: Any) -> FloatArray:
        """Return ∫ σn·v on the whole boundary, on all dofs of this process, in units of μ."""


class StressPull:
    """∫ σn·v on the whole boundary for a half-space's stress; the rows of σ are interpolated in a space."""

    def __init__(self, space: Any, places: FloatArray):
        self._rows, normal = [fem.Function(space) for _ in range(3)], ufl.FacetNormal(space.mesh)
        test = ufl.TestFunction(space)
        measure = ufl.ds(domain=space.mesh, metadata={"quadrature_degree": 2 * compat.degree(space) + 2})
        self._form = form(sum(ufl.inner(row, normal) * test[i] for i, row in enumerate(self._rows)) * measure)
        self._outer = np.unique(outer_triangles(compat.cell_dofs(space), places))
        self._points = places[self._outer]

    def of(self, force: PointForce) -> FloatArray:
        """Return the integral on all dofs, in units of μ."""
        for row, values in zip(self._rows, force.stress(self._points).transpose(1, 0, 2), strict=True):
            row.x.array.reshape(-1, 3)[self._outer] = values
        return np.asarray(fem.assemble_vector(self._form).array)


@dataclass(frozen=True, eq=False)
class Smooth:
    """A displacement as polynomials of (x - ``centre``) / ``unit``, whose ``coefficients`` are (terms, 3), in m."""

    centre: tuple[float, float, float]
    unit: float
    coefficients: FloatArray

    @staticmethod
    def fit(centre: tuple[float, float, float], unit: float, points: FloatArray, values: FloatArray) -> "Smooth":
        """Return the least-squares fit to ``values`` (n, 3) at ``points``.

        Raises:
            SolveError: if there are fewer points than coefficients.
        """
        if len(points) < len(_EXPONENTS):
            raise SolveError(f"the mesh is too coarse for the Green's function at {centre}: {len(points)} nodes there")
        found, *_ = np.linalg.lstsq(_terms((points - np.array(centre)) / unit), values, rcond=None)
        return Smooth(centre, unit, found)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3), in m."""
        return np.asarray(_terms((points - np.array(self.centre)) / self.unit) @ self.coefficients)

    def at_centre(self) -> tuple[FloatArray, FloatArray]:
        """Return the displacement (3,), in m, at the centre, and its ∂²/∂x² + ∂²/∂y² (3,), in 1/m."""
        places = {tuple(exponents): number for number, exponents in enumerate(_EXPONENTS.tolist())}
        flat, bent = places[0, 0, 0], [places[2, 0, 0], places[0, 2, 0]]
        return self.coefficients[flat], 2 * self.coefficients[bent].sum(axis=0) / self.unit**2

    def bends(self) -> tuple[FloatArray, FloatArray]:
        """Return (∂²/∂x² - ∂²/∂y²)/2 and ∂²/∂x∂y of the displacement at the centre, both (3,), in 1/m."""
        places = {tuple(exponents): number for number, exponents in enumerate(_EXPONENTS.tolist())}
        xx, yy, xy = (self.coefficients[places[powers]] for powers in ((2, 0, 0), (0, 2, 0), (1, 1, 0)))
        return (xx - yy) / self.unit**2, xy / self.unit**2

    def traction(self, points: FloatArray, normals: FloatArray, ratio: float) -> FloatArray:
        """Return σn (n, 3) in units of μ, for a ``ratio`` λ/μ."""
        local = (points - np.array(self.centre)) / self.unit
        gradient = np.stack([_terms(local, axis) @ self.coefficients for axis in range(3)], axis=-1) / self.unit
        strain = gradient + gradient.transpose(0, 2, 1)
        dilation = np.trace(gradient, axis1=1, axis2=2)
        return np.asarray(np.einsum("nij,nj->ni", strain, normals) + ratio * dilation[:, None] * normals)


@dataclass(frozen=True, eq=False)
class BodyField:
    """Far field of a body, per unit: the half-space field of a point force (``near``), plus the ``regular`` part."""

    near: PointForce
    regular: Smooth

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) of a unit, in m, within the half ball in which ``regular`` was fitted."""
        return self.near.at(points) + self._scale * self.regular.at(points)

    def stiffness(self, mu: float) -> float:
        """Return twice the strain energy (N/m) of a unit beyond the half ball."""
        return self.near.stiffness(mu) + mu * self._of_regular

    def moved(self, centre: Place) -> "BodyField":
        """Return the same field around another ``centre`` (m), as on the mesh of a half ball there."""
        return replace(self, near=self.near.moved(centre), regular=replace(self.regular, centre=centre))

    @property
    def _scale(self) -> float:
        return self.near.radius / self.regular.unit

    @cached_property
    def _of_regular(self) -> float:
        near, normals, weights = self.near, *_half_sphere()
        points = np.array(near.centre) + near.radius * normals
        weights = near.radius**2 * weights
        inside = self._scale * self.regular.at(points)
        pulled = self._scale * self.regular.traction(points, normals, near.ratio)
        ((_, _, up),) = self._scale * self.regular.at(np.array([near.centre]))
        mixed = weights @ (inside * near.traction(points)).sum(axis=1)
        return float(near.force(1.0) * up - 2 * mixed - weights @ (inside * pulled).sum(axis=1))


def _outer(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors[:, :, None] * vectors[:, None, :])


def _half_sphere() -> tuple[FloatArray, FloatArray]:
    """Return quadrature points (n, 3) and weights (n) on the lower unit half sphere."""
    nodes, weights = np.polynomial.legendre.leggauss(_UP)
    cosine, angle = np.meshgrid((nodes + 1) / 2, 2 * np.pi * (np.arange(_ROUND) + 0.5) / _ROUND, indexing="ij")
    sine = np.sqrt(1 - cosine**2)
    points = np.stack([sine * np.cos(angle), sine * np.sin(angle), -cosine], axis=-1).reshape(-1, 3)
    return points, np.repeat(weights / 2 * 2 * np.pi / _ROUND, _ROUND)


def _terms(local: FloatArray, axis: int | None = None) -> FloatArray:
    """Return the monomials (n, terms) at points (n, 3), or their derivatives along an ``axis``."""
    powers = local[:, :, None] ** np.arange(_POWER + 1)
    exponents, factor = _EXPONENTS, np.ones(len(_EXPONENTS))
    if axis is not None:
        factor = _EXPONENTS[:, axis]
        exponents = np.maximum(_EXPONENTS - (np.arange(3) == axis), 0)
    return np.asarray(factor * np.prod([powers[:, i, exponents[:, i]] for i in range(3)], axis=0))


def outer_triangles(cells: IntArray, places: FloatArray) -> IntArray:
    """Return the triangles (m, 6) on the boundary: those that belong to exactly one cell (k, 10)."""
    # basix numbers the edges of a tetrahedron by their corners i < j, the last pair first.
    middle = {pair: 4 + number for number, pair in enumerate([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])}
    faces = [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]
    columns = [[i, j, k, middle[j, k], middle[i, k], middle[i, j]] for i, j, k in faces]
    triangles = cells[:, columns].reshape(-1, 6)
    _, first, times = np.unique(np.sort(triangles[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    outer = first[times == 1]
    found = triangles[outer]
    a, b, c = (places[found[:, i]] for i in range(3))
    inner = places[np.take_along_axis(cells[outer // 4], (outer % 4)[:, None], axis=1)[:, 0]]
    turned = np.einsum("ni,ni->n", np.cross(b - a, c - a), inner - a) > 0
    found[turned] = found[turned][:, [0, 2, 1, 3, 5, 4]]
    return np.asarray(found)
