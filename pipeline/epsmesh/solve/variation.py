"""Stiffness that varies within regions: the energy at a place has a factor, the value of a field there.

E(x) is a modulus times a field s(x), and every energy is proportional to the modulus: the energy per volume is s(x)
times that of the law. Volume thereby counts as if it were s times as large, in every operator and form, at their
quadrature points. In mixed elements the pressure is s times that of the elements' dofs, which is λ₁ div u of the law
without a field. Elements of degree 1, whose strain is constant, need the means of cells alone.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import basix
import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve import SolveError

# The mean over a cell is that of equal parts, each with four points: exact for polynomials of degree 2. Parts are
# halved until the mean changes by less than this share of it, or so many times: 2,048 points a cell then.
_RESOLVED, _HALVINGS = 1e-3, 3
# Barycentric coordinates of the four points: one has the first weight, the others the second.
_NEAR, _APART = (5 + 3 * 5**0.5) / 20, (5 - 5**0.5) / 20
# A deviation of values in a cell, relative to their mean, up to which they are constant; the least value in a cell.
_CONSTANT, _LEAST = 1e-9, 0.05
# Points that are evaluated at once.
_CHUNK = 1_000_000
_CORNERS = 4
_AT_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
# For each mesh, the factors of the last variation.
KNOWN: WeakKeyDictionary[Any, dict["Variation", "Factors"]] = WeakKeyDictionary()


class Field(Protocol):
    """A field without unit on a body; hashable, and equal to another one of the same values."""

    @property
    def detail(self) -> float:
        """The size (m) of what is to be resolved, such as voxels; infinite if it is smooth."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values at ``points`` (n, 3), m, in coordinates of the body; NaN where there is none."""

    def refusal(self, point: FloatArray, value: float) -> str:
        """Return the message about a ``value`` that is not positive at a ``point`` (3), m."""


@dataclass(frozen=True, eq=False)
class Factors:
    """The factors of the energy of local cells, ghosts included.

    ``means`` (cells) are their means. They vary within cells of any rank if ``varies``. Relative to the mean,
    ``variances`` (cells) are those within cells, ``rests`` (cells) those of what elements do not resolve there: more
    than quadratic functions, or in cells of many details, than linear ones. ``corners`` (cells, 4) are the values of
    the linear fit at the corners of cells.
    """

    means: FloatArray
    varies: bool
    variances: FloatArray
    rests: FloatArray
    corners: FloatArray
    _at: Callable[[int], FloatArray]
    _known: dict[int, FloatArray] = field(default_factory=dict)

    @staticmethod
    def of_one_cell() -> "Factors":
        """Return factors that vary within one cell, on which forms are compiled."""

        def ones(degree: int) -> FloatArray:
            return np.ones((1, len(basix.make_quadrature(basix.CellType.tetrahedron, degree)[1])))

        return Factors(np.ones(1), True, np.zeros(1), np.zeros(1), np.ones((1, 4)), ones)

    @staticmethod
    def constant(means: FloatArray) -> "Factors":
        """Return factors that are constant on each cell."""
        none = np.zeros_like(means)
        return Factors(means, False, none, none, np.tile(means[:, None], _CORNERS), lambda _: means[:, None])

    def in_cells(self, degree: int) -> FloatArray:
        """Return the factors at the quadrature points of a ``degree``; their means alone where they do not vary."""
        return self.at_points(degree) if self.varies else self.means[:, None]

    def at_points(self, degree: int) -> FloatArray:
        """Return the factors at the quadrature points of a ``degree``, (cells, points); their mean is that of cells."""
        if degree not in self._known:
            self._known[degree] = self._at(degree)
        return self._known[degree]


