"""The fit of a model to force curves: Gauss-Newton steps to the middle of what all hypotheses of the noise say."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.beliefs import Beliefs, beliefs
from epsmesh_identify.estimation.mixture import Mixture, mixture_of
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.noise import GRID, Noise, deviation, grams

# Precision of an unknown that is only known to be within its range: that of a uniform distribution.
_UNIFORM = 12.0
# No measured force is exact to this share of the largest one: ISO 7500-1 allows five times as much in its finest class.
FINEST = 1e-3
# That is so many standard deviations of the noise at least.
_SURE = 3.0
# Sweeps until the middle of all hypotheses moves by less than this share of their spread.
_SWEEPS, _CLOSE = 12, 0.1
# A step may lower the logarithm of the evidence by so much, as what curves know of each other does; halvings of others.
_FALL, _HALVINGS = 5.0, 6


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

    def top(self, number: int) -> int:
        """Return the hypothesis of curve ``number`` in the most probable combination."""
        return int(self.mixture.hypotheses[self.mixture.top, number])

    def noise(self, number: int) -> tuple[Noise, float]:
        """Return the most probable noise of curve ``number``, and its sigma in N."""
        top = self.top(number)
        return GRID[top % len(GRID)], float(self.beliefs[number].scale[top])

    @property
    def evidence(self) -> float:
        """Logarithm of the evidence of all hypotheses of all curves, each given what others say of the unknowns."""
        return float(sum(np.logaddexp.reduce(belief.probable.ravel()) for belief in self.beliefs))

    @property
    def misfit(self) -> float:
        """Logarithm of the evidence for deviations from the law, relative to that for none, in the worst curve.

        The worst of many is worse by chance: it is one of so many.
        """
        return max(belief.misfit for belief in self.beliefs) - float(np.log(len(self.beliefs)))


def fit(model: Model, start: FloatArray) -> Fit:
    """Return the fit of a model whose coordinates are about those of ``start`` (u,)."""
    found, before = _linear(model, start, None), None
    for _ in range(_SWEEPS):
        step = np.clip(found.mixture.middle, 0.0, 1.0) - found.x
        is_close = bool(np.all(np.abs(step) <= _CLOSE * np.sqrt(np.diag(found.mixture.spread))))
        # What curves know of each other is of the sweep before.
        if is_close and (len(found.beliefs) == 1 or before):
            break
        after = _stepped(model, found, step)
        if after is None:
            break
        found, before = after, found
    return found


def _stepped(model: Model, found: Fit, step: FloatArray) -> Fit | None:
    """Return the fit after a ``step`` (u,), or a part of it; None if the model is linear over none.

    Where a direction is hardly seen, as contact point and baseline of a flat punch without air, a whole step leaves the
    range over which the derivatives hold: the evidence then falls.
    """
    for halving in range(_HALVINGS):
        after = _linear(model, found.x + step / 2**halving, found)
        if after.evidence > found.evidence - _FALL:
            return after
    return None


def _linear(model: Model, x: FloatArray, before: Fit | None) -> Fit:
    """Return the fit about x; in the one ``before``, each curve sees what all others say of the unknowns."""
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
        for other, belief in enumerate(before.beliefs if before else ()):
            if before and other != number:
                top = before.top(other)
                known += belief.information[top]
                pull = pull + belief.pull[top] - belief.information[top] @ (x - before.x)
        least = FINEST / _SURE * float(np.ptp(measured.curve.force))
        found.append(beliefs(products, known, np.linalg.solve(known, pull), least))
    count = sum(len(model.thinned(force)) for force in forces)
    return Fit(model, x, forces, jacobians, tuple(found), mixture_of(found, precision, mean, x, count))


def prior(model: Model) -> tuple[FloatArray, FloatArray]:
    """Return mean (u,) and precision (u, u) of the unknowns' coordinates beforehand."""
    mean, precision = model.space.prior
    return mean, np.diag(np.where(precision > 0, precision, _UNIFORM))
