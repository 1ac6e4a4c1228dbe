"""Ranges of parameters that a surrogate spans, on scales on which forces are smooth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.study.swept import Place
from epsmesh_identify.sections.parameters import Parameter

_POISSON: Place = ("material", "poisson")


@dataclass(frozen=True)
class Range:
    """A parameter of a study between two values, in SI units; of a modulus, its ratio to that of reference.

    The scale of a field is as a modulus.
    """

    parameter: Parameter
    low: float
    high: float

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return self.parameter.name

    @property
    def place(self) -> Place:
        """Place in the study."""
        return self.parameter.place

    @property
    def is_ratio(self) -> bool:
        """Whether it is a modulus."""
        return self.parameter.is_modulus

    @property
    def _is_logarithmic(self) -> bool:
        return self.parameter.is_logarithmic and self.low > 0

    def value(self, x: FloatArray) -> FloatArray:
        """Return values at positions in [-1, 1]."""
        if self._is_logarithmic:
            return np.asarray(np.sqrt(self.low * self.high) * (self.high / self.low) ** (x / 2))
        return np.asarray(self.low + (self.high - self.low) * (x + 1) / 2)

    def position(self, value: FloatArray) -> FloatArray:
        """Return the positions (n,) in [-1, 1] of values of the range."""
        if self._is_logarithmic:
            return np.asarray(2 * np.log(value / np.sqrt(self.low * self.high)) / np.log(self.high / self.low))
        return np.asarray(2 * (value - self.low) / (self.high - self.low) - 1)

    def spans(self, value: FloatArray) -> BoolArray:
        """Return whether values (n,) are in the range, but for rounding."""
        slack = 1e-9 * (self.high - self.low)
        return np.asarray((self.low - slack <= value) & (value <= self.high + slack))

    def trend(self, x: FloatArray) -> FloatArray:
        """Return the logarithm of what forces are divided by at positions in [-1, 1]: 1/(1 - ν²) of a half-space."""
        return np.asarray(-np.log1p(-(self.value(x) ** 2))) if self.place == _POISSON else np.zeros(x.shape)


def trend_of(ranges: Sequence[Range], positions: FloatArray) -> FloatArray:
    """Return the logarithm of what forces are divided by at positions (n, ranges), as (n, 1)."""
    found = np.zeros((len(positions), 1))
    for one, x in zip(ranges, positions.T, strict=True):
        found[:, 0] += one.trend(x)
    return found
