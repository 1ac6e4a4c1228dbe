"""The fit of a model to force curves: Gauss-Newton steps on whitened residuals, and the evidence of every noise.

About the fit the model is linear and all integrals are Gaussian, so that the evidence of a hypothesis of the noise, the
restricted likelihood (H. D. Patterson, R. Thompson, Biometrika 58, 545, 1971), costs a product of matrices.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.arrays import FloatArray
from pipeline.identify.model import Model
from pipeline.identify.noise import DEVIATIONS, TERMS, WEIGHTS, Grams, deviation, grams

# Precision of an unknown that is only known to be within its range: that of a uniform distribution.
_UNIFORM = 12.0
# Probability beforehand of a deviation from the law, relative to that of none.
_BENT = 1.0
# Steps to the standard deviation of the noise, a fixed point.
_SCALES = 4
# Sweeps until the middle of all hypotheses moves by less than this share of their spread.
_SWEEPS, _CLOSE = 12, 0.1
# Hypotheses of several curves are drawn this often, and those of one curve kept from this weight on.
_DRAWS, _LIGHT = 128, 1e-4
# Joint standard deviations of several curves are this much larger: errors of two curves of one ball, at a
# noise correlation of 0.95, had 1.2 times the rms that bars without it suppose.
_JOINT = 1.2


@dataclass(frozen=True)
class Beliefs:
    """What one curve says under hypotheses (h) of its noise, about steps from where the model was made linear.

    ``information`` (h, u, u) and ``pull`` (h, u) are the normal equations for unit prior, the deviation from the law
    integrated out; ``scale`` (h,) is sigma and ``evidence`` (h,) a logarithm. ``noise`` and ``size`` (h,) are the
    places of the hypotheses in ``GRID`` and ``DEVIATIONS``.
    """

    information: FloatArray
    pull: FloatArray
    scale: FloatArray
    evidence: FloatArray
    noise: FloatArray
    size: FloatArray

    @property
    def weight(self) -> FloatArray:
        """Probability (h,) of the hypotheses."""
        weight = np.exp(self._probable - self._probable.max())
        weight = np.where(self.size == 0, 1.0, _BENT / (len(DEVIATIONS) - 1)) * weight
        return np.asarray(weight / weight.sum())

    @property
    def misfit(self) -> float:
        """Logarithm of the evidence for a deviation from the law, relative to that for none."""
        is_law = self.size == 0
        top = np.exp(self._probable - self._probable.max())
        some, none = top[~is_law].sum() / (len(DEVIATIONS) - 1), top[is_law].sum()
        tiny = np.finfo(float).tiny
        return float(np.log(some + tiny) - np.log(none + tiny))

    @property
    def _probable(self) -> FloatArray:
        """Evidence and what was known of the noise beforehand, as logarithm (h,)."""
        return np.asarray(self.evidence + np.log(WEIGHTS[self.noise]))


def beliefs(products: Grams, precision: FloatArray, mean: FloatArray) -> Beliefs:
    """Return what a curve says, given what else is known of the step: a normal ``precision`` (u, u) and ``mean`` (u,).

    The standard deviation of the noise has its most probable value, by as many points as are left by the unknowns.
    """
    size = products.products.shape[1] - TERMS - 1
    found = [_of_size(products, precision, mean, size, place) for place in range(len(DEVIATIONS))]
    information, pull, scale, evidence = (np.concatenate(part) for part in zip(*found, strict=True))
    count = len(products.half)
    noise, sizes = np.tile(np.arange(count), len(DEVIATIONS)), np.repeat(np.arange(len(DEVIATIONS)), count)
    return Beliefs(information, pull, scale, evidence, noise, sizes)


def _of_size(
    products: Grams, precision: FloatArray, mean: FloatArray, size: int, place: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return information, pull, scale and evidence (h, ...) for one of ``DEVIATIONS``."""
    used = size + (TERMS if place else 0)
    whole = products.products[:, :used, :used]
    right, square = products.products[:, :used, -1], products.products[:, -1, -1]
    prior = np.zeros((used, used))
    prior[:size, :size] = precision
    if place:
        prior[size:, size:] = np.eye(TERMS) / DEVIATIONS[place] ** 2
    centre = np.concatenate([mean, np.zeros(used - size)])
    variance = square / products.count
    for _ in range(_SCALES):
        inner = whole / variance[:, None, None]
        matrix = inner + prior
        step = np.linalg.solve(matrix, (right / variance[:, None] + prior @ centre)[..., None])[..., 0]
        rest = square - 2 * np.einsum("hi,hi->h", step, right) + np.einsum("hi,hij,hj->h", step, whole, step)
        fitted = np.trace(np.linalg.solve(matrix, inner), axis1=1, axis2=2)
        variance = np.maximum(rest, 1e-30 * square) / (products.count - fitted)
    away = step - centre
    evidence = (
        -products.half
        - 0.5 * products.count * np.log(variance)
        - 0.5 * rest / variance
        - 0.5 * np.einsum("hi,ij,hj->h", away, prior, away)
        - 0.5 * np.linalg.slogdet(matrix)[1]
        + 0.5 * np.linalg.slogdet(prior)[1]
    )
    information, pull = inner[:, :size, :size], right[:, :size] / variance[:, None]
    if place:
        cross = np.linalg.solve(matrix[:, size:, size:], inner[:, size:, :size])
        information = information - inner[:, :size, size:] @ cross
        pull = pull - np.einsum("hki,hk->hi", cross, right[:, size:] / variance[:, None])
    return information, pull, np.sqrt(variance), evidence


