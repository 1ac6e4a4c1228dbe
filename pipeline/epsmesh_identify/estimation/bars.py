"""Bars of 95 % from mixtures of Student's distributions, and their parts by source."""

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtr

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.mixture import Mixture

# Probability of each side beyond a bar of 95 %: less than 2.5 %, since the mixture is of models made linear, with the
# noise on a grid. Calibrated on 640 synthetic curves, and on 100 pairs of them: their noises are drawn from the grid.
# benchmarks/results/identify.md reports on others.
_TAIL, _OF_SEVERAL = 0.019, 0.012
# Standard deviations in which quantiles are looked for, and how exactly.
_FAR, _EXACT = 60.0, 1e-3


def tail(mixture: Mixture) -> float:
    """Return the probability of each side beyond a bar."""
    return _TAIL if mixture.hypotheses.shape[1] < 2 else _OF_SEVERAL


def interval(mixture: Mixture, place: int) -> tuple[float, float]:
    """Return the coordinates between which an unknown is with 95 %, not cut at the ends of its range."""
    mean, deviation = mixture.mean[:, place], np.sqrt(mixture.covariance[:, place, place])
    return _quantile(mixture, mean, deviation, tail(mixture)), _quantile(mixture, mean, deviation, 1 - tail(mixture))


def _quantile(mixture: Mixture, mean: FloatArray, deviation: FloatArray, share: float) -> float:
    """Return the quantile of a mixture with these means and standard deviations (c,)."""
    least, most = float((mean - _FAR * deviation).min()), float((mean + _FAR * deviation).max())

    def beyond(at: float) -> float:
        return float(mixture.weight @ stdtr(mixture.freedom, (at - mean) / deviation)) - share

    return float(brentq(beyond, least, most, xtol=_EXACT * float(deviation.min())))
