"""Energy of a crack that a rigid cylinder holds open, over the ratio of radius and half length.

Of a cylinder of radius R in a crack of length 2b, everything follows from one function of ρ = R/b. Per length, the
stored energy is s = μ b² f(ρ). At a fixed crack, the pressure does the work N dR = ds, where N is the pressure,
integrated around the cylinder. At a fixed cylinder, both tips release G = −½ ds/db:

    N = μ b f'(ρ)        G = μ b (½ ρ f'(ρ) − f(ρ))
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from epsmesh.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Energies:
    """Energies f (n,) and their derivatives f' (n,) at rising ``ratios`` ρ (n,).

    Between the ratios, ln f is a smooth function of ln ρ, beyond them a straight line.
    """

    ratios: FloatArray
    energies: FloatArray
    slopes: FloatArray

    @cached_property
    def _logarithm(self) -> CubicHermiteSpline:
        exponents = self.ratios * self.slopes / self.energies
        return CubicHermiteSpline(np.log(self.ratios), np.log(self.energies), exponents)

    def _power(self, ratio: float) -> tuple[float, float]:
        """Return f and its exponent ρ f'/f."""
        at = np.log(ratio)
        within = min(max(at, self._logarithm.x[0]), self._logarithm.x[-1])
        exponent = float(self._logarithm(within, 1))
        return float(np.exp(self._logarithm(within) + exponent * (at - within))), exponent

    def energy(self, ratio: float) -> float:
        """Return f at a ratio."""
        return self._power(ratio)[0]

    def pressure(self, ratio: float) -> float:
        """Return f' at a ratio."""
        energy, exponent = self._power(ratio)
        return energy * exponent / ratio


@dataclass(frozen=True, eq=False)
class Opening(Energies):
    """Energies f = s/(μ b²) of a crack over the ratio R/b; f' is N/(μ b).

    ``thrusts`` (n,), in units of μ b per length, hold each face away from the line of the crack; ``angles`` (n,) are
    those of the cylinder's surface, from the middle of a face, up to which it touches. ``balance`` is the largest
    relative difference of the thrust and what holds the tissue ahead of the tips. ``message`` says why no larger ratio
    was solved.
    """

    thrusts: FloatArray
    angles: FloatArray
    balance: float = 0.0
    message: str = ""

    def release(self, ratio: float) -> float:
        """Return G/(μ R) at a ratio."""
        energy, exponent = self._power(ratio)
        return energy * (exponent / 2 - 1) / ratio

    def angle(self, ratio: float) -> float:
        """Return the angle of contact (rad) at a ratio."""
        return float(np.interp(ratio, self.ratios, self.angles))

    @property
    def released(self) -> tuple[float, float]:
        """The smallest and the largest G/(μ R) that were solved."""
        return self.release(float(self.ratios[0])), self.release(float(self.ratios[-1]))

    def ratio(self, toughness: float) -> float:
        """Return R/b at which G/(μ R) is a ``toughness`` Γ/(μ R).

        Raises:
            ValueError: if no solved ratio has it.
        """
        least, most = self.released
        if not least <= toughness <= most:
            raise ValueError(f"Γ/(μ R) is {toughness:.3g}: {least:.3g} to {most:.3g} is solved")
        ends = float(self.ratios[0]), float(self.ratios[-1])
        return float(np.exp(brentq(lambda at: self.release(np.exp(at)) - toughness, *np.log(ends))))
