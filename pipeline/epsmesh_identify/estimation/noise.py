"""Noise of a force curve: correlated and white, larger with the force, of unknown shares.

The covariance is sigma^2 S ((1 - w) rho^|i - j| + w delta_ij) S with S = 1 + kappa F / F_max: an autoregressive process
and white noise. Least squares takes all points for independent, and its bars are far too small if they are not. One
best rho is not enough either: its estimate is too small on average. A grid of (rho, w, kappa) is weighted by evidence.

A law is seldom exact: besides, the force may deviate by F xi(d), a smooth curve that vanishes with the depth.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import lapack

from epsmesh.arrays import FloatArray

# Correlations with their weights beforehand. White noise is common. A likelihood from one curve finds slow noise too
# fast on average: its weight makes good for it (calibrated on synthetic curves, see benchmarks/results/identify.md).
_CORRELATIONS = {0.3: 1.0, 0.6: 1.0, 0.8: 1.0, 0.9: 1.0, 0.95: 1.0, 0.98: 1.5, 0.99: 2.0, 0.995: 3.0, 0.998: 4.0}
_WHITE_WEIGHT = 8.0
_WHITE = (0.0, 0.1, 0.3, 0.6)
_GROWTHS = (0.0, 1.0, 4.0)
# Sizes of the deviation from the law, relative to the force; 0 is the declared law.
DEVIATIONS = (0.0, 0.003, 0.01, 0.03, 0.1, 0.3)
# Legendre polynomials of the deviation.
TERMS = 3


@dataclass(frozen=True)
class Noise:
    """Correlation of the autoregressive part from one point to the next, white share of the variance, growth with F."""

    correlation: float
    white: float
    growth: float


GRID = tuple(
    Noise(correlation, white, growth)
    for growth in _GROWTHS
    for correlation, white in ((0.0, 1.0), *product(_CORRELATIONS, _WHITE))
)

WEIGHTS = np.array([_CORRELATIONS.get(noise.correlation, _WHITE_WEIGHT) for noise in GRID])
"""Probabilities (h,) of ``GRID`` beforehand, not normalised."""


def whiten(columns: FloatArray, share: FloatArray, noise: Noise) -> tuple[FloatArray, float]:
    """Return ``columns`` (n, m), made white for unit variance, and half the logarithm of the covariance's determinant.

    ``share`` (n,) is F / F_max. The differences u[i] = r[i] - rho r[i - 1] have a tridiagonal covariance L D L^T: the
    cost is that of n.
    """
    scale: FloatArray = np.asarray(1 + noise.growth * np.abs(share))
    scaled = columns / scale[:, None]
    half = float(np.log(scale).sum())
    rho, white = noise.correlation, noise.white
    if rho == 0:
        return np.asarray(scaled), half
    scaled[1:] -= rho * scaled[:-1].copy()
    diagonal = np.full(len(scale), (1 - white) * (1 - rho**2) + white * (1 + rho**2))
    diagonal[0] = 1.0
    if white == 0:
        return np.asarray(scaled / np.sqrt(diagonal)[:, None]), half + 0.5 * float(np.log(diagonal).sum())
    diagonal, lower, info = lapack.dpttrf(diagonal, np.full(len(scale) - 1, -rho * white))
    assert info == 0
    *_, scaled, info = lapack.dgtsv(lower, np.ones(len(scale)), np.zeros(len(scale) - 1), scaled)
    assert info == 0
    return np.asarray(scaled) / np.sqrt(diagonal)[:, None], half + 0.5 * float(np.log(diagonal).sum())


def deviation(force: FloatArray, depth: FloatArray) -> FloatArray:
    """Return ``TERMS`` smooth curves (n, TERMS) by which the force may deviate from the law, relative to their size.

    They are F x P_k(2 x - 1) with x = d / d_max, which is F at small depth times a power of the depth.
    """
    x = np.clip(depth / np.maximum(depth.max(), np.finfo(float).tiny), 0.0, 1.0)
    basis = np.polynomial.legendre.legvander(2 * x - 1, TERMS - 1)
    return np.asarray((force * x)[:, None] * basis)


@dataclass(frozen=True)
class Grams:
    """Products of whitened columns of one curve under all of ``GRID``: derivatives, deviations and residual.

    ``products`` is (h, u + TERMS + 1, same), ``half`` (h,) half the logarithm of the determinants, ``count`` the number
    of points.
    """

    products: FloatArray
    half: FloatArray
    count: int


def grams(columns: FloatArray, share: FloatArray) -> Grams:
    """Return the products of ``columns`` (n, m): derivatives, deviations, residual; ``share`` (n,) is F / F_max."""
    products, halves = [], []
    for noise in GRID:
        white, half = whiten(columns, share, noise)
        products.append(white.T @ white)
        halves.append(half)
    return Grams(np.array(products), np.array(halves), len(columns))
