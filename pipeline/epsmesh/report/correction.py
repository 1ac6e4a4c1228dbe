"""The correction law F_exact ≈ F / r: one r for a mesh setting, for every scene, and how far it is off.

r is the number that makes the largest relative residual |F / (r F_exact) - 1| over the scenes as small as it can be
(Chebyshev's choice): the middle between the smallest and the largest F/F_exact.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan

import numpy as np


@dataclass(frozen=True)
class Correction:
    """r of a mesh setting and its relative residuals, the largest over the scenes.

    ``residual`` is that of the scenes that r was taken from; ``left_out`` that of each scene by the r of all the
    others, which tells little where scenes have twins (F/F_exact is the same for every Young's modulus); ``unseen``
    that of the scenes with one value of a scene parameter (one ν, one probe, …) by the r of those without it, the worst
    over parameters and values; ``error`` adds the error bars to the worst of these. NaN where there is nothing left to
    take r from.
    """

    r: float = nan
    mean: float = nan
    residual: float = nan
    left_out: float = nan
    unseen: float = nan
    error: float = nan


def fit(ratio: np.ndarray, bar: np.ndarray, axes: Mapping[str, np.ndarray]) -> Correction:
    """Return the correction of one setting from F/F_exact of its scenes, and what error bars add to each.

    ``axes`` holds, for each scene parameter, the position of each scene's value.
    """
    if not ratio.size:
        return Correction()
    r = middle(ratio)
    alone = r_without(ratio, np.arange(ratio.size))
    parameters = [r_without(ratio, labels) for labels in axes.values() if len(np.unique(labels)) > 1]
    held_out = [alone, *parameters]
    return Correction(
        r,
        float(ratio.mean()),
        _worst(ratio / r - 1),
        _worst(ratio / alone - 1),
        max((_worst(ratio / others - 1) for others in parameters), default=nan),
        max(_worst(np.abs(ratio / others - 1) + bar / others) for others in held_out),
    )


def middle(ratio: np.ndarray) -> float:
    """Return the r whose largest relative residual is smallest."""
    return float((ratio.min() + ratio.max()) / 2)


def r_without(ratio: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Return, for each scene, r of the scenes with other labels than its own; NaN if there are none."""
    names, group = np.unique(labels, return_inverse=True)
    if len(names) < 2:
        return np.full(ratio.shape, nan)
    low, high = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    np.minimum.at(low, group, ratio)
    np.maximum.at(high, group, ratio)
    # The extreme of the others is the extreme of all, but for the group that holds it: there it is the runner-up.
    first, second = np.partition(low, 1)[:2]
    least = np.where(np.arange(len(names)) == low.argmin(), second, first)
    second, first = np.partition(high, -2)[-2:]
    most = np.where(np.arange(len(names)) == high.argmax(), second, first)
    return np.asarray(((least + most) / 2)[group])


def _worst(residuals: np.ndarray) -> float:
    return float(np.abs(residuals).max())