@dataclass(frozen=True)
class Mixture:
    """Normal distributions of the unknowns' coordinates: ``weight`` (c,), ``mean`` (c, u), ``covariance`` (c, u, u).

    Since the noise is estimated, they have the tails of Student's distribution with ``freedom`` degrees of freedom.
    ``is_law`` (c,) tells those without a deviation from the law in any curve. Standard deviations are ``wider`` times
    those of ``covariance``.
    """

    weight: FloatArray
    mean: FloatArray
    covariance: FloatArray
    freedom: float
    is_law: npt.NDArray[np.bool_]
    wider: float = 1.0

    @property
    def middle(self) -> FloatArray:
        """Mean (u,) of the mixture."""
        return np.asarray(self.weight @ self.mean)

    @property
    def spread(self) -> FloatArray:
        """Covariance (u, u) of the mixture."""
        away = self.mean - self.middle
        own = self.wider**2 * np.einsum("c,cij->ij", self.weight, self.covariance)
        return np.asarray(own + np.einsum("c,ci,cj->ij", self.weight, away, away))

    def of_law(self) -> "Mixture | None":
        """Return the part without a deviation from the law in any curve, None if there is none."""
        if not self.is_law.any():
            return None
        weight = self.weight[self.is_law] / self.weight[self.is_law].sum()
        mean, covariance = self.mean[self.is_law], self.covariance[self.is_law]
        return Mixture(weight, mean, covariance, self.freedom, self.is_law[self.is_law], self.wider)


@dataclass(frozen=True)
class Fit:
    """A model about the coordinates ``x`` (u,): force, derivatives and beliefs of each curve; and the whole.

    ``mixture`` is about all of space: its coordinates are those of ``x``.
    """

    model: Model
    x: FloatArray
    force: tuple[FloatArray, ...]
    jacobian: tuple[FloatArray, ...]
    beliefs: tuple[Beliefs, ...]
    mixture: Mixture

    @property
    def misfit(self) -> float:
        """Logarithm of the evidence for deviations from the law, relative to that for none, in the worst curve.

        The worst of many is worse by chance: it is one of so many.
        """
        return max(belief.misfit for belief in self.beliefs) - float(np.log(len(self.beliefs)))


def fit(model: Model, start: FloatArray) -> Fit:
    """Return the fit of a model whose coordinates are about those of ``start`` (u,)."""
    x, others = start, None
    for _ in range(_SWEEPS):
        found = _linear(model, x, others)
        step = np.clip(found.mixture.middle, 0.0, 1.0) - x
        others = found.beliefs
        if np.all(np.abs(step) <= _CLOSE * np.sqrt(np.diag(found.mixture.spread))):
            break
        x = x + step
    return found


