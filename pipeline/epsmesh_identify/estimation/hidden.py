"""The second bar: where unknowns are if the body hides a layer, a base or stiffening that the curves cannot tell.

What is hidden is a factor of the force with unknowns of its own. They are far from normal: a layer may be anything that
leaves the shape of the curve. So their ranges are covered by cells, smaller where they are probable. In the middle of
each, all other unknowns are fitted anew, and cells are weighted by their evidence.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.bars import interval
from epsmesh_identify.estimation.fit import Fit, fit, prior
from epsmesh_identify.estimation.mixture import Mixture
from epsmesh_identify.estimation.model import Model, Space
from epsmesh_identify.estimation.profiles import Likelihood
from epsmesh_identify.estimation.tabulated import Tabulated, tabulated

# Points along each hidden unknown by their number. Those with more than this share of the weight are divided, halved
# along each unknown, at most so many of them and so often.
_POINTS = {1: 9, 2: 6, 3: 4}
_SHARE, _MOST, _DIVISIONS = 0.005, 8, 2
# Deviation of the force, relative to it, that factors leave: they are those of half-spaces. With a layer of 0.2 to 5
# times the stiffness on a body 4 to 7 contact radii thick, their error changes over the depth by 3 % (median).
_INEXACT = 0.03
# With fewer effective points than this, a fit follows the best.
_FEW = 2.0


@dataclass(frozen=True)
class _Cell:
    """Part of the ranges of hidden unknowns, about ``point`` (k,), as wide as ``width`` in coordinates.

    All other unknowns were fitted for that point: to ``x`` (u,), with a ``covariance`` (u, u). ``weight`` is the
    logarithm of the evidence of the whole cell.
    """

    point: FloatArray
    width: float
    x: FloatArray
    covariance: FloatArray
    weight: float


def hidden_bars(found: Fit, wanted: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the ends (u,) of the bars in coordinates over all kinds of hidden parts, at least those without any.

    Only ``wanted`` unknowns are looked at; others are NaN, and all if nothing may be hidden.
    """
    low, high = np.full(len(found.x), np.nan), np.full(len(found.x), np.nan)
    kinds = sorted({hidden.kind for measured in found.model.measured for hidden in measured.hidden})
    mixtures = [found.mixture]
    for kind in kinds:
        mixtures += _of_kind(found, kind)
    for place in wanted if kinds else ():
        bars = [interval(mixture, place) for mixture in mixtures]
        low[place], high[place] = min(bar[0] for bar in bars), max(bar[1] for bar in bars)
    return low, high


def _of_kind(found: Fit, kind: str) -> list[Mixture]:
    """Return the distributions of the unknowns if the body hides one ``kind``."""
    base = found.model
    hidden = [[one for one in measured.hidden if one.kind == kind] for measured in base.measured]
    named = {unknown.name: unknown for parts in hidden for part in parts for unknown in part.unknowns}
    space = Space(tuple(named.values()))
    mean, precision = space.prior
    tables = _tables(found)
    uniform = np.diag(np.where(base.space.prior[1] > 0, 0.0, np.diag(prior(base)[1])))

    def fitted(point: FloatArray, width: float, start: FloatArray) -> _Cell:
        values = space.values(point)
        factors = [[part.factor(table.roots**2, values) for part in parts]
                   for parts, table in zip(hidden, tables, strict=True)]  # fmt: skip
        scaled = [
            replace(measured, forward=table.times(np.prod([np.ones(len(table.roots)), *own], axis=0)), hidden=())
            for measured, table, own in zip(base.measured, tables, factors, strict=True)
        ]
        x, square, matrix = Likelihood(found, Model(scaled, base.space), _INEXACT).best(start, ())
        information = matrix + uniform
        log = -(square + np.linalg.slogdet(information)[1] + precision @ (point - mean) ** 2) / 2
        return _Cell(point, width, x, np.linalg.inv(information), float(log + len(point) * np.log(width)))

    cells = _covering(len(named), fitted, found.x)
    logs = np.array([cell.weight for cell in cells])
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    # The most probable noise is not the only one: its bars are widened to those of the mixture.
    top = found.mixture.covariance[found.mixture.top]
    wider = np.sqrt(np.diag(found.mixture.spread) / np.diag(top))
    covariance = np.array([cell.covariance * np.outer(wider, wider) for cell in cells])
    best = int(np.argmax(weight))
    mixture = Mixture(
        weight,
        np.array([cell.x for cell in cells]),
        covariance,
        found.mixture.freedom,
        np.zeros((len(weight), 0), dtype=int),
        best,
    )
    if 1 / np.sum(weight**2) >= _FEW:
        return [mixture]
    # The curves see the hidden part: between the points of the grid, too.
    model = base.with_unknowns(space.unknowns)
    return [mixture, fit(model, np.concatenate([cells[best].x, cells[best].point])).mixture]


def _covering(size: int, fitted: Callable[[FloatArray, float, FloatArray], _Cell], x: FloatArray) -> list[_Cell]:
    """Return cells that cover the ranges of ``size`` hidden unknowns, small where most of the weight is.

    The fit of each begins where its nearest neighbour's ended, the first one's at ``x``.
    """
    count, cells = _POINTS[size], list[_Cell]()

    def add(point: FloatArray, width: float) -> None:
        near = min(cells, key=lambda cell: float(np.abs(cell.point - point).sum()), default=None)
        cells.append(fitted(point, width, near.x if near else x))

    for place in product((np.arange(count) + 0.5) / count, repeat=size):
        add(np.array(place), 1 / count)
    for _ in range(_DIVISIONS):
        logs = np.array([cell.weight for cell in cells])
        share = np.exp(logs - np.logaddexp.reduce(logs))
        divided = [cells[k] for k in np.argsort(-share)[:_MOST] if share[k] > _SHARE]
        for cell in divided:
            for side in product((-0.25, 0.25), repeat=size):
                add(cell.point + np.array(side) * cell.width, cell.width / 2)
        whole = {id(cell) for cell in divided}
        cells = [cell for cell in cells if id(cell) not in whole]
    return cells


def _tables(found: Fit) -> list[Tabulated]:
    """Return tables of the force of each curve's scene about the fit."""
    model, values = found.model, found.model.space.values(found.x)
    depths = [float(model.depth(number, values, force).max()) for number, force in enumerate(found.force)]
    return [
        tabulated(measured.forward, model.space.unknowns, values, depth)
        for measured, depth in zip(model.measured, depths, strict=True)
    ]
