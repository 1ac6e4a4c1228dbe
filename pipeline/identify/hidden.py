"""The second bar: where unknowns are if the body hides a layer, a base or stiffening that the curves cannot tell.

What is hidden is a factor of the force with unknowns of its own. They are far from normal: a layer may be anything that
leaves the shape of the curve. So their ranges are covered by a grid of points. At each, all other unknowns are fitted
anew, and points are weighted by their evidence.
"""

from itertools import product

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.identify.bars import interval
from pipeline.identify.fit import Fit, Mixture, fit, prior
from pipeline.identify.parts import Hidden
from pipeline.identify.profiles import Likelihood

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
    parts: dict[str, Hidden] = {
        unknown.name: hidden
        for measured in base.measured
        for hidden in measured.hidden
        if hidden.kind == kind
        for unknown in hidden.unknowns
    }
    extra = [unknown for name, hidden in parts.items() for unknown in hidden.unknowns if unknown.name == name]
    model = base.with_unknowns(extra)
    likelihood, count = Likelihood(found, model), len(found.x)
    held = tuple(range(count, count + len(extra)))
    axis = (np.arange(_POINTS[len(extra)]) + 0.5) / _POINTS[len(extra)]
    _, precision = prior(base)
    uniform = np.diag(np.where(base.space.prior[1] > 0, 0.0, np.diag(precision)))
    places, falls, covariances = [], [], []
    x = found.x
    for point in product(axis, repeat=len(extra)):
        x, square, matrix = likelihood.best(np.concatenate([x[:count], point]), held)
        own = matrix[:count, :count] + uniform
        places.append(x)
        falls.append(-square / 2 - np.linalg.slogdet(own)[1] / 2)
        covariances.append(np.linalg.inv(own))
    weight = np.exp(np.array(falls) - max(falls))
    weight /= weight.sum()
    # The most probable noise is not the only one: its bars are widened to those of the mixture.
    top = found.mixture.covariance[int(np.argmax(found.mixture.weight))]
    wider = np.sqrt(np.diag(found.mixture.spread) / np.diag(top))
    covariance = np.array([one * np.outer(wider, wider) for one in covariances])
    mixture = Mixture(
        weight, np.array(places)[:, :count], covariance, found.mixture.freedom, np.ones(len(weight), dtype=bool)
    )
    if 1 / np.sum(weight**2) >= _FEW:
        return [mixture]
    # The curves see the hidden part: between the points of the grid, too.
    return [mixture, fit(model, places[int(np.argmax(weight))]).mixture]
