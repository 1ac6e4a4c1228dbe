"""What random fields of the moduli do to the force, by its influence.

To first order in ln E, ln F changes by the integral of the influence s times the change of ln E. Its variance is the
sum over tissues of σ² ∫∫ s(x) s(y) ρ(x − y) dx dy, where σ is the standard deviation of ln E, and ρ its correlation. A
field is not symmetric where the scene is: both integrals are over the whole body, with the images of its modelled part.

Cells are gathered into clusters, each a Gaussian that has the integral of s in it, its centre and its extent. Matérn's
correlation is a sum of Gaussians, too, and the double integral of one over two clusters is known.

The mean of ln E is σ²/2 below the logarithm of E's mean. To first order the mean of ln F is lower by that times the
share of F. Where a field varies within what decides F, stiff places bear soft ones beside them, and it is lower by
less: by an empirical share of the variance that is averaged out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import gamma, hypot, nan, sqrt

import numpy as np
from mpi4py import MPI

from epsmesh import compat, fitted
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.tissue import Spread
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.points.state import State
from epsmesh.solve.variation import places

# ρ(r) = (1 + √3 r/l) exp(−√3 r/l) is the mean of exp(−3 r²/(4 t l²)) over t with a Gamma distribution of this shape:
# a sum over equal steps of ln t between two ends.
_SHAPE, _ENDS, _STEPS = 1.5, (-7.0, 3.0), 14
# Boxes are halved until their size is this share of the correlation length, or until the share of F in them times the
# square of their size in correlation lengths is below the tolerance.
_FINEST, _TOLERANCE, _HALVINGS = 0.2, 5e-4, 20
# Clusters whose distances to all others are computed at once; cells whose extents are.
_ROWS, _CHUNK = 256, 20_000


@dataclass(frozen=True)
class Sources:
    """Parts of the influence: ``shares`` of F (n, k), their ``centres`` (n, 3), m, and variances along an axis (n), m².

    Of k kinds, the first decides which parts are gathered, and where.
    """

    shares: FloatArray
    centres: FloatArray
    variances: FloatArray

    def of(self, which: IntArray) -> "Sources":
        """Return some of them."""
        return Sources(self.shares[which], self.centres[which], self.variances[which])

    def gathered(self, numbers: IntArray) -> "Sources":
        """Return one source for each number from 0 on, with the integral, the centre and the extent of its parts."""
        sizes = np.abs(self.shares[:, 0]) + np.finfo(float).tiny
        whole = np.bincount(numbers, sizes)
        centres = np.column_stack([np.bincount(numbers, sizes * x) for x in self.centres.T]) / whole[:, None]
        apart = ((self.centres - centres[numbers]) ** 2).sum(axis=1) / 3
        variances = np.bincount(numbers, sizes * (self.variances + apart)) / whole
        return Sources(np.column_stack([np.bincount(numbers, one) for one in self.shares.T]), centres, variances)


@dataclass(frozen=True)
class Logarithm:
    """ln F of random fields, relative to F without: its mean, its standard deviation, and the 95 % bars of both."""

    mean: float
    mean_error: float
    deviation: float
    deviation_error: float


def logarithm_of(
    state: State, finer: State | None, regions: IntArray, spreads: Sequence[Spread | None], contact_error: float
) -> Logarithm:
    """Return ln F; collective. ``regions`` are the numbers of owned cells.

    ``finer`` is the state in one degree more, without which bars are NaN. ``contact_error`` is the relative error bar
    of the contact radius.
    """
    cells, comm, mirrored = _cells(state, finer), state.body.comm, state.body.mirrored
    variance, change, unresolved, given = 0.0, 0.0, 0.0, 0.0
    for number, spread in enumerate(spreads):
        if spread is not None:
            square, length = spread.deviation**2, spread.correlation_length
            sources = _of_all(comm, cells.of(np.flatnonzero(regions == number).astype(int)))
            clusters = sources.gathered(_clusters(sources, length))
            sums = square * _integral(comm, clusters, length, mirrored)
            variance += float(sums[0, 0])
            change += max(abs(float(sums[1, 1] - sums[0, 0])), fitted.POINTWISE_SPREAD * 2 * float(sums[0, 2]))
            unresolved += square * _own(sources, length) * 2.0 ** len(mirrored)
            given += square * float(sources.shares[:, 0].sum()) * 2.0 ** len(mirrored)
    deviation, averaged = sqrt(max(variance, 0.0)), max(given - variance, 0.0)
    error = nan
    if finer is not None and finer.influence is not None and deviation > 0:
        of_mesh = (fitted.CHANGES * change + unresolved) / (2 * deviation)
        of_mesh += contact_error * deviation * averaged / given
        error = hypot(of_mesh, fitted.SPREAD_DEVIATION * given * deviation)
    return Logarithm(fitted.SPREAD_HELD * averaged - given / 2, fitted.SPREAD_LEFT * averaged, deviation, error)


def _own(sources: Sources, length: float) -> float:
    """Return what the double integral has more if the influence of each cell is at a point."""
    within = sum(
        weight * (span / (2 * sources.variances / length**2 + span)) ** 1.5
        for weight, span in zip(*_gaussians(), strict=True)
    )
    return float(sources.shares[:, 0] ** 2 @ (1 - np.asarray(within)))


def _cells(state: State, finer: State | None) -> Sources:
    """Return the owned cells, with their shares of F, those in one degree more, and the size of the change."""
    assert state.influence is not None
    body, found = state.body, list[Sources]()
    here, above = state.influence.young, ((finer and finer.influence) or state.influence).young
    young = np.column_stack([here, above, np.abs(above - here)])
    nodes, x = compat.geometry_dofs(body.mesh)[: body.owned_cells], np.asarray(body.mesh.geometry.x)
    for start in range(0, max(len(nodes), 1), _CHUNK):
        points, volumes = places(x[nodes[start : start + _CHUNK]])
        whole = volumes.sum(axis=1)
        centres = np.einsum("cqx,cq->cx", points, volumes) / whole[:, None]
        apart = ((points - centres[:, None]) ** 2).sum(axis=2) / 3
        shares = young[start : start + _CHUNK] * volumes.mean(axis=1)[:, None] / 6  # of the reference cell
        found.append(Sources(shares, centres, (apart * volumes).sum(axis=1) / whole))
    return _joined(found)


def _joined(parts: Sequence[Sources]) -> Sources:
    """Return the sources of all parts."""
    return Sources(*(np.concatenate([getattr(one, name) for one in parts]) for name in Sources.__annotations__))


def _of_all(comm: MPI.Comm, own: Sources) -> Sources:
    """Return the sources of all ranks; collective."""
    return _joined(comm.allgather(own))


def _clusters(sources: Sources, length: float) -> IntArray:
    """Return the number of the cluster of each source, from 0 on: boxes that are halved where that matters."""
    if not len(sources.shares):
        return np.zeros(0, int)
    lowest = sources.centres.min(axis=0)
    size = float(np.ptp(sources.centres, axis=0).max()) or length
    found, boxes, count = np.zeros(len(sources.shares), int), np.zeros(len(sources.shares), int), 0
    active = np.arange(len(found))
    for level in range(_HALVINGS + 1):
        box = size / 2**level / length
        shares = np.bincount(boxes, np.abs(sources.shares[active, 0]))
        is_done = (box <= _FINEST) | (shares * box**2 <= _TOLERANCE) | (level == _HALVINGS)
        is_done |= np.bincount(boxes) == 1
        done = is_done[boxes]
        _, numbers = np.unique(boxes[done], return_inverse=True)
        found[active[done]] = count + numbers
        count += int(is_done.sum())
        active, boxes = active[~done], boxes[~done]
        if not len(active):
            break
        steps = ((sources.centres[active] - lowest) / (size / 2 ** (level + 1))).astype(int) % 2
        _, boxes = np.unique(8 * boxes + steps @ np.array([4, 2, 1]), return_inverse=True)
    return found


def _gaussians() -> tuple[FloatArray, FloatArray]:
    """Return weights and variances along an axis, in squares of the correlation length, of the Gaussians of ρ."""
    logarithms = np.linspace(*_ENDS, _STEPS)
    t = np.exp(logarithms)
    weights = t**_SHAPE * np.exp(-t) / gamma(_SHAPE)
    return weights / weights.sum(), 2 * t / 3


def _integral(comm: MPI.Comm, own: Sources, length: float, mirrored: Sequence[int]) -> FloatArray:
    """Return the double integral of the correlation over the whole body, of each two kinds of shares, (k, k).

    Collective: each rank has some rows of it.
    """
    weights, spans = _gaussians()
    centres, extents = (own.centres / length).astype(np.float32), (own.variances / length**2).astype(np.float32)
    total = np.zeros((own.shares.shape[1],) * 2)
    for signs in product(*((1.0, -1.0) if axis in mirrored else (1.0,) for axis in range(3))):
        images = centres * np.array(signs, np.float32)
        for start in range(_ROWS * comm.rank, len(centres), _ROWS * comm.size):
            rows = slice(start, start + _ROWS)
            squares = sum((centres[rows, None, axis] - images[None, :, axis]) ** 2 for axis in range(3))
            both = extents[rows, None] + extents
            for weight, span in zip(weights, spans, strict=True):
                wide = both + np.float32(span)
                values = np.exp(squares / (-2 * wide)) * (np.float32(span) / wide) ** np.float32(1.5)
                total += weight * own.shares[rows].T @ (values @ own.shares)
    return 2.0 ** len(mirrored) * global_sum(comm, total)
