"""What of the force regions decide, and within which distance of the touch: sums of the influence over cells.

Error bars are the changes by elements of one degree more, as those of outputs.
"""

from collections.abc import Iterator, Mapping

import basix
import numpy as np
from mpi4py import MPI

from epsmesh import compat, fitted
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.plan.steps import Solve
from epsmesh.run.spread import logarithm_of
from epsmesh.shapes.contact import place_of_touch
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.points.locate import table_of
from epsmesh.solve.points.state import State
from epsmesh.study.case import Case
from epsmesh.study.influence import DECIDED

# Points of a cell at which its influence is summed by distance; cells that are summed together.
_QUADRATURE, _CHUNK = 6, 20_000
# Distances at which sums are read, from the least on, in units of the largest; they are interpolated between.
_LEAST, _DISTANCES = 1e-4, 2_000
# A sum of the influence that lacks no more than this is the whole force.
_ROUNDING = 1e-6


def sums_of_influence(
    solve: Solve, state: State, finer: State | None, contact_error: float = 0.0
) -> Mapping[str, tuple[float, ...]]:
    """Return share of F by region, and distance (m) by share of F, with error bars, by their names; collective.

    If moduli are random fields, ``tissue_spread`` is the standard deviation of ln F, ``tissue_mean`` its mean.

    The mesh is that of the solver, turned so that the probe presses along −z. ``contact_error`` is the relative error
    bar of the contact radius: two degrees may have the same nodes in contact, and F another share where it is wider.
    """
    assert state.influence is not None
    case, body, comm = solve.case, state.body, state.body.comm
    count, numbers = len(case.tissues), np.zeros(body.owned_cells, int)
    if body.regions is not None:  # beyond ε, the linear part of each region has a number of its own
        numbers = body.regions[: body.owned_cells] % count
    centre = _touch(solve.meshed_case)
    above = (finer and finer.influence) or state.influence
    reach = comm.allreduce(_farthest(body, centre), op=MPI.MAX)
    edges = np.concatenate([[0.0], reach * np.geomspace(_LEAST, 1.0, _DISTANCES)])
    size = len(edges) - 1

    def by_distance(distances: FloatArray, works: FloatArray) -> FloatArray:
        places = np.searchsorted(edges, distances.ravel(), side="right").clip(1, size) - 1
        return np.asarray(np.bincount(places, works.ravel(), minlength=size), dtype=float)

    # Sums by region, of E and of ν: here, in one degree more, and of changes.
    regions, within = np.zeros((2, 3, count)), np.zeros((4, size))
    for cells, distances, volumes in _points(state, centre):
        for number, name in enumerate(("young", "poisson")):
            own, other = (getattr(one, name)[cells] * volumes.sum(axis=1) for one in (state.influence, above))
            parts = own, other, np.abs(other - own)
            regions[number] += [np.bincount(numbers[cells], one, minlength=count) for one in parts]
        here, finest = (one.young[cells, None] * volumes for one in (state.influence, above))
        middles, whole = distances.mean(axis=1), here.sum(axis=1)
        steep = here * distances**fitted.DECAY
        steep *= np.divide(whole, steep.sum(axis=1), out=np.zeros_like(whole), where=whole > 0)[:, None]
        # By distance: here, in one degree more, with each cell at one distance, and with a decay within each cell.
        within[:2] += [by_distance(distances, one) for one in (here, finest)]
        within[2:] += [by_distance(middles, whole), by_distance(distances, steep)]
    regions, within = (2.0 ** len(body.mirrored) * global_sum(comm, sums) for sums in (regions, within))
    radii = np.array([_radii(np.cumsum(one), edges[1:]) for one in within])
    share, of_poisson = regions[0, 0], _bar_of_sums(*regions[1])
    found = {
        "force_share": (share, _bar_of_sums(*regions[0]) + contact_error * np.abs(share * (1 - share))),
        "poisson_effect": (regions[1, 0], of_poisson + fitted.POINTWISE_INFLUENCE * np.abs(share) * of_poisson.sum()),
        "influence_radius": (radii[0], _bar_of_radii(*radii)),
    }
    is_known = above is not state.influence
    values = {name: value for name, (value, _) in found.items()}
    values |= {f"{name}_error": bar if is_known else np.full_like(bar, np.nan) for name, (_, bar) in found.items()}
    spreads = [tissue.spread for tissue in case.tissues]
    if any(spreads):
        ln = logarithm_of(state, finer, numbers, spreads, contact_error)
        values |= {"tissue_mean": (ln.mean, ln.mean_error), "tissue_spread": (ln.deviation, ln.deviation_error)}
    return {name: tuple(map(float, numbers)) for name, numbers in values.items()}


def _touch(case: Case) -> FloatArray:
    """Return where the tool touches on the mesh: flat tools in the middle, others where they do first."""
    frame = case.frame
    point = np.array(frame.point if case.probe.is_flat else place_of_touch(case.body, case.probe, frame))
    return point if frame.turn is None else np.asarray(frame.turn @ point)


def _farthest(body: BodyMesh, centre: FloatArray) -> float:
    return float(np.linalg.norm(np.asarray(body.mesh.geometry.x) - centre, axis=1).max(initial=0.0))


def _bar_of_sums(here: FloatArray, above: FloatArray, changed: FloatArray) -> FloatArray:
    return fitted.CHANGES * np.maximum(np.abs(here - above), fitted.POINTWISE_INFLUENCE * changed)


def _bar_of_radii(here: FloatArray, above: FloatArray, by_cell: FloatArray, steep: FloatArray) -> FloatArray:
    """Return the bar of distances; the size of cells adds to it, by two other distributions of the sum of each cell.

    A change may vanish by chance: the bar of each has what all change on average.
    """
    changes = [np.abs(other / here - 1) for other in (above, by_cell, steep)]
    of_degree, *of_size = (np.maximum(change, np.sqrt(np.nanmean(change**2))) for change in changes)
    return np.asarray(here * (fitted.CHANGES * of_degree + np.maximum(*of_size)))


def _points(state: State, centre: FloatArray) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
    """Yield owned cells (n), the distances (m) of points in them from the ``centre``, and their volumes (n, q), m³."""
    at, weights = map(np.asarray, basix.make_quadrature(basix.CellType.tetrahedron, _QUADRATURE))
    functions, mesh = table_of(state.locator.order, at)[0], state.body.mesh
    nodes, x = compat.geometry_dofs(mesh), np.asarray(mesh.geometry.x)
    for start in range(0, state.body.owned_cells, _CHUNK):
        cells = np.arange(start, min(start + _CHUNK, state.body.owned_cells))
        places = np.einsum("qk,ckx->cqx", functions, x[nodes[cells]])
        yield cells, np.linalg.norm(places - centre, axis=2), state.volumes(cells, at) * weights


def _radii(within: FloatArray, radii: FloatArray) -> FloatArray:
    """Return the distances (m) within which each of ``DECIDED`` is decided, and beyond which no less is; NaN if none.

    ``within`` are the shares of F within ``radii`` (m).
    """
    found = np.full(len(DECIDED), np.nan)
    for number, share in enumerate(DECIDED):
        if within[-1] < share - _ROUNDING:
            continue
        less = np.flatnonzero(within[:-1] < share)
        last = less[-1] if len(less) else -1
        low = (0.0, 0.0) if last < 0 else (within[last], radii[last])
        high = within[last + 1], radii[last + 1]
        part = (share - low[0]) / (high[0] - low[0])
        found[number] = low[1] + min(part, 1.0) * (high[1] - low[1])
    return found
