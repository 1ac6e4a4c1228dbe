"""Profile likelihoods: the bars of unknowns that are at an end of their range, or far from normal."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.beliefs import size_of
from epsmesh_identify.estimation.fit import Fit, prior
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.noise import TERMS, Noise, deviation, whiten
from epsmesh_identify.estimation.parts import Profile

# Steps of a profile: at most so many to each side, as shares of the range and of the standard deviation.
_MOST, _OF_RANGE, _OF_SPREAD, _GROWTH = 24, 0.08, 0.6, 1.3
# Gauss-Newton steps at each point, which begins where its neighbour ended; halvings of a step that is too long.
_NEWTON, _HALVINGS = 6, 5
# Steps that gain less, in twice the logarithm of the likelihood, are not made. A good one gains this share of what its
# derivatives predict.
_CLOSE, _GOOD = 1e-2, 0.7


@dataclass(frozen=True)
class MostProbable:
    """The most probable noise of one curve: deviations from the law are taken out by the base ``bent`` (n + k, k)."""

    noise: Noise
    scale: float
    share: FloatArray
    bent: FloatArray

    def white(self, columns: FloatArray) -> FloatArray:
        """Return columns (n, m) in standard deviations of the noise, without what a deviation may explain."""
        whitened, _ = whiten(columns, self.share, self.noise)
        if not self.bent.size:
            return whitened / self.scale
        whole = np.vstack([whitened / self.scale, np.zeros((self.bent.shape[1], columns.shape[1]))])
        return np.asarray(whole - self.bent @ (self.bent.T @ whole))


class Likelihood:
    """The likelihood of a model's coordinates for the most probable noise, without linearising the model."""

    def __init__(self, found: Fit, model: Model | None = None, deviation: float = 0.0):
        """``model`` may have other forces with the same unknowns, with a ``deviation`` from the law at least as large.

        The deviation is relative to the force, as in ``DEVIATIONS``.
        """
        self.model = model or found.model
        self._curves = tuple(most_probable(found, number, deviation) for number in range(len(found.force)))
        self._mean, precision = prior(self.model)
        # Uniform unknowns have no prior but their range.
        self._root = np.sqrt(np.where(self.model.space.prior[1] > 0, np.diag(precision), 0.0))

    def residual(self, x: FloatArray) -> FloatArray:
        """Return residuals (r,) in standard deviations: their squares add up to minus twice the log likelihood."""
        values = self.model.space.values(x)
        rows = [
            curve.white(self.model.thinned(self.model.predict(number, values) - measured.curve.force)[:, None])[:, 0]
            for number, (curve, measured) in enumerate(zip(self._curves, self.model.measured, strict=True))
        ]
        return np.concatenate([*rows, self._root * (x - self._mean)])

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Return the derivatives (r, u) of the residuals."""
        values = self.model.space.values(x)
        rows = [
            curve.white(self.model.thinned(self.model.jacobian(number, x, self.model.predict(number, values))))
            for number, curve in enumerate(self._curves)
        ]
        return np.vstack([*rows, np.diag(self._root)])

    def best(self, x: FloatArray, held: Sequence[int]) -> tuple[FloatArray, float, FloatArray]:
        """Return the best coordinates with those in ``held`` unchanged, the sum of squares, and the normal matrix.

        Derivatives are computed anew only where a step gains much less than they predict.
        """
        residual, jacobian = self.residual(x), self.jacobian(x)
        square, is_new = float(residual @ residual), True
        for _ in range(_NEWTON):
            matrix, slope = jacobian.T @ jacobian, jacobian.T @ residual
            step = _bounded(matrix, slope, x, held)
            predicted = -float(step @ (2 * slope + matrix @ step))
            if predicted < _CLOSE:
                break
            for halving in range(_HALVINGS if is_new else 1):
                trial = np.clip(x + step / 2**halving, 0.0, 1.0)
                after = self.residual(trial)
                if after @ after < square:
                    break
            gain = square - float(after @ after)
            if gain > 0:
                x, residual, square = trial, after, square - gain
            elif is_new:
                break
            is_new = gain < _GOOD * predicted
            if is_new:
                jacobian = self.jacobian(x)
        return x, square, jacobian.T @ jacobian


def _bounded(matrix: FloatArray, slope: FloatArray, x: FloatArray, held: Sequence[int]) -> FloatArray:
    """Return a Gauss-Newton step; unknowns that it would take out of their range stop at its end."""
    free = np.ones(len(x), dtype=bool)
    free[list(held)] = False
    step = np.zeros(len(x))
    ridge = 1e-10 * np.diag(matrix) + np.finfo(float).tiny
    for _ in range(len(x)):
        places = np.flatnonzero(free)
        if not len(places):
            break
        right = slope[places] + matrix[np.ix_(places, ~free)] @ step[~free]
        step[places] = -np.linalg.solve(matrix[np.ix_(places, places)] + np.diag(ridge[places]), right)
        out = free & ((x + step < 0) | (x + step > 1))
        if not out.any():
            break
        step[out] = np.clip(x + step, 0.0, 1.0)[out] - x[out]
        free &= ~out
    return step


def most_probable(found: Fit, number: int, least: float = 0.0) -> MostProbable:
    """Return the most probable noise of curve ``number``, with a deviation from the law of at least that size."""
    model, (noise, scale), size = found.model, found.noise(number), max(size_of(found.top(number)), least)
    values = model.space.values(found.x)
    contact = found.force[number] - model.offset(number, values)
    share = model.thinned(contact) / np.maximum(np.abs(contact).max(), np.finfo(float).tiny)
    if size == 0:
        return MostProbable(noise, scale, share, np.empty((0, 0)))
    bent, _ = whiten(model.thinned(deviation(contact, model.depth(number, values, found.force[number]))), share, noise)
    base, _ = np.linalg.qr(np.vstack([bent / scale, np.eye(TERMS) / size]))
    return MostProbable(noise, scale, share, base)


def profile(likelihood: Likelihood, x: FloatArray, place: int, spread: float, most: float) -> tuple[Profile, float]:
    """Return the profile of an unknown about the best ``x`` until it falls by ``most``, in coordinates; and its best.

    ``spread`` is about the standard deviation of the unknown's coordinate. Points are dense where the fall is ``most``.
    """
    x, least, _ = likelihood.best(x, ())
    points = [(float(x[place]), least)]
    for side in (-1, 1):
        at, step, halvings = x, side * min(_OF_RANGE, _OF_SPREAD * spread), 0
        for _ in range(_MOST):
            trial = at.copy()
            trial[place] = np.clip(at[place] + step, 0.0, 1.0)
            if trial[place] == at[place] or halvings == _HALVINGS:
                break
            trial, square, _ = likelihood.best(trial, (place,))
            points.append((float(trial[place]), square))
            if square - least > most:
                step, halvings = step / 2, halvings + 1
            else:
                # Steps grow: a profile that hardly falls is followed to the end of the range.
                at, step = trial, step * (_GROWTH if halvings == 0 else 0.5)
    value, square = np.array(sorted(points)).T
    return Profile(value, square - square.min()), float(value[np.argmin(square)])


def ends(found: Profile, threshold: float) -> tuple[float, float]:
    """Return where a profile crosses the ``threshold``, by a straight line in the root of the fall; else its ends."""
    root, target = np.sqrt(np.maximum(found.fall, 0.0)), np.sqrt(threshold)
    best = int(np.argmin(root))
    low, high = float(found.value[0]), float(found.value[-1])
    for (a, f), (b, g) in pairwise(zip(found.value[best::-1], root[best::-1], strict=True)):
        if g > target:
            low = float(a + (b - a) * (target - f) / (g - f))
            break
    for (a, f), (b, g) in pairwise(zip(found.value[best:], root[best:], strict=True)):
        if g > target:
            high = float(a + (b - a) * (target - f) / (g - f))
            break
    return low, high
