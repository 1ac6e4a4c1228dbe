"""Tissue that slides on tissue at large displacements: a mortar method between its surface and the one below.

A point x of the loose surface is above the point of the surface below from which the normal leads to it,

    x = Σ N_a(ξ) (y_a + t n_a),

with shape functions N_a of a facet, its nodes y_a, and their normals n_a, means of the facets around. These normals are
continuous, and so is ξ. Gaps of nodes, and displacements relative to the tissue below, are the differences to the
function on the loose surface that is nearest to what is below its points, in the mean square:

    D P = M,    D_ij = ∫ N_i N_j,    M_ia = ∫ N_i N_a(ξ).

Forces are handed on by the transpose of P, so that force and moment balance, and a uniform pressure stays one.
(B. I. Wohlmuth, SIAM J. Numer. Anal. 38, 989, 2000; M. A. Puso and T. A. Laursen, Comput. Methods Appl. Mech. Eng. 193,
601, 2004.)
"""

from dataclasses import dataclass
from functools import cached_property

import basix
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.solve.contact.normals import deformed_normals, within_planes
from epsmesh.solve.contact.numbering import Pairs
from epsmesh.solve.contact.surface import Candidates

# Degree of the integrals beyond that of products of shape functions: those of the other surface have kinks.
_KINKS = 12
# Newton's iterations within a facet, and its tolerance, in barycentric coordinates.
_MOST, _CLOSE = 12, 1e-12
# A point is on a facet to this rounding, in barycentric coordinates, and on the surface to that; most facets on a way.
_ON, _NEAR, _MOST_FACETS = 1e-9, 1e-6, 200
# Pressure below this share of the largest adds nothing to the tangent.
_NOTHING = 1e-6
# Barycentric coordinates outside the surface up to which its facets are extended.
_EXTENDED = 0.5


@dataclass(frozen=True, eq=False)
class Mortar:
    """What is below n nodes, of values at m nodes of the surface below: the operator P = D⁻¹ M."""

    mass: SuperLU
    mixed: sp.csr_matrix

    def below(self, values: FloatArray) -> FloatArray:
        """Return P times ``values`` (m, k)."""
        return np.asarray(self.mass.solve(self.mixed @ values))

    def hand_on(self, forces: FloatArray) -> FloatArray:
        """Return the transpose of P times ``forces`` (n, k)."""
        return np.asarray(self.mixed.T @ self.mass.solve(forces))

    def matrix(self) -> sp.csr_matrix:
        """Return P."""
        return sp.csr_matrix(self.mass.solve(self.mixed.toarray()))


@dataclass(frozen=True, eq=False)
class Meeting:
    """Where q points of loose tissue are above a surface of m nodes: ``shares`` (q, m) of these in the place below.

    ``slopes`` are the derivatives of the shares along two sides of the facets. ``beyond`` (q) is how far a point is
    beyond the edge of the surface, in heights of a facet, 1 at most. ``is_lost`` says that some have no place below.
    """

    shares: sp.csr_matrix
    slopes: tuple[sp.csr_matrix, ...]
    beyond: FloatArray
    is_lost: bool


class SlidingTissue:
    """Loose tissue with ``pairs`` at rest, which slides on the surface below its ``candidates``."""

    def __init__(self, pairs: Pairs, candidates: Candidates):
        self._at_rest, self._candidates = pairs, candidates
        self._ground, self._state = Ground(candidates), np.empty(0)

    def pairs(self, state: FloatArray) -> Pairs:
        """Return the pairs in a ``state`` (owned dofs of the displacement); collective."""
        places, pairs, ground = self._candidates.points, self._at_rest, self._ground
        upper, lower = (side.gather_vectors(state) for side in (pairs.upper, pairs.lower))
        now = np.stack([upper, lower])
        if now.shape != self._state.shape or not np.array_equal(now, self._state):
            self._normals = deformed_normals(self._candidates, places + lower, pairs.normal, pairs.free)
            self._meeting = ground.meet(places + upper, places + lower, self._normals)
            mortar = ground.mortar(self._meeting)
            self.offset = places - mortar.below(places)
            normals = within_planes(mortar.below(self._normals), pairs.free)
            self._now, self._state = pairs.meeting(mortar, normals), now
        return self._now

    @property
    def is_lost(self) -> bool:
        """Whether points have no place below in the last state, besides those beyond the edge."""
        return self._meeting.is_lost

    def overhang(self, forces: FloatArray) -> float:
        """Return the part (N) of normal ``forces`` (n), N, that acts beyond the edge of the surface below."""
        return float(np.abs(self._ground.pressures(forces)) @ self._meeting.beyond)

    def slipping(self, forces: FloatArray) -> "Slipping":
        """Return what slip adds to the tangent, with the normal ``forces`` (n), N, in the last state."""
        pressed = self._ground.pressures(forces)
        here = np.abs(pressed) > _NOTHING * np.abs(pressed).max(initial=0.0)
        pressed, own, below = pressed[here], self._ground.own[here], self._meeting.shares[here]
        across, x = [each[here] for each in self._meeting.slopes], self._candidates.points + self._state[1]
        normals = below @ self._normals
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        tangents, bent = (np.stack([slope @ each for slope in across], axis=1) for each in (x, self._normals))
        metric = np.linalg.inv(np.einsum("qai,qbi->qab", tangents, tangents))
        bent -= np.einsum("qai,qi->qa", bent, normals)[:, :, None] * normals[:, None]
        curvature = -np.einsum("qai,qbi->qab", bent, tangents)
        curvature = pressed[:, None, None] * (curvature + np.swapaxes(curvature, 1, 2)) / 2
        along = np.einsum("qab,qbi->qai", metric, tangents)
        return Slipping(self._now, own, below, across, along, pressed[:, None] * normals, curvature)


