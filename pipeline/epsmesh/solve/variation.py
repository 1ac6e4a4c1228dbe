"""Stiffness that varies within regions: the energy of each cell has a factor, the mean of a field over the cell.

E(x) is a modulus times a field s(x), and every energy is proportional to the modulus: each cell's energy is s̄ times
that of the law. Cells thereby count as if their volume were s̄ times as large, in every operator and form. In mixed
elements the pressure is s̄ times that of the elements' dofs, which is λ₁ div u of the law without a field.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve import SolveError

# The mean over a cell is that of equal parts, each with four points: exact for polynomials of degree 2. Parts are
# halved until the mean changes by less than this share of it, or so many times: 2,048 points a cell then.
_RESOLVED, _HALVINGS = 1e-3, 3
# Barycentric coordinates of the four points: one has the first weight, the others the second.
_NEAR, _APART = (5 + 3 * 5**0.5) / 20, (5 - 5**0.5) / 20
# Points that are evaluated at once.
_CHUNK = 1_000_000
_CORNERS = 4
# For each mesh, the factors of variations.
_known: WeakKeyDictionary[Any, dict["Variation", FloatArray]] = WeakKeyDictionary()


class Field(Protocol):
    """A field without unit on a body; hashable, and equal to another one of the same values."""

    @property
    def detail(self) -> float:
        """The size (m) of what is to be resolved, such as voxels; infinite if it is smooth."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values at ``points`` (n, 3), m, in coordinates of the body; NaN where there is none."""

    def refusal(self, point: FloatArray, value: float) -> str:
        """Return the message about a ``value`` that is not positive at a ``point`` (3), m."""


@dataclass(frozen=True)
class Variation:
    """The field of each region of a mesh by number, None where the stiffness is constant.

    ``turn`` are the rows of the matrix that has rotated the body to the mesh; None if it has not been rotated.
    """

    fields: tuple[Field | None, ...]
    turn: tuple[tuple[float, ...], ...] | None = None

    def factors(self, body: BodyMesh) -> FloatArray:
        """Return the factor of the energy of each local cell, ghosts included; collective.

        Raises:
            SolveError: if a field has no positive value somewhere in its region.
        """
        known = _known.setdefault(body.mesh, {})
        if self not in known:
            known[self] = self._factors(body)
        return known[self]

    def _factors(self, body: BodyMesh) -> FloatArray:
        nodes = compat.geometry_dofs(body.mesh)
        found, refusal = np.ones(len(nodes)), ""
        regions = np.zeros(len(nodes), int) if body.regions is None else body.regions % len(self.fields)
        for number, field in enumerate(self.fields):
            if field is not None:
                cells = np.flatnonzero(regions == number)
                found[cells], why = self._means(field, np.asarray(body.mesh.geometry.x)[nodes[cells]])
                refusal = refusal or why
        if refusals := [why for why in body.comm.allgather(refusal) if why]:
            raise SolveError(refusals[0])
        return found

    def _means(self, field: Field, nodes: FloatArray) -> tuple[FloatArray, str]:
        """Return the means of a field over cells with these ``nodes`` (cells, n, 3), and why it has none, or ""."""
        halvings = _halvings(nodes, field.detail)
        found, refusal = np.ones(len(nodes)), ""
        for level in range(_HALVINGS + 1):
            for cells in _chunks(np.flatnonzero(halvings == level), level):
                means, why = self._mean(field, nodes[cells], level)
                refusal = refusal or why
                is_rough = np.zeros(len(cells), bool)
                if level < _HALVINGS and not refusal:
                    finer, _ = self._mean(field, nodes[cells], level + 1)
                    is_rough, means = np.abs(finer - means) > _RESOLVED * finer, finer
                found[cells], halvings[cells[is_rough]] = means, level + 1
        return found, refusal

    def _mean(self, field: Field, nodes: FloatArray, level: int) -> tuple[FloatArray, str]:
        points, weights = _places(nodes, level)
        if self.turn is not None:
            points = points @ np.array(self.turn)
        try:
            values = field.at(points.reshape(-1, 3))
        except SolveError as error:  # which other ranks may not have
            return np.ones(len(nodes)), str(error)
        is_wrong = ~(values > 0) | ~np.isfinite(values)
        if is_wrong.any():
            first = int(is_wrong.argmax())
            return np.ones(len(nodes)), field.refusal(points.reshape(-1, 3)[first], float(values[first]))
        return (values.reshape(weights.shape) * weights).sum(axis=1) / weights.sum(axis=1), ""


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


def _places(nodes: FloatArray, level: int) -> tuple[FloatArray, FloatArray]:
    """Return points (cells, q, 3) and their weights (cells, q) of cells with these ``nodes`` (cells, n, 3)."""
    degree = 1 if nodes.shape[1] == _CORNERS else 2
    table = compat.reference_element(degree).tabulate(1, _points(level))[:, :, :, 0]
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
