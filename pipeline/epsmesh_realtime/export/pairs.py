"""Interaction of forces at two places of a face, as a few modes: ``epsmesh_realtime.table.Pairs``.

R, the regular part of the normal displacement at one Chebyshev node for a force at another, is a symmetric matrix up to
the mesh's error. A truncated singular value decomposition gives its range; the modes are polynomials through it.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import pi

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve.far_field import PointForce
from epsmesh.stages import stage
from epsmesh_realtime.evaluator import MOST_MODES
from epsmesh_realtime.export.compliance import per_newton
from epsmesh_realtime.export.far import FarFields, least_rank, located
from epsmesh_realtime.table import Pairs

# Largest number of the modes' coefficients: what a query can sum up in microseconds.
_MOST_TERMS = 16384
# Error of the truncation, in R times the distance to the nearest side.
_CUT = 1e-3
# A place is at a force within this distance, in units of that to the nearest side or the bottom.
_AT_FORCE = 1e-9


@stage("pairs")
def tabulate_pairs(far: FarFields) -> Pairs:
    """Return R between all places of a region, with its error, in units of the inverse distance to a side.

    The error is that for held-out forces, anywhere on the face, or half the asymmetry of R, whichever is larger; and
    on a curved face that of the mesh.
    """
    ways = np.sqrt(far.rooms)
    weights = np.multiply.outer(ways, ways)
    solved = _between(far) * weights
    even = (solved + solved.transpose(0, 2, 1)) / 2
    apart = np.linalg.norm(far.places[:, None] - far.places, axis=2)
    range_of = _range(even, min(MOST_MODES, _MOST_TERMS // int(np.prod(far.degrees))), apart >= far.body.next)
    modes = np.linalg.lstsq(far.basis(), range_of / ways[:, None], rcond=None)[0].T.reshape(-1, *far.degrees)
    links = far.over_ratios(range_of.T @ even @ range_of)
    links = (links + links.transpose(0, 2, 1)) / 2
    region = far.body.region
    pairs = Pairs(modes, links, 0.0, _aside(far), region.reach, far.poissons)
    mesh = float(np.abs(solved - even)[:, apart >= far.body.next].max())
    return replace(pairs, error=max(_missed(pairs, far), mesh) + far.body.doubt)


def _between(far: FarFields) -> FloatArray:
    """Return the normal displacement of all places (rows) by a force at each (columns), less a half-space's.

    Shape (ν, n, n), in 1/m.
    """
    forces = _forces(far, far.places, far.middle)
    points, normals = _face(forces)
    maps = [(*located(far.solved[0], points @ motion), normals @ motion) for motion in far.motions]
    columns = [
        [
            -np.einsum("nk,nki,ni->n", weights, of[nodes], turned)
            for of in found.values[: len(far.sources)]
            for nodes, weights, turned in maps
        ]
        for found in far.solved
    ]
    bent = [[_bent(force, points, normals) for force in _forces(far, far.places, n)] for n in range(len(far.ratios))]
    return np.array(columns).transpose(0, 2, 1) + np.array(bent).transpose(0, 2, 1)


def _forces(far: FarFields, places: FloatArray, ratio: int) -> list[PointForce]:
    poisson = float(far.ratios[ratio])
    return [far.body.force((float(x), float(y)), poisson) for x, y in places]


def _face(forces: Sequence[PointForce]) -> tuple[FloatArray, FloatArray]:
    """Return the points (n, 3) of forces, in m, and the outward normals there."""
    return np.array([force.centre for force in forces]), np.array([force.outward for force in forces])


def _bent(force: PointForce, points: FloatArray, normals: FloatArray) -> FloatArray:
    """Return how much more (n,), in 1/m, the half-space that touches at a force sinks points of a curved face.

    More than (1 - ν²)/(π r) at the chord r, along their own normals; 0 at the force.
    """
    apart = np.linalg.norm(points - np.array(force.centre), axis=1)
    found, away = np.zeros(len(points)), apart > _AT_FORCE * force.radius
    sunk = -per_newton(force) * np.einsum("ni,ni->n", force.at(points[away]), normals[away])
    found[away] = sunk - (1 - force.poisson**2) / (pi * apart[away])
    return found


def _range(even: FloatArray, most: int, tested: BoolArray) -> FloatArray:
    """Return orthonormal columns (n, rank), at most ``most``, that represent ``even`` (ν, n, n) up to ``_CUT``.

    Only entries ``tested`` (n, n) count.
    """
    found, _, _ = np.linalg.svd(np.concatenate(list(even), axis=1), full_matrices=False)

    def suffices(rank: int) -> bool:
        onto = found[:, :rank] @ found[:, :rank].T
        return bool(np.abs(onto @ even @ onto - even)[:, tested].max() <= _CUT)

    return np.asarray(found[:, : least_rank(min(most, found.shape[1]), suffices)])


def _missed(pairs: Pairs, far: FarFields) -> float:
    """Return the error of R times the root of both distances to a side, at nodes of the face, for held-out forces."""
    body, nodes = far.body, far.solved[far.middle].nodes
    middle = np.array(body.force((0.0, 0.0), float(far.ratios[far.middle])).centre[:2])
    across, reach = nodes[:, :2] - middle, np.array(body.region.reach)
    inside = (np.hypot(*across.T) <= reach[0]) if body.region.is_round else (np.abs(across) <= reach).all(axis=1)
    found = np.flatnonzero(inside)
    points, normals = _face(_forces(far, across[found], far.middle))
    on = np.abs(nodes[found, 2] - points[:, 2]) <= body.off
    found, normals = found[on], normals[on]
    forces = _forces(far, np.array(far.held_out), far.middle)
    apart = np.linalg.norm(nodes[found] - _face(forces)[0][:, None], axis=2)
    known = np.array([_bent(force, nodes[found], normals) for force in forces])
    known -= np.einsum("kni,ni->kn", far.known[:, found], normals)
    places = [(float(x), float(y)) for x, y in across[found]]
    rooms = [np.sqrt([body.region.room(*place) for place in some]) for some in (far.held_out, places)]
    tabulated = pairs.regular(far.held_out, places, float(far.ratios[far.middle]))
    return float((np.abs(tabulated - known) * np.multiply.outer(*rooms))[apart >= body.next].max())


def _aside(far: FarFields) -> float:
    """Return the largest lateral displacement of a place by a unit force, times the distance to the force."""
    points, normals = _face(_forces(far, far.places, far.middle))
    nodes, weights = located(far.solved[0], points)
    largest = 0.0
    for number, found in enumerate(far.solved):
        for force, values in zip(_forces(far, np.array(far.sources), number), found.values, strict=False):
            apart = np.linalg.norm(points - np.array(force.centre), axis=1)
            beside = apart > max(_AT_FORCE * force.radius, far.body.next)
            moved = np.einsum("nk,nki->ni", weights, values[nodes])[beside]
            moved += per_newton(force) * force.at(points[beside])
            moved -= np.einsum("ni,ni->n", moved, normals[beside])[:, None] * normals[beside]
            largest = max(largest, float((np.linalg.norm(moved, axis=1) * apart[beside]).max()))
    return largest
