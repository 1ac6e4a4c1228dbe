"""Kriging: interpolation of values at scattered places, with an error from cross-validation.

The values are a constant plus a Gaussian field with a Matérn correlation of smoothness 5/2, whose length at a place is
a multiple of that place's own scale (C. J. Paciorek and M. J. Schervish, 2006). Multiple and noise are those of the
largest likelihood (C. E. Rasmussen and C. K. I. Williams, 2006, ch. 5).
"""

from dataclasses import dataclass
from functools import cached_property
from math import inf, log

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from epsmesh.arrays import BoolArray, FloatArray, IntArray

# Correlation lengths in units of the scales, and variances of the noise in units of that of the field.
_LENGTHS = tuple(float(x) for x in np.geomspace(0.5, 1.5, 6))
_NOISES = tuple(float(x) for x in np.geomspace(1e-8, 1e-1, 8))
# Least number of standard deviations in a bar: of the field, and of the scatter. With correlations up to 3 scales and 3
# deviations, 2 % of the forces over small tumours just below the surface are outside their bars, by up to 3.4 of them.
_DEVIATIONS, _OF_SCATTER = 4.0, 3.0
_DIMENSIONS = 3


@dataclass(frozen=True, eq=False)
class Field:
    """Values (n,) at ``places`` (n, 3), in m, with the length scales (m) of the field there, shape (n,).

    ``scatter`` is the least standard deviation of a value about the field.
    """

    places: FloatArray
    scales: FloatArray
    values: FloatArray
    scatter: float = 0.0

    @cached_property
    def _fit(self) -> tuple[float, float, float, FloatArray]:
        """Length, noise, variance, and the inverse of the correlation between the values, of the largest likelihood."""
        count, ones = len(self.values), np.ones(len(self.values))
        least = inf
        best: tuple[float, float, float, FloatArray] = (0.0, 0.0, 0.0, np.zeros((0, 0)))
        for length in _LENGTHS:
            plain = correlation(length, self.places, self.scales, self.places, self.scales)
            for noise in _NOISES:
                factor = cho_factor(plain + noise * np.eye(count))
                weights = cho_solve(factor, ones)
                apart = self.values - weights @ self.values / weights.sum()
                variance = max(float(apart @ cho_solve(factor, apart)) / (count - 1), float(np.finfo(float).tiny))
                spread = 2 * float(np.log(np.diag(factor[0])).sum())
                cost = (count - 1) * log(variance) + spread + log(float(weights.sum()))
                if cost < least:
                    least, best = cost, (length, noise, variance, cho_solve(factor, np.eye(count)))
        return best

    @cached_property
    def _projected(self) -> FloatArray:
        """The inverse of the correlation, without the constant."""
        *_, inverse = self._fit
        ones = inverse.sum(axis=1)
        return np.asarray(inverse - np.outer(ones, ones) / ones.sum())

    @cached_property
    def factor(self) -> float:
        """Standard deviations of the field in a bar: with it, the bar of each value left out contains that value.

        O. Dubrule (1983) has the values left out from one inverse.
        """
        _, _, variance, _ = self._fit
        projected = self._projected
        own = np.diag(projected)
        missed = np.square(projected @ self.values / own) - (_OF_SCATTER * self.scatter) ** 2
        return max(_DEVIATIONS, float(np.sqrt(np.maximum(missed, 0.0) * own / variance).max()))

    def weights(self, places: FloatArray, scales: FloatArray) -> FloatArray:
        """Return the weights (m, n) of the values at ``places`` (m, 3); each row has the sum 1."""
        length, _, _, inverse = self._fit
        near = correlation(length, places, scales, self.places, self.scales)
        ones = inverse.sum(axis=1)
        lacking = (1 - near @ ones) / ones.sum()
        return np.asarray(near @ inverse + np.outer(lacking, ones))

    def bars(self, places: FloatArray, scales: FloatArray) -> FloatArray:
        """Return the error bars (m,) of interpolated values at ``places`` (m, 3), the noise of a value included."""
        length, noise, variance, inverse = self._fit
        near = correlation(length, places, scales, self.places, self.scales)
        ones = inverse.sum(axis=1)
        left = 1 + noise - np.einsum("mi,ij,mj->m", near, inverse, near) + (1 - near @ ones) ** 2 / ones.sum()
        of_field = self.factor**2 * variance * np.maximum(left, 0.0)
        return np.asarray(np.sqrt(of_field + (_OF_SCATTER * self.scatter) ** 2))


def correlation(
    length: float, places: FloatArray, scales: FloatArray, others: FloatArray, other_scales: FloatArray
) -> FloatArray:
    """Return the correlations (m, n) of the field at ``places`` (m, 3) with that at ``others`` (n, 3).

    ``scales`` (m,) and ``other_scales`` (n,), in m, times ``length`` are the correlation lengths.
    """
    squares = np.add.outer(scales**2, other_scales**2) / 2
    ratio = (np.multiply.outer(scales, other_scales) / squares) ** (_DIMENSIONS / 2)
    r = np.sqrt(5.0) * cdist(places, others) / (length * np.sqrt(squares))
    return np.asarray(ratio * (1 + r + r**2 / 3) * np.exp(-r))


def cover(places: FloatArray, scales: FloatArray, known: IntArray, possible: BoolArray) -> list[int]:
    """Return further numbers of ``places`` (n, 3) that, with those ``known``, cover all of them.

    A place is covered if one is within its own of the ``scales`` (n,), in m. The farthest, in units of its scale, is
    next (T. F. Gonzalez, 1985); only those that are ``possible`` are.
    """
    away = np.full(len(places), inf)
    for number in known:
        away = np.minimum(away, np.linalg.norm(places - places[number], axis=1) / scales)
    found: list[int] = []
    while (left := np.where(possible, away, 0.0)).max() > 1:
        number = int(left.argmax())
        found.append(number)
        away = np.minimum(away, np.linalg.norm(places - places[number], axis=1) / scales)
    return found
