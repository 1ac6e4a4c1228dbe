"""Numbers of a solution at a point or over a region, and how far elements of one degree more change them.

The pointwise change is a norm of the change of displacement, stress or strain. It bounds the change of each number that
follows (von Mises stress: a seminorm; principal values: H. Weyl), and does not vanish where a number changes sign.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from math import nan

import basix
import numpy as np

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.points.derived import principal, von_mises
from epsmesh.solve.points.state import State, Values

# Quadrature of means and quantiles, and the points of the largest stress in a cell. Degree 4 has points at which the
# map of a quarter-point element is singular.
_QUADRATURE = 6


def _principal_norm(tensor: FloatArray) -> FloatArray:
    return np.asarray(np.abs(principal(tensor)).max(axis=-1, initial=0.0))


# For each quantity: its number from values at points.
_NUMBERS: dict[str, Callable[[Values], FloatArray]] = {
    "displacement": lambda v: np.asarray(np.linalg.norm(v.displacement, axis=1)),
    "displacement_x": lambda v: v.displacement[:, 0],
    "displacement_y": lambda v: v.displacement[:, 1],
    "displacement_z": lambda v: v.displacement[:, 2],
    "von_mises": lambda v: von_mises(v.stress),
    "max_principal": lambda v: principal(v.stress)[:, 0],
    "min_principal": lambda v: principal(v.stress)[:, 2],
    "pressure": lambda v: np.asarray(-np.trace(v.stress, axis1=1, axis2=2) / 3),
    "max_strain": lambda v: _principal_norm(v.strain),
}
# Those that do not grow without bound at a singular edge.
_BOUNDED = ("displacement", "displacement_x", "displacement_y", "displacement_z")


def change_of(of: str, one: Values, other: Values) -> FloatArray:
    """Return a bound of the difference of a quantity at points."""
    if of in _BOUNDED:
        return np.asarray(np.linalg.norm(one.displacement - other.displacement, axis=1))
    if of == "max_strain":
        return _principal_norm(one.strain - other.strain)
    if of == "von_mises":
        return von_mises(one.stress - other.stress)
    return _principal_norm(one.stress - other.stress)


@dataclass(frozen=True)
class Number:
    """A ``value``, its ``change`` in elements of one degree more, and its mean pointwise change; NaN where unknown.

    ``is_singular`` says that it is at an edge where it grows without bound as elements shrink, or that a larger value
    is there; ``is_outside`` that there is no tissue.
    """

    value: float
    change: float = nan
    pointwise: float = nan
    is_singular: bool = False
    is_outside: bool = False


def at_point(of: str, point: FloatArray, state: State, finer: State | None, clear: BoolArray) -> Number:
    """Return a quantity at a ``point`` (3), m; ``clear`` are the owned cells away from singular edges; collective."""
    points = np.reshape(point, (1, 3))
    found = state.at(points)
    value = float(_NUMBERS[of](found)[0])
    if found.region[0] < 0:
        return Number(nan, is_outside=True)
    singular = of not in _BOUNDED and not bool(state.of_cells_at(points, clear.astype(float))[0])
    if finer is None:
        return Number(value, is_singular=singular)
    above = finer.at(points)
    change = abs(value - float(_NUMBERS[of](above)[0]))
    return Number(value, change, float(change_of(of, found, above)[0]), is_singular=singular)


def over_region(
    of: str, how: float | str, chosen: BoolArray, state: State, finer: State | None, clear: BoolArray
) -> Number:
    """Return the "max", the "mean" or a quantile of a quantity over the owned cells ``chosen``; collective.

    ``clear``: see :func:`at_point`; a largest value is that of clear cells.
    """
    cells = np.flatnonzero(chosen)
    at, weights = _points(of, how, state.degree)
    volumes = (state.volumes(cells, at) * weights).reshape(-1)
    comm, is_clear = state.body.comm, np.repeat(clear[cells], len(at))
    of_state = list(_images(state, cells, at))
    value = _reduced(of, how, state, of_state, volumes, is_clear)
    if np.isnan(value):
        return Number(nan, is_outside=True)
    singular = False
    if how == "max" and of not in _BOUNDED:
        everywhere = _reduced(of, how, state, of_state, volumes, np.ones_like(is_clear))
        singular = bool(comm.bcast(everywhere > value))
    if finer is None:
        return Number(value, is_singular=singular)
    of_finer = list(_images(finer, cells, at))
    above = _reduced(of, how, state, of_finer, volumes, is_clear)
    changes = [change_of(of, one, other) for one, other in zip(of_state, of_finer, strict=True)]
    sums = global_sum(comm, np.array([sum(float(each @ volumes) for each in changes), len(changes) * volumes.sum()]))
    return Number(value, abs(value - above), float(sums[0] / sums[1]), is_singular=singular)


def _points(of: str, how: float | str, degree: int) -> tuple[FloatArray, FloatArray]:
    """Return points of the reference cell (q, 3) and their weights (q)."""
    if how == "max" and of in _BOUNDED:
        nodes = compat.equidistant_nodes(degree)
        return nodes, np.full(len(nodes), 1 / len(nodes))
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, _QUADRATURE)
    return np.asarray(points), np.asarray(weights)


def _images(state: State, cells: IntArray, at: FloatArray) -> Iterator[Values]:
    """Yield the values at points of cells in each mirror image of the modelled part."""
    axes = state.body.mirrored
    for signs in product((1.0, -1.0), repeat=len(axes)):
        sign = np.ones(3)
        sign[list(axes)] = signs
        yield state.of_cells(cells, at, sign)


def _reduced(
    of: str, how: float | str, state: State, values: list[Values], volumes: FloatArray, clear: BoolArray
) -> float:
    """Return the number of all ranks; NaN where there are no cells; collective."""
    comm, found = state.body.comm, [_NUMBERS[of](each) for each in values]
    if how == "max":
        kept = clear if of not in _BOUNDED else np.ones_like(clear)
        largest = max(comm.allgather(max(float(each[kept].max(initial=-np.inf)) for each in found)))
        return nan if largest == -np.inf else largest
    whole = global_sum(comm, np.array([len(found) * volumes.sum(), sum(float(each @ volumes) for each in found)]))
    if how == "mean":
        return float(whole[1] / whole[0]) if whole[0] else nan
    every = np.concatenate(comm.allgather(np.concatenate(found)))
    weights = np.concatenate(comm.allgather(np.tile(volumes, len(found))))
    if not len(every):
        return nan
    order = np.argsort(every)
    share = np.cumsum(weights[order]) - weights[order] / 2
    return float(np.interp(float(how) * weights.sum(), share, every[order]))
