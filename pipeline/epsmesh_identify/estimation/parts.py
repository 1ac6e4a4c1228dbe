"""What an identification is made of: unknowns, the model of a force curve, and what came out."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan
from typing import Protocol

import numpy as np
import numpy.typing as npt

from epsmesh.arrays import FloatArray
from epsmesh.study.identified import FITS
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.reading import ExperimentError

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

    @property
    def names(self) -> tuple[str, ...]:
        """Unknowns that the force depends on, such as young, poisson, skin_young and skin_thickness."""
        ...

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the instantaneous elastic force (N) at depths (m) of the tool below the surface; 0 above it."""
        ...

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the error of the force, relative to it, by mesh and interpolation (95 %)."""
        ...


class Hidden(Protocol):
    """What a body may have that the study does not declare, as a factor of the force of the declared body.

    The factor tends to 1 where the hidden part does not matter. Its unknowns are shared by all curves.
    """

    @property
    def kind(self) -> str:
        """One of the words of ``may_hide``: layer, base or strain."""
        ...

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Its parameters, with the range that they may have."""
        ...

    def factor(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the factor (n,) of the force at depths (m) of the tool below the surface."""
        ...


class TooDeepError(ExperimentError):
    """A fit is deeper than the force of its scene is known for."""


@dataclass(frozen=True)
class Measured:
    """One curve and the scene it was measured on.

    ``machine_compliance`` (m/N) is what the machine yields: the tool is where the recorded depth says, less the force
    times it; None if it is the unknown "machine_stiffness" (N/m). ``hidden`` is what may be undeclared of this body.
    ``may_tilt`` says whether the force without contact may be linear in the depth, instead of constant.
    """

    curve: Curve
    forward: Forward
    machine_compliance: float | None = 0.0
    hidden: tuple[Hidden, ...] = ()
    may_tilt: bool = True


# ---- what came out -----------------------------------------------------------------------------------------

SOURCES = ("noise", "contact", "machine", "thickness", "law", "mesh")
"""Where a bar is from: "contact" includes baseline, tilt and drift, "thickness" all known ± of the geometry."""


@dataclass(frozen=True)
class NoiseEstimate:
    """The most probable noise of a curve.

    A share ``white`` of its variance is white, the rest an autoregressive process with ``correlation`` from one point
    to the next. Its standard deviation is ``deviation`` (N) at no force and ``1 + growth`` times that at the largest.
    """

    correlation: float
    white: float
    growth: float
    deviation: float


@dataclass(frozen=True)
class CurveFit:
    """A curve as it was fitted; all arrays are (n,).

    ``depth`` (m) is that of the tool below the surface, ``force`` (N) the measured one, ``fit`` (N) that of the model
    with baseline and drift, ``band`` (N) the 95 % half width of ``fit`` by the unknowns. ``residual`` is force - fit.
    """

    name: str
    depth: FloatArray
    force: FloatArray
    fit: FloatArray
    band: FloatArray
    noise: NoiseEstimate

    @property
    def residual(self) -> FloatArray:
        """What the model leaves (N)."""
        return np.asarray(self.force - self.fit)


@dataclass(frozen=True)
class Profile:
    """Twice the fall of the logarithm of the likelihood at ``value`` (k,), all other unknowns fitted anew.

    The 95 % interval is where ``fall`` is below 3.84, somewhat more if the curve has few points.
    """

    value: FloatArray
    fall: FloatArray


@dataclass(frozen=True)
class Window:
    """A modulus (Pa) fitted to the depths (m) up to ``depth`` alone."""

    depth: float
    young: float


@dataclass(frozen=True)
class Estimate:
    """Unknowns with 95 % bars; all arrays have the order of ``unknowns`` (u,), values are SI.

    ``low`` and ``high`` are right if the body is as declared, ``low_hidden`` and ``high_hidden`` also if it hides what
    it may. All are NaN if the law does not fit. ``part`` (u, len(SOURCES)) are half widths by source; the root of the
    sum of their squares is half of high - low. An unknown that is not ``seen`` is anywhere in its range.
    ``windows`` show how the modulus changes with the depth that is fitted. ``notes`` are for the user, in sentences.
    """

    unknowns: tuple[Unknown, ...]
    estimate: FloatArray
    low: FloatArray
    high: FloatArray
    low_hidden: FloatArray
    high_hidden: FloatArray
    part: FloatArray
    correlation: FloatArray
    seen: npt.NDArray[np.bool_]
    verdict: str
    curves: tuple[CurveFit, ...]
    profiles: Mapping[str, Profile]
    windows: tuple[Window, ...] = ()
    evidence: float = nan
    """Logarithm of the evidence for a smooth deviation from the law, relative to that for none."""

    notes: tuple[str, ...] = ()

    @property
    def fits(self) -> bool:
        """Whether the declared law fits the curves."""
        return self.verdict == FITS

    def place(self, name: str) -> int:
        """Return the index of an unknown by its name."""
        return [unknown.name for unknown in self.unknowns].index(name)
