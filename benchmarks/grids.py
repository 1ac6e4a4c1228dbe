"""Uncertainty from the results of several meshes, whose sizes are all times one factor: what rivals' users compute.

Grid convergence index (GCI): P. J. Roache, J. Fluids Eng. 116, 405, 1994; Verification and Validation in Computational
Science and Engineering, 1998; ASME V&V 20-2009. Three meshes give the observed order; the bar on the finest is 1.25
times Richardson's estimate of its error. Where the observed order makes no sense, the formal order and a factor of 3
are used, as for two meshes (Roache, J. Fluids Eng. 133, 115501, 2011).

Median-based interval: P. Krysl, J. Verif. Valid. Uncert. 7, 031005, 2022 ("Confidence intervals for Richardson
extrapolation in solid mechanics"), equations 9 to 14. The four triples of four meshes give four extrapolated values.
The estimate is 2/3 of that of the three finest plus 1/3 of their median, and the half width of the 95 % interval is
twice 1.4826 times the median absolute deviation from the median.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

SURE, UNSURE = 1.25, 3.0  # safety factors of the GCI
LEAST_ORDER = 0.5
_OF_FINEST, _NORMAL, _DEVIATIONS = 2 / 3, 1.4826, 2.0  # Krysl's W and b, and the factor of 95 %
_ORDERS = (1e-3, 50.0)  # where the order is looked for


@dataclass(frozen=True)
class Estimate:
    """An estimate of a quantity, its bar, and whether it is by the method's rule or by its way out."""

    value: float
    bar: float
    is_regular: bool = True


def observed_order(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the order p of values f + c h^p on three meshes, the coarsest first; NaN if no positive order fits."""
    coarse, middle, fine = values
    first, second = middle - coarse, fine - middle
    if not first * second > 0:
        return math.nan
    h = np.asarray(sizes, dtype=float) / sizes[0]

    def off(order: float) -> float:
        return float((h[0] ** order - h[1] ** order) / (h[1] ** order - h[2] ** order) - first / second)

    low, high = _ORDERS
    return float(brentq(off, low, high)) if off(low) < 0 < off(high) else math.nan


def extrapolated(values: Sequence[float], sizes: Sequence[float]) -> float:
    """Return the limit of values on three meshes, the coarsest first, by Richardson's extrapolation; NaN if none."""
    order = observed_order(values, sizes)
    return values[-1] + (values[-1] - values[-2]) / ((sizes[-2] / sizes[-1]) ** order - 1)


def grid_convergence_index(values: Sequence[float], sizes: Sequence[float], formal: float, most: float) -> Estimate:
    """Return the finest of two or three values, the coarsest first, with its bar by the GCI.

    ``formal`` is the order where none is observed, ``most`` the largest observed one that is taken for one.
    """
    order, factor = formal, UNSURE
    if len(values) > 2:
        observed = observed_order(values, sizes)
        if LEAST_ORDER <= observed <= most:
            order, factor = observed, SURE
    error = abs(values[-1] - values[-2]) / ((sizes[-2] / sizes[-1]) ** order - 1)
    return Estimate(values[-1], factor * error, factor == SURE)


def median_interval(values: Sequence[float], sizes: Sequence[float]) -> Estimate | None:
    """Return Krysl's estimate from four values, the coarsest first, and the half width of its interval; None if none.

    There is none without an extrapolation from the three finest meshes, or with fewer than three extrapolations. One
    that fails counts as an outlier, as in the author's program.
    """
    triples = list(itertools.combinations(range(len(values)), 3))
    found = np.array([extrapolated([values[i] for i in three], [sizes[i] for i in three]) for three in triples])
    if math.isnan(found[-1]) or np.isnan(found).sum() > 1:
        return None
    found[np.isnan(found)] = math.inf
    middle = float(np.median(found))
    half = _DEVIATIONS * _NORMAL * float(np.median(np.abs(found - middle)))
    return Estimate(_OF_FINEST * float(found[-1]) + (1 - _OF_FINEST) * middle, half)
