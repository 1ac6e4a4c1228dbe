"""Force curves of closed forms, with noise."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.noise import Noise
from epsmesh_identify.estimation.parts import Measured, Unknown, Values
from epsmesh_identify.experiment.curve import Curve

YOUNG = Unknown("young", 1e3, 1e6, "Pa", is_logarithmic=True)
POISSON = Unknown("poisson", 0.2, 0.5, "1")
DRIFT = Unknown("drift", -np.inf, np.inf, "N/s", is_wanted=False)


@dataclass(frozen=True)
class Ball:
    """Hertz's force of a ball; incompressible if Poisson's ratio is none of the unknowns."""

    radius: float = 1e-3
    names: tuple[str, ...] = ("young",)

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        modulus = values["young"] / (1 - values.get("poisson", 0.5) ** 2)
        return np.asarray(4 / 3 * modulus * np.sqrt(self.radius) * np.maximum(depth, 0.0) ** 1.5)

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        return np.full(len(depth), 1e-3)


@dataclass(frozen=True)
class Punch:
    """Force of a flat punch of a ``radius`` on a layer: the dependence on Poisson's ratio is that of its thickness.

    Incompressible if Poisson's ratio is none of the unknowns.
    """

    radius: float = 1e-3
    layer: float = 0.0
    names: tuple[str, ...] = ("young", "poisson")

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        poisson = values.get("poisson", 0.5)
        stiffer = 1 + self.layer * (1 + 4 * (poisson / 0.5) ** 4)
        return np.asarray(2 * values["young"] / (1 - poisson**2) * self.radius * stiffer * np.maximum(depth, 0.0))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        return np.full(len(depth), 1e-3)


def noise(rng: np.random.Generator, count: int, correlation: float, white: float = 0.1) -> FloatArray:
    """Return noise (count,) of unit variance."""
    steps = rng.normal(size=count) * np.sqrt(1 - correlation**2)
    slow = np.empty(count)
    slow[0] = rng.normal()
    for k in range(1, count):
        slow[k] = correlation * slow[k - 1] + steps[k]
    return np.asarray(np.sqrt(1 - white) * slow + np.sqrt(white) * rng.normal(size=count))


def covariance(one: Noise, share: FloatArray) -> FloatArray:
    """Return the covariance (n, n) of noise of unit variance, at shares (n,) of the largest force."""
    lags = np.abs(np.subtract.outer(np.arange(len(share)), np.arange(len(share))))
    scale = 1 + one.growth * share
    found = (1 - one.white) * one.correlation**lags + one.white * np.eye(len(share))
    return np.asarray(scale[:, None] * found * scale)


def measured(
    forward: Ball | Punch,
    values: Values,
    error: FloatArray,
    deepest: float,
    air: float = 0.5,
    name: str = "curve",
    tilt: float = 0.0,
) -> Measured:
    """Return a curve to a ``deepest`` point (m) after ``air``, a share of it; ``error`` (n,) is relative to F_max.

    The baseline has a ``tilt``, relative to the mean slope in contact.
    """
    depth = np.linspace(-air * deepest, deepest, len(error))
    force = forward.force(depth, values)
    recorded = force + force.max() * (error + 0.1 + tilt * depth / deepest)
    return Measured(Curve(name, depth + 1e-4, recorded, np.linspace(0, 1, len(error))), forward)