def _linear(model: Model, x: FloatArray, others: Sequence[Beliefs] | None) -> Fit:
    """Return the fit about x; ``others`` are the beliefs about a point before, from which each curve knows the rest."""
    values = model.space.values(x)
    forces = tuple(model.predict(number, values) for number in range(len(model.measured)))
    jacobians = tuple(model.jacobian(number, x, force) for number, force in enumerate(forces))
    mean, precision = prior(model)
    found = []
    for number, (measured, force, jacobian) in enumerate(zip(model.measured, forces, jacobians, strict=True)):
        contact = force - model.offset(number, values)
        bent = deviation(contact, model.depth(number, values, force))
        share = np.asarray(contact) / max(float(np.abs(contact).max()), np.finfo(float).tiny)
        residual = measured.curve.force - force
        columns = np.column_stack([jacobian, bent, residual])
        products = grams(model.thinned(columns), model.thinned(share))
        known, pull = precision.copy(), precision @ (mean - x)
        for other, belief in enumerate(others or ()):
            if other != number:
                top = int(np.argmax(belief.weight))
                known += belief.information[top]
                pull = pull + belief.pull[top]
        found.append(beliefs(products, known, np.linalg.solve(known, pull)))
    count = sum(len(model.thinned(force)) for force in forces)
    mixture = _mixture(found, precision, mean, x, max(count - len(x), 1))
    return Fit(model, x, forces, jacobians, tuple(found), mixture)


def prior(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return mean (u,) and precision (u, u) of the unknowns' coordinates beforehand."""
    mean, precision = model.space.prior
    return mean, np.diag(np.where(precision > 0, precision, _UNIFORM))


def _mixture(
    found: Sequence[Beliefs], precision: FloatArray, mean: FloatArray, x: FloatArray, freedom: float
) -> Mixture:
    """Return the distributions that the curves' beliefs about steps from x give together."""
    if len(found) == 1:
        weight = found[0].weight
        chosen = np.flatnonzero(weight > _LIGHT * weight.max())[:, None]
        weight = weight[chosen[:, 0]] / weight[chosen[:, 0]].sum()
    else:
        # Points that fill the unit cube evenly, by an additive recurrence (M. Roberts 2018), pick hypotheses by weight.
        # Deviations from the law are each curve's own. Noise is alike in curves of one machine: its hypotheses are
        # ranked by how much they say, and all curves have the same rank. Independent ones would average out what is
        # not known of the noise, with bars that are too small.
        count = len(found) + 1
        root = float(np.roots([1.0, *[0.0] * (count - 1), -1.0, -1.0]).real.max())
        points = (0.5 + np.outer(np.arange(_DRAWS), root ** -np.arange(1.0, count + 1))) % 1
        own, common = points[:, :-1].T, points[:, -1]
        chosen = np.column_stack([_drawn(belief, at, common) for belief, at in zip(found, own, strict=True)])
        weight = np.full(_DRAWS, 1 / _DRAWS)
    information = precision + sum(belief.information[at] for belief, at in zip(found, chosen.T, strict=True))
    pull = precision @ (mean - x) + sum(belief.pull[at] for belief, at in zip(found, chosen.T, strict=True))
    covariance = np.linalg.inv(information)
    step = np.einsum("cij,cj->ci", covariance, pull)
    is_law = np.all([belief.size[at] == 0 for belief, at in zip(found, chosen.T, strict=True)], axis=0)
    return Mixture(weight, x + step, covariance, freedom, np.asarray(is_law), _JOINT if len(found) > 1 else 1.0)


def _drawn(belief: Beliefs, deviation: FloatArray, noise: FloatArray) -> npt.NDArray[np.intp]:
    """Return hypotheses (c,) at points of the cumulative probabilities of the deviation, then of the noise.

    Noise that says least of the unknowns comes first.
    """
    told = np.log1p(np.diagonal(belief.information, axis1=1, axis2=2)).sum(axis=1)
    weight = np.array([belief.weight[belief.size == place].sum() for place in range(len(DEVIATIONS))])
    sizes = np.searchsorted(np.cumsum(weight), deviation * weight.sum())
    found = np.empty(len(sizes), dtype=np.intp)
    for place in np.unique(sizes):
        order = np.flatnonzero(belief.size == place)
        order = order[np.argsort(told[order])]
        ends = np.cumsum(belief.weight[order])
        found[sizes == place] = order[np.searchsorted(ends, noise[sizes == place] * ends[-1])]
    return found
