"""What an identification is made of: unknowns, the model of a force curve, and what came out."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from pipeline.arrays import FloatArray
from pipeline.experiment.curve import Curve

Values = Mapping[str, float]
"""Values of unknowns by name, in SI units."""


@dataclass(frozen=True)
class Unknown:
    """A parameter to find between two bounds (SI units), and what is known of it beforehand.

    ``prior`` is mean and standard deviation of a normal distribution; without one, all values between the bounds are
    alike: those of the logarithm if ``is_logarithmic``, as for moduli and lengths of which only the order is known.
    ``is_wanted`` tells unknowns that the user asked for from those that only widen the bars of others, such as a
    thickness that is known to 5 %.
    """

    name: str
    low: float
    high: float
    unit: str
    is_logarithmic: bool = False
    prior: tuple[float, float] | None = None
    is_wanted: bool = True


class Forward(Protocol):
    """The force of one scene without noise, baseline and machine, as a function of depth and material."""

    names: tuple[str, ...]
    """Unknowns that the force depends on, such as young, poisson, skin_young and skin_thickness."""

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the instantaneous elastic force (N) at depths (m) of the tool below the surface; 0 above it."""
        ...

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the error of the force, relative to it, by mesh and interpolation (95 %)."""
        ...


@dataclass(frozen=True)
class Measured:
    """One curve and the scene it was measured on.

    ``machine_compliance`` (m/N) is what the machine yields: the tool is where the recorded depth says, less the force
    times it; None if it is the unknown "machine_stiffness" (N/m).
    """

    curve: Curve
    forward: Forward
    machine_compliance: float | None = 0.0