@dataclass(frozen=True, eq=False)
class Slipping:
    """How forces between ``pairs`` of tissues follow slip, a symmetric operator: with pressures λ, gaps g, and the
    coordinates ξ of the place below, that of −∫ λ δ²g,

        −δ²g = 2 n·∂_α δy δξ^α + κ_αβ δξ^α δξ^β

    (P. Wriggers, Computational Contact Mechanics, Springer 2006, for a small gap). ``own`` (q, n) and ``below`` (q, m)
    are the shape functions at points of both sides, ``across`` the derivatives of the second; ``along`` (q, 2, 3) makes
    δξ of relative displacements. ``normals`` (q, 3) are λ n, and ``curvature`` (q, 2, 2) is λ κ, with λ in N.
    """

    pairs: Pairs
    own: sp.csr_matrix
    below: sp.csr_matrix
    across: list[sp.csr_matrix]
    along: FloatArray
    normals: FloatArray
    curvature: FloatArray

    def add(self, given: FloatArray, into: FloatArray, scale: float) -> None:
        """Add ``scale`` times the product with a change ``given`` of displacements to forces ``into``; owned dofs."""
        sides = self.pairs.upper, self.pairs.lower
        moved = (side.gather_vectors(given[: 3 * side.owned]) for side in sides)
        for side, forces in zip(sides, self.product(*moved), strict=True):
            side.add_vectors(into, scale * forces)

    def product(self, upper: FloatArray, lower: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the forces (n, 3) and (m, 3), N, of displacements of both sides, m."""
        slips = np.einsum("qai,qi->qa", self.along, self.own @ upper - self.below @ lower)
        tilts = np.stack([np.einsum("qi,qi->q", self.normals, slope @ lower) for slope in self.across], axis=1)
        tilts += np.einsum("qab,qb->qa", self.curvature, slips)
        pushed = np.einsum("qai,qa->qi", self.along, tilts)
        turned = sum(slope.T @ (slips[:, [a]] * self.normals) for a, slope in enumerate(self.across))
        return self.own.T @ pushed, turned - self.below.T @ pushed


class Ground:
    """A surface of ``candidates``, on which points of another one walk from facet to facet.

    At rest both have the same places. ``own`` (q, n) are the shape functions at q points of the upper one.
    """

    def __init__(self, candidates: Candidates):
        self._facets, self._shape, self._candidates = candidates.facets, candidates.shape, candidates
        self._beside = _neighbours(candidates)
        rule, self._shares = basix.make_quadrature(basix.CellType.triangle, 2 * candidates.shape.degree + _KINKS)
        self._rule = np.column_stack([1 - rule.sum(axis=1), rule])
        self._first = np.repeat(np.arange(len(self._facets)), len(rule))
        values = np.tile(self._shape.values(self._rule), (len(self._facets), 1))
        self.own = _rows(values, self._facets[self._first], len(candidates))

    @cached_property
    def _weights(self) -> FloatArray:
        """The areas (q), m², of the points at rest."""
        x = self._candidates.points[self._facets]
        sides = [np.einsum("qk,mki->mqi", slope, x) for slope in self._shape.slopes(self._rule)]
        return np.asarray((self._shares * np.linalg.norm(np.cross(*sides), axis=2)).ravel())

    @cached_property
    def _mass(self) -> SuperLU:
        return splu((self.own.T @ sp.diags(self._weights) @ self.own).tocsc())

    def pressures(self, forces: FloatArray) -> FloatArray:
        """Return the forces (q), N, at the points, of the pressure with nodal ``forces`` (n), N."""
        return np.asarray(self._weights * (self.own @ self._mass.solve(forces)))

    def mortar(self, meeting: Meeting) -> Mortar:
        """Return what is below the nodes."""
        return Mortar(self._mass, (self.own.T @ sp.diags(self._weights) @ meeting.shares).tocsr())

    def meet(self, upper: FloatArray, y: FloatArray, normals: FloatArray) -> Meeting:
        """Return where points of tissue with nodes at ``upper`` (n, 3), m, are above the surface with nodes at ``y``
        (n, 3), m, and their ``normals`` (n, 3)."""
        x = np.asarray(self.own @ upper)
        facets, points = self._first.copy(), np.empty((len(x), 3))
        moving = np.arange(len(x))
        for _ in range(_MOST_FACETS):
            nodes = self._facets[facets[moving]]
            points[moving] = self._within(x[moving], y[nodes], normals[nodes])
            following = self._beside[facets[moving], points[moving].argmin(axis=1)]
            goes = (points[moving].min(axis=1) < -_ON) & (following >= 0)
            moving = moving[goes]
            if not len(moving):
                break
            facets[moving] = following[goes]
        points = np.maximum(points, -_EXTENDED)
        points /= points.sum(axis=1)[:, None]
        weights = (self._shape.values(points), *self._shape.slopes(points))
        shares, *slopes = (_rows(each, self._facets[facets], len(y)) for each in weights)
        away, along = np.cross(x - shares @ y, shares @ normals), np.cross(slopes[0] @ y, slopes[1] @ y)
        beside = np.linalg.norm(away, axis=1) / np.linalg.norm(along, axis=1) ** 0.5  # of a place that is not below
        is_lost = len(moving) > 0 or bool((beside[points.min(axis=1) >= -_ON] > _NEAR).any())
        beyond = np.maximum(-points.min(axis=1), beside)
        return Meeting(shares, tuple(slopes), np.minimum(np.where(beyond > _NEAR, beyond, 0.0), 1.0), is_lost)

    def _within(self, x: FloatArray, y: FloatArray, normals: FloatArray) -> FloatArray:
        """Return barycentric coordinates (k, 3) of points (k, 3) in facets with nodes ``y`` (k, ·, 3)."""
        points, above = np.full((len(x), 3), 1 / 3), np.zeros(len(x))
        for _ in range(_MOST):
            values, slopes = self._shape.values(points), self._shape.slopes(points)
            lifted = y + above[:, None, None] * normals
            left = np.einsum("ka,kai->ki", values, lifted) - x
            columns = [np.einsum("ka,kai->ki", slope, lifted) for slope in slopes]
            columns.append(np.einsum("ka,kai->ki", values, normals))
            step = np.linalg.solve(np.stack(columns, axis=2), left[:, :, None])[:, :, 0]
            step[:, :2] = np.clip(step[:, :2], -1.0, 1.0)
            points -= np.column_stack([-step[:, 0] - step[:, 1], step[:, 0], step[:, 1]])
            above -= step[:, 2]
            if np.abs(step[:, :2]).max(initial=0.0) < _CLOSE:
                break
        return points


def _rows(values: FloatArray, nodes: IntArray, count: int) -> sp.csr_matrix:
    """Return a matrix (q, count) with ``values`` (q, k) in the columns ``nodes`` (q, k)."""
    rows = np.repeat(np.arange(len(values)), values.shape[1])
    return sp.csr_matrix((values.ravel(), (rows, nodes.ravel())), (len(values), count))


def _neighbours(candidates: Candidates) -> IntArray:
    """Return the facets (m, 3) across the edges opposite to each corner, −1 where the surface ends."""
    corners = candidates.facets[:, :3]
    edges = np.sort(np.stack([corners[:, [1, 2]], corners[:, [2, 0]], corners[:, [0, 1]]], axis=1), axis=2)
    flat = edges.reshape(-1, 2)
    order = np.lexsort(flat.T)
    same = (flat[order][1:] == flat[order][:-1]).all(axis=1)
    found = np.full(len(flat), -1)
    one, other = order[:-1][same], order[1:][same]
    found[one], found[other] = other // 3, one // 3
    return found.reshape(-1, 3)