@dataclass(frozen=True)
class Variation:
    """The field of each region of a mesh by number, None where the stiffness is constant.

    ``turn`` are the rows of the matrix that has rotated the body to the mesh; None if it has not been rotated.
    """

    fields: tuple[Field | None, ...]
    turn: tuple[tuple[float, ...], ...] | None = None

    def factors(self, body: BodyMesh) -> Factors:
        """Return the factors of the energy of cells; collective.

        Raises:
            SolveError: if a field has no positive value somewhere in its region.
        """
        known = KNOWN.get(body.mesh, {})
        if self not in known:
            known = KNOWN[body.mesh] = {self: self._factors(body)}
        return known[self]

    def _factors(self, body: BodyMesh) -> Factors:
        count, refusal = len(compat.geometry_dofs(body.mesh)), ""
        means, variances, rests, corners = np.ones(count), np.zeros(count), np.zeros(count), np.ones((count, 4))
        for values_of, cells, nodes in self._parts(body):
            *found, why = self._sampled(values_of, nodes)
            means[cells], variances[cells], rests[cells], corners[cells] = found
            refusal = refusal or why
        if refusals := [why for why in body.comm.allgather(refusal) if why]:
            raise SolveError(refusals[0])
        varies = bool(body.comm.allreduce(float(variances.max(initial=0.0)), op=MPI.MAX) > _CONSTANT**2)
        return Factors(means, varies, variances, rests, corners, lambda degree: self._at_points(body, means, degree))

    def _parts(self, body: BodyMesh) -> Iterator[tuple[Field, IntArray, FloatArray]]:
        """Yield each field with its local cells and their nodes (cells, n, 3)."""
        nodes = compat.geometry_dofs(body.mesh)
        regions = np.zeros(len(nodes), int) if body.regions is None else body.regions % len(self.fields)
        for number, one in enumerate(self.fields):
            if one is not None:
                cells = np.flatnonzero(regions == number)
                yield one, cells, body.shown[nodes[cells]]

    def _sampled(self, of: Field, nodes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, str]:
        """Return means over cells with these ``nodes``, variances, rests and corners, and a refusal."""
        halvings, refusal = _halvings(nodes, of.detail), ""
        is_fitted = halvings > 0
        means, variances, rests = np.ones(len(nodes)), np.zeros(len(nodes)), np.zeros(len(nodes))
        corners = np.ones((len(nodes), 4))
        for level in range(_HALVINGS + 1):
            for cells in _chunks(np.flatnonzero(halvings == level), level):
                values, weights, why = self._values(of, nodes[cells], _points(level))
                refusal = refusal or why
                found = (values * weights).sum(axis=1) / weights.sum(axis=1)
                if level < _HALVINGS and not refusal:
                    coarse = found
                    values, weights, _ = self._values(of, nodes[cells], _points(level + 1))
                    found = (values * weights).sum(axis=1) / weights.sum(axis=1)
                    halvings[cells[np.abs(coarse - found) > _RESOLVED * found]] = level + 1
                finest = level + 1 if level < _HALVINGS and not refusal else level
                means[cells], variances[cells] = found, values.var(axis=1) / found**2
                linear = (values - values @ _projection(finest, 1)).var(axis=1)
                quadratic = (values - values @ _projection(finest, 2)).var(axis=1)
                rests[cells] = np.where(is_fitted[cells], linear, quadratic) / found**2
                fit = values @ np.linalg.pinv(_functions(_points(finest), 1)).T @ _functions(_AT_CORNERS, 1).T
                corners[cells] = np.maximum(fit, _LEAST * found[:, None])
        return means, variances, rests, corners, refusal

    def _at_points(self, body: BodyMesh, means: FloatArray, degree: int) -> FloatArray:
        """Return the factors at quadrature points: of the field, or of its linear fit in cells of many details."""
        at = np.asarray(basix.make_quadrature(basix.CellType.tetrahedron, degree)[0])
        found = np.repeat(means[:, None], len(at), axis=1)
        for values_of, within, nodes in self._parts(body):
            halvings = _halvings(nodes, values_of.detail)
            for level in range(_HALVINGS + 1):
                for cells in _chunks(np.flatnonzero(halvings == level), level):
                    mean, points = means[within[cells], None], at if level == 0 else _points(level)
                    values, weights, _ = self._values(values_of, nodes[cells], points)
                    if level > 0:
                        values = values @ np.linalg.pinv(_functions(points, 1)).T @ _functions(at, 1).T
                        _, weights = _places(nodes[cells], at)
                    values = np.maximum(np.where(np.isfinite(values), values, mean), _LEAST * mean)
                    signed = weights * np.asarray(basix.make_quadrature(basix.CellType.tetrahedron, degree)[1])
                    found[within[cells]] = (
                        values * mean * signed.sum(axis=1, keepdims=True) / (values * signed).sum(axis=1, keepdims=True)
                    )
        return found

    def _values(self, of: Field, nodes: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray, str]:
        """Return values at reference points ``at`` (q, 3) of cells, |dx/dX| there, (cells, q), and a refusal."""
        points, weights = _places(nodes, at)
        if self.turn is not None:
            points = points @ np.array(self.turn)
        points = points.reshape(-1, 3)
        try:
            values = of.at(points)
        except SolveError as error:  # which other ranks may not have
            return np.ones_like(weights), weights, str(error)
        is_wrong, why = ~(values > 0) | ~np.isfinite(values), ""
        if is_wrong.any():
            first = int(is_wrong.argmax())
            why = of.refusal(points[first], float(values[first]))
            values = np.where(is_wrong, 1.0, values)
        return values.reshape(weights.shape), weights, why


