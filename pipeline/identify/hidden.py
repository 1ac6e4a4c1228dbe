"""The second bar: where unknowns are if the body hides a layer, a base or stiffening that the curves cannot tell.

What is hidden is a factor of the force with unknowns of its own. They are far from normal: a layer may be anything that
leaves the shape of the curve. So their ranges are covered by a grid of points. At each, all other unknowns are fitted
anew, and points are weighted by their evidence.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.identify.bars import interval
from pipeline.identify.fit import Fit, fit, prior
from pipeline.identify.mixture import Mixture
from pipeline.identify.model import Model, Space
from pipeline.identify.profiles import Likelihood
from pipeline.identify.tabulated import Proportional, Scaled, tabulated

# Points along each hidden unknown by their number; with fewer effective points than this, a fit follows the best.
_POINTS = {1: 9, 2: 6, 3: 4}
_FEW = 2.0


def hidden_bars(found: Fit, wanted: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Return the ends (u,) of the bars in coordinates over all kinds of hidden parts, at least those without any.

    Only ``wanted`` unknowns are looked at; others are NaN.
    """
    low, high = np.full(len(found.x), np.nan), np.full(len(found.x), np.nan)
    mixtures = [found.mixture]
    for kind in sorted({hidden.kind for measured in found.model.measured for hidden in measured.hidden}):
        mixtures += _of_kind(found, kind)
    for place in wanted:
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
    count = _POINTS[len(named)]
    points = np.array(list(product((np.arange(count) + 0.5) / count, repeat=len(named))))
    tables = _tables(found)
    uniform = np.diag(np.where(base.space.prior[1] > 0, 0.0, np.diag(prior(base)[1])))
    x, places, logs, covariances = found.x, [], [], []
    for point in points:
        values = space.values(point)
        factors = [[part.factor(table.roots**2, values) for part in parts]
                   for parts, table in zip(hidden, tables, strict=True)]  # fmt: skip
        scaled = [
            replace(measured, forward=table.times(np.prod([np.ones(len(table.roots)), *own], axis=0)), hidden=())
            for measured, table, own in zip(base.measured, tables, factors, strict=True)
        ]
        x, square, matrix = Likelihood(found, Model(scaled, base.space)).best(x, ())
        places.append(x)
        logs.append(-(square + np.linalg.slogdet(matrix + uniform)[1] + precision @ (point - mean) ** 2) / 2)
        covariances.append(np.linalg.inv(matrix + uniform))
    weight = np.exp(np.array(logs) - max(logs))
    weight /= weight.sum()
    # The most probable noise is not the only one: its bars are widened to those of the mixture.
    top = found.mixture.covariance[found.mixture.top]
    wider = np.sqrt(np.diag(found.mixture.spread) / np.diag(top))
    covariance = np.array([one * np.outer(wider, wider) for one in covariances])
    best = int(np.argmax(weight))
    mixture = Mixture(
        weight, np.array(places), covariance, found.mixture.freedom, np.zeros((len(weight), 0), dtype=int), best
    )
    if 1 / np.sum(weight**2) >= _FEW:
        return [mixture]
    # The curves see the hidden part: between the points of the grid, too.
    model = base.with_unknowns(space.unknowns)
    return [mixture, fit(model, np.concatenate([places[best], points[best]])).mixture]


def _tables(found: Fit) -> list[Proportional | Scaled]:
    """Return tables of the force of each curve's scene about the fit."""
    model, values = found.model, found.model.space.values(found.x)
    depths = [float(model.depth(number, values, force).max()) for number, force in enumerate(found.force)]
    return [
        tabulated(measured.forward, model.space.unknowns, values, depth)
        for measured, depth in zip(model.measured, depths, strict=True)
    ]
