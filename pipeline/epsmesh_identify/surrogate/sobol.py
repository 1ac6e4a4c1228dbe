"""Sobol's indices: the share of an output's variance that each parameter makes, alone and with the others.

I. M. Sobol, Math. Comput. Simul. 55, 271 (2001); estimators of A. Saltelli et al., Comput. Phys. Commun. 181, 259
(2010), by SALib.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray

# Points of the sequence: a power of two, each with as many evaluations as there are parameters, and two more.
SAMPLES = 8192
_RESAMPLES = 100
_SEED = 1


@dataclass(frozen=True)
class Indices:
    """Indices of first order, and total ones, of each parameter (p,), with their error bars (95 %).

    ``mean`` and ``deviation`` are those of the output, the standard deviation relative to the mean.
    """

    first: FloatArray
    first_error: FloatArray
    total: FloatArray
    total_error: FloatArray
    mean: float
    deviation: float


def sobol(
    function: Callable[[FloatArray], FloatArray],
    parameters: int,
    error: float,
    samples: int = SAMPLES,
    acting: Collection[int] | None = None,
) -> Indices:
    """Return the indices of a function of points (n, parameters), uniform in [0, 1], with a relative ``error``.

    Error bars are those of the sample, by bootstrap, and of the function, by :func:`_passed_on`. The function and what
    it is an approximation of depend on ``acting`` parameters only, by default on all: the others' indices are 0, and
    that of a single one is 1, without error.
    """
    from SALib.analyze.sobol import analyze  # noqa: PLC0415 (slow to import)
    from SALib.sample.sobol import sample  # noqa: PLC0415

    names = [f"x{number}" for number in range(parameters)]
    problem: dict[str, Any] = {"num_vars": parameters, "names": names, "bounds": [[0.0, 1.0]] * parameters}
    options = {"calc_second_order": False, "seed": _SEED}
    values = function(sample(problem, samples, **options))
    mean, deviation = float(values.mean()), float(values.std())
    found = analyze(problem, values - mean, num_resamples=_RESAMPLES, **options)
    share = error * float(np.sqrt(np.mean(values**2))) / deviation
    acts = np.isin(np.arange(parameters), list(range(parameters) if acting is None else acting))
    known = ~acts if acts.sum() > 1 else np.full(parameters, True)

    def index(kind: str) -> tuple[FloatArray, FloatArray]:
        value = np.asarray(found[kind], dtype=float)
        bar = np.minimum(np.asarray(found[f"{kind}_conf"]) + _passed_on(value, share), 1.0)
        return np.where(known, acts.astype(float), value), np.where(known, 0.0, bar)

    return Indices(*index("S1"), *index("ST"), mean=mean, deviation=deviation / mean)


def _passed_on(index: FloatArray, share: float) -> FloatArray:
    """Return how much indices (p,) may be off by an error of the function, in units of its standard deviation.

    The roots of an index and of the rest of the variance are the sides of a right triangle with hypotenuse 1: norms of
    two orthogonal parts of the function. An error of the norm ``share`` turns the hypotenuse by at most its arc sine.
    """
    if share >= 1:
        return np.ones_like(index)
    angle, turn = np.arccos(np.sqrt(np.clip(index, 0, 1))), np.arcsin(share)
    most, least = (np.cos(np.clip(angle + by, 0, np.pi / 2)) ** 2 for by in (-turn, turn))
    return np.asarray(np.maximum(most - np.cos(angle) ** 2, np.cos(angle) ** 2 - least))