@cache
def _projection(level: int, degree: int) -> FloatArray:
    functions = _functions(_points(level), degree)
    return np.asarray(functions @ np.linalg.pinv(functions)).T


def _functions(at: FloatArray, degree: int) -> FloatArray:
    """Return the values (q, functions) of the polynomials of a degree, 1 or 2, at reference points."""
    x, y, z = at.T
    linear = [np.ones(len(at)), x, y, z]
    return np.column_stack([*linear, x * x, y * y, z * z, x * y, y * z, z * x] if degree > 1 else linear)


def _halvings(nodes: FloatArray, detail: float) -> IntArray:
    """Return how often to halve cells until the distance of points is the size of details."""
    corners = nodes[:, :_CORNERS]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2), initial=0.0)
    with np.errstate(divide="ignore"):
        needed = np.ceil(np.log2(longest / (2 * detail)))
    return np.clip(needed, 0, _HALVINGS).astype(int)


def _chunks(cells: IntArray, level: int) -> Iterator[IntArray]:
    size = max(1, _CHUNK // (4 * 8 ** min(level + 1, _HALVINGS)))
    return (cells[start : start + size] for start in range(0, len(cells), size))


def places(nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return 32 places (cells, q, 3) of equal shares of cells with these ``nodes`` (cells, n, 3), and |dx/dX| there."""
    return _places(nodes, _points(1))


def _places(nodes: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (cells, q, 3) of reference points ``at`` (q, 3) of cells with these ``nodes``, and |dx/dX|."""
    degree = 1 if nodes.shape[1] == _CORNERS else 2
    table = compat.reference_element(degree).tabulate(1, at)[:, :, :, 0]
    points = np.einsum("qi,cir->cqr", table[0], nodes)
    jacobian = np.einsum("aqi,cir->cqra", table[1:4], nodes)
    return points, np.abs(np.linalg.det(jacobian))


@cache
def _points(level: int) -> FloatArray:
    """Return the points (q, 3) on the reference cell, halved ``level`` times into equal parts."""
    parts = np.vstack([np.zeros(3), np.eye(3)])[None]
    for _ in range(level):
        parts = np.concatenate([_halved(part) for part in parts])
    weights = np.full((4, 4), _APART) + np.diag(np.full(4, _NEAR - _APART))
    return np.einsum("qi,pir->pqr", weights, parts).reshape(-1, 3)


def _halved(corners: FloatArray) -> FloatArray:
    """Return the eight parts of equal volume (8, 4, 3) of a tetrahedron."""
    a, b, c, d = corners
    ab, ac, ad, bc, bd, cd = ((x + y) / 2 for x, y in ((a, b), (a, c), (a, d), (b, c), (b, d), (c, d)))
    ends = [(a, ab, ac, ad), (ab, b, bc, bd), (ac, bc, c, cd), (ad, bd, cd, d)]
    inner = [(ab, ac, ad, bd), (ab, ac, bc, bd), (ac, ad, bd, cd), (ac, bc, bd, cd)]
    return np.array([*ends, *inner])
