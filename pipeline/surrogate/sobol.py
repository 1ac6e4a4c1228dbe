"""Sobol's indices: the share of an output's variance that each parameter makes, alone and with the others.

I. M. Sobol, Math. Comput. Simul. 55, 271 (2001); estimators of A. Saltelli et al., Comput. Phys. Commun. 181, 259
(2010), by SALib.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.arrays import FloatArray

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
    function: Callable[[FloatArray], FloatArray], parameters: int, error: float, samples: int = SAMPLES
) -> Indices:
    """Return the indices of a function of points (n, parameters), uniform in [0, 1], with a relative ``error``.

    Error bars are those of the sample, by bootstrap, and of the function, by :func:`_passed_on`.
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
    first, total = (np.asarray(found[name], dtype=float) for name in ("S1", "ST"))
    return Indices(
        first=first,
        first_error=np.asarray(found["S1_conf"]) + _passed_on(first, share),
        total=total,
        total_error=np.asarray(found["ST_conf"]) + _passed_on(total, share),
        mean=mean,
        deviation=deviation / mean,
    )


def _passed_on(index: FloatArray, share: float) -> FloatArray:
    """Return how much indices (p,) may be off by an error of the function, in units of its standard deviation.

    The root of a part of the variance is the norm of a projection of the function, so that it moves by at most the
    norm of the error; and so does the root of the whole variance.
    """
    root = np.sqrt(np.clip(index, 0, 1))
    if share >= 1:
        return np.ones_like(index)
    most, least = ((root + share) / (1 - share)) ** 2, (np.maximum(root - share, 0) / (1 + share)) ** 2
    return np.asarray(np.minimum(np.maximum(most - root**2, root**2 - least), 1.0))
