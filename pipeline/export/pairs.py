"""Interaction of forces at two places of a flat face, as a few modes: ``epsmesh_realtime.table.Pairs``.

R, the regular part of the normal displacement at one Chebyshev node for a force at another, is a symmetric matrix up to
the mesh's error. A truncated singular value decomposition gives its range; the modes are polynomials through it.
"""

from dataclasses import replace
from math import pi

import numpy as np

from epsmesh_realtime.evaluator import MOST_MODES
from epsmesh_realtime.table import Pairs
from pipeline.arrays import FloatArray
from pipeline.export.far import FarFields, least_rank, located
from pipeline.stages import stage

# Largest number of the modes' coefficients: what a query can sum up in microseconds.
_MOST_TERMS = 16384
# Error of the truncation, in R times the distance to the nearest side.
_CUT = 1e-3
# A node is on the face if its distance, in units of the thickness, is at most this.
_ON_FACE = 1e-9


@stage("pairs")
def tabulate_pairs(far: FarFields) -> Pairs:
    """Return R between all places of a region, with its error, in units of the inverse distance to a side.

    The error is that for held-out forces, anywhere on the face, or half the asymmetry of R, whichever is larger.
    """
    ways = np.sqrt(far.rooms)
    weights = np.multiply.outer(ways, ways)
    solved = _between(far) * weights
    even = (solved + solved.transpose(0, 2, 1)) / 2
    range_of = _range(even, min(MOST_MODES, _MOST_TERMS // int(np.prod(far.degrees))))
    modes = np.linalg.lstsq(far.basis(), range_of / ways[:, None], rcond=None)[0].T.reshape(-1, *far.degrees)
    links = far.over_ratios(range_of.T @ even @ range_of)
    links = (links + links.transpose(0, 2, 1)) / 2
    region = far.body.region
    pairs = Pairs(modes, links, 0.0, _aside(far), region.reach, far.poissons)
    mesh = float(np.abs(solved - even).max())
    return replace(pairs, error=max(_missed(pairs, far), mesh))


def _between(far: FarFields) -> FloatArray:
    """Return the normal displacement of all places (rows) by a force at each (columns), less a half-space's.

    Shape (ν, n, n), in 1/m.
    """
    points = _on_face(far.places)
    maps = [located(far.solved[0], points @ motion) for motion in far.motions]
    sunk = [-found.values[: len(far.sources), :, 2] for found in far.solved]
    columns = [[(weights * of[nodes]).sum(axis=1) for of in each for nodes, weights in maps] for each in sunk]
    return np.array(columns).transpose(0, 2, 1)


def _range(even: FloatArray, most: int) -> FloatArray:
    """Return orthonormal columns (n, rank) that represent ``even`` (ν, n, n) up to ``_CUT``; at most ``most``."""
    found, _, _ = np.linalg.svd(np.concatenate(list(even), axis=1), full_matrices=False)

    def suffices(rank: int) -> bool:
        onto = found[:, :rank] @ found[:, :rank].T
        return bool(np.abs(onto @ even @ onto - even).max() <= _CUT)

    return np.asarray(found[:, : least_rank(min(most, found.shape[1]), suffices)])


def _missed(pairs: Pairs, far: FarFields) -> float:
    """Return the error of R times the root of both distances to a side, at nodes of the face, for held-out forces."""
    nodes, region = far.solved[far.middle].nodes, far.body.region
    inside = np.abs(nodes[:, 2]) <= _ON_FACE * region.thickness
    if region.is_round:
        inside &= np.hypot(nodes[:, 0], nodes[:, 1]) <= region.reach[0]
    else:
        inside &= (np.abs(nodes[:, :2]) <= region.reach).all(axis=1)
    on = [(float(x), float(y)) for x, y in nodes[inside, :2]]
    rooms = [np.sqrt([region.room(x, y) for x, y in places]) for places in (far.held_out, on)]
    tabulated = pairs.regular(far.held_out, on, float(far.ratios[far.middle]))
    return float(np.abs((tabulated + far.known[:, inside, 2]) * np.multiply.outer(*rooms)).max())


def _aside(far: FarFields) -> float:
    """Return the largest lateral displacement of a place by a unit force, times the distance to the force."""
    nodes, weights = located(far.solved[0], _on_face(far.places))
    largest = 0.0
    for found, poisson in zip(far.solved, far.ratios.tolist(), strict=True):
        towards = -(1 - 2 * poisson) * (1 + poisson) / (2 * pi)
        for source, values in zip(far.sources, found.values, strict=False):
            away = far.places - source
            square = (away**2).sum(axis=1)
            beside = square > 0
            moved = np.einsum("nk,nki->ni", weights, values[nodes, :2])[beside]
            moved += towards * away[beside] / square[beside, None]
            largest = max(largest, float((np.linalg.norm(moved, axis=1) * np.sqrt(square[beside])).max()))
    return largest


def _on_face(places: FloatArray) -> FloatArray:
    return np.column_stack([places, np.zeros(len(places))])
