"""What one force curve says under each hypothesis of its noise: normal equations and evidence.

About a fit the model is linear and all integrals are Gaussian, so that the evidence of a hypothesis, the restricted
likelihood (H. D. Patterson, R. Thompson, Biometrika 58, 545, 1971), costs the eigenvalues of a small matrix.
"""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.noise import DEVIATIONS, GRID, TERMS, WEIGHTS, Grams

# Probability beforehand of a deviation from the law, relative to that of none.
_BENT = 1.0
# Steps to the standard deviation of the noise, a fixed point.
_SCALES = 4

LOG_NOISE = np.log(WEIGHTS / WEIGHTS.sum())
"""Logarithm (noises,) of the probability of ``GRID`` beforehand."""

LOG_SIZE = np.log(np.array([1.0, *[_BENT / (len(DEVIATIONS) - 1)] * (len(DEVIATIONS) - 1)]) / (1 + _BENT))
"""Logarithm (sizes,) of the probability of ``DEVIATIONS`` beforehand."""


@dataclass(frozen=True)
class Beliefs:
    """What one curve says under hypotheses (h) of its noise, about steps from where the model was made linear.

    The logarithm of the likelihood of a step s is ``height`` + ``pull`` s - s ``information`` s / 2, the deviation from
    the law integrated out: (h,), (h, u) and (h, u, u). ``evidence`` (h,) is the logarithm of its integral over what
    else is known of s. ``scale`` (h,) is sigma. Hypotheses are those of ``GRID`` for each of ``DEVIATIONS`` in turn.
    """

    information: FloatArray
    pull: FloatArray
    height: FloatArray
    evidence: FloatArray
    scale: FloatArray

    @property
    def probable(self) -> FloatArray:
        """Logarithm (sizes, noises) of the evidence times what was known of the hypotheses beforehand."""
        return np.asarray(self.evidence.reshape(len(DEVIATIONS), len(GRID)) + LOG_SIZE[:, None] + LOG_NOISE)

    @property
    def misfit(self) -> float:
        """Logarithm of the evidence for a deviation from the law, relative to that for none."""
        none, *some = np.logaddexp.reduce(self.probable, axis=1) - LOG_SIZE
        return float(np.logaddexp.reduce(some) - np.log(len(some)) - none)


def size_of(hypothesis: int) -> float:
    """Return the size of the deviation from the law of a hypothesis, relative to the force."""
    return DEVIATIONS[hypothesis // len(GRID)]


def beliefs(products: Grams, precision: FloatArray, mean: FloatArray, least: float) -> Beliefs:
    """Return what a curve says, given what else is known of the step: a normal ``precision`` (u, u) and ``mean`` (u,).

    The standard deviation of the noise has its most probable value, by as many points as are left by the unknowns, but
    not below the ``least`` (N).
    """
    found = [_of_size(products, precision, mean, least, size) for size in DEVIATIONS]
    return Beliefs(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _of_size(
    products: Grams, precision: FloatArray, mean: FloatArray, least: float, deviation: float
) -> tuple[FloatArray, ...]:
    """Return the fields of ``Beliefs`` (noises, ...) for one of ``DEVIATIONS``."""
    size = len(mean)
    used = size + (TERMS if deviation else 0)
    whole, right = products.products[:, :used, :used], products.products[:, :used, -1]
    square = products.products[:, -1, -1]
    root = np.eye(used)
    root[:size, :size] = np.linalg.cholesky(precision)
    if deviation:
        root[size:, size:] /= deviation
    # In axes in which both the prior and the normal matrix are diagonal, every standard deviation costs a division.
    inverse = np.linalg.inv(root)
    value, axes = np.linalg.eigh(inverse @ whole @ inverse.T)
    value = np.maximum(value, 0.0)
    turned = np.einsum("hij,ki,hk->hj", axes, inverse.T, right, optimize=True)
    centre = np.einsum("hij,i->hj", axes, root.T @ np.concatenate([mean, np.zeros(used - size)]))
    variance = np.maximum(square / products.count, least**2)
    for _ in range(_SCALES):
        inner = value / variance[:, None]
        step = (turned / variance[:, None] + centre) / (inner + 1)
        rest = square + np.sum(step * (value * step - 2 * turned), axis=1)
        fitted = np.sum(inner / (inner + 1), axis=1)
        variance = np.maximum(rest / (products.count - fitted), least**2)
    constant = -products.half - 0.5 * products.count * np.log(variance)
    away = np.sum((step - centre) ** 2, axis=1)
    evidence = constant - 0.5 * rest / variance - 0.5 * away - 0.5 * np.log1p(inner).sum(axis=1)
    information, pull = whole / variance[:, None, None], right / variance[:, None]
    height = constant - 0.5 * square / variance
    if deviation:
        bent = information[:, size:, size:] + np.eye(TERMS) / deviation**2
        cross = np.linalg.solve(bent, np.concatenate([information[:, size:, :size], pull[:, size:, None]], axis=2))
        height = height + 0.5 * np.einsum("hk,hk->h", pull[:, size:], cross[..., -1])
        height = height - 0.5 * np.linalg.slogdet(deviation**2 * bent)[1]
        pull = pull[:, :size] - np.einsum("hki,hk->hi", cross[..., :-1], pull[:, size:])
        information = information[:, :size, :size] - information[:, :size, size:] @ cross[..., :-1]
    return information, pull, height, evidence, np.sqrt(variance)
