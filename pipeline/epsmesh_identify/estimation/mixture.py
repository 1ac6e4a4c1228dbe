"""What all curves say together: a mixture of normal distributions, one for each combination of hypotheses of noises."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.beliefs import LOG_NOISE, LOG_SIZE, Beliefs
from epsmesh_identify.estimation.noise import GRID

# Hypotheses of one curve are kept from this weight on. Those of several curves are drawn this often: as often with the
# same noise in all curves, as one machine has, as with noise of each curve's own.
_LIGHT, _DRAWS = 1e-4, 256

IntArray = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Mixture:
    """Normal distributions of the unknowns' coordinates: ``weight`` (c,), ``mean`` (c, u), ``covariance`` (c, u, u).

    Since the noise is estimated, they have the tails of Student's distribution with ``freedom`` degrees of freedom.
    ``hypotheses`` (c, curves) are the places in ``Beliefs``; those of component ``top`` are the most probable.
    """

    weight: FloatArray
    mean: FloatArray
    covariance: FloatArray
    freedom: float
    hypotheses: IntArray
    top: int

    @property
    def middle(self) -> FloatArray:
        """Mean (u,) of the mixture."""
        return np.asarray(self.weight @ self.mean)

    @property
    def spread(self) -> FloatArray:
        """Covariance (u, u) of the mixture."""
        away = self.mean - self.middle
        own = np.einsum("c,cij->ij", self.weight, self.covariance)
        return np.asarray(own + np.einsum("c,ci,cj->ij", self.weight, away, away))

    def of_law(self) -> "Mixture | None":
        """Return the part without a deviation from the law in any curve, None if there is none."""
        is_law = np.all(self.hypotheses < len(GRID), axis=1)
        if not is_law.any():
            return None
        weight = self.weight[is_law] / self.weight[is_law].sum()
        return replace(
            self,
            weight=weight,
            mean=self.mean[is_law],
            covariance=self.covariance[is_law],
            hypotheses=self.hypotheses[is_law],
            top=int(np.argmax(weight)),
        )


def mixture_of(found: Sequence[Beliefs], precision: FloatArray, mean: FloatArray, x: FloatArray, count: int) -> Mixture:
    """Return the distributions that the beliefs of curves about steps from ``x`` (u,) give together.

    The prior of the coordinates has a ``precision`` (u, u) and a ``mean`` (u,); the curves have ``count`` points. The
    weight of a combination of hypotheses is the evidence of all curves together, times what was known beforehand.
    """
    chosen, beforehand, drawn = _one(found[0]) if len(found) == 1 else _several(found)
    of_curves = list(zip(found, chosen.T, strict=True))
    information = precision + sum(belief.information[at] for belief, at in of_curves)
    pull = precision @ (mean - x) + sum(belief.pull[at] for belief, at in of_curves)
    height = sum((belief.height[at] for belief, at in of_curves), np.zeros(len(chosen)))
    covariance = np.linalg.inv(information)
    step = np.einsum("cij,cj->ci", covariance, pull)
    evidence = height + 0.5 * np.einsum("ci,ci->c", pull, step) - 0.5 * np.linalg.slogdet(information)[1]
    probable = evidence + beforehand
    weight = np.exp(probable - drawn - np.max(probable - drawn))
    freedom = max(count - len(x), 1)
    return Mixture(weight / weight.sum(), x + step, covariance, freedom, chosen, int(np.argmax(probable)))


def _one(belief: Beliefs) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the hypotheses (c, 1) of a single curve that are not improbable, see ``_several``."""
    probable = belief.probable.ravel()
    chosen = np.flatnonzero(probable > probable.max() + np.log(_LIGHT))
    beforehand = (LOG_SIZE[:, None] + LOG_NOISE).ravel()[chosen]
    return chosen[:, None], beforehand, np.zeros(len(chosen))


def _several(found: Sequence[Beliefs]) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return combinations (c, curves) of hypotheses, and logarithms of their probability beforehand and as drawn.

    The noise is the same in all curves or each curve's own, as probable beforehand. Deviations from the law are each
    curve's own. Points that fill the unit cube evenly, by an additive recurrence (M. Roberts 2018), pick hypotheses.
    """
    count = len(found) + 1
    root = float(np.roots([1.0, *[0.0] * (count - 1), -1.0, -1.0]).real.max())
    *own, shared = (0.5 + np.outer(root ** -np.arange(1.0, count + 1), np.arange(_DRAWS))) % 1
    common = LOG_NOISE + sum(np.logaddexp.reduce(belief.probable - LOG_NOISE, axis=0) for belief in found)
    noise, of_noise = _drawn(np.tile(common, (_DRAWS, 1)), shared)
    alike, beforehand, drawn = [], LOG_NOISE[noise], of_noise
    apart, beforehand_apart, drawn_apart = [], np.zeros(_DRAWS), np.zeros(_DRAWS)
    for belief, at in zip(found, own, strict=True):
        size, of_size = _drawn(belief.probable[:, noise].T, at)
        alike.append(size * len(GRID) + noise)
        beforehand, drawn = beforehand + LOG_SIZE[size], drawn + of_size
        place, of_place = _drawn(np.tile(belief.probable.ravel(), (_DRAWS, 1)), at)
        apart.append(place)
        beforehand_apart = beforehand_apart + (LOG_SIZE[:, None] + LOG_NOISE).ravel()[place]
        drawn_apart = drawn_apart + of_place
    return (
        np.concatenate([np.column_stack(alike), np.column_stack(apart)]),
        np.concatenate([beforehand, beforehand_apart]),
        np.concatenate([drawn, drawn_apart]),
    )


def _drawn(probable: FloatArray, at: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return places (c,) where cumulative probabilities reach ``at`` (c,), and their logarithms: rows of (c, k)."""
    logs = probable - np.logaddexp.reduce(probable, axis=1, keepdims=True)
    reached = np.cumsum(np.exp(logs), axis=1)
    place = np.minimum(np.sum(reached < at[:, None] * reached[:, -1:], axis=1), logs.shape[1] - 1)
    return place, logs[np.arange(len(place)), place]
