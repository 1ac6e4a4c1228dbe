"""Forces times a factor that is tabulated over the depth: what many similar fits of one curve need."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.parts import Forward, Unknown, Values

# Points of the depth, evenly spaced in its root; how far tables go beyond the depth of the fit.
_POINTS, _BEYOND = 80, 1.3
_DEGREE = 3
# Relative difference of forces that are the same but for rounding.
_SAME = 1e-9


@dataclass(frozen=True)
class Tabulated:
    """A force times a ``factor`` (points,), interpolated over ``roots`` (points,) of the depth, in m^½.

    It is computed once for each set of values, for one of each that differ in ``modulus`` alone, which the force is
    proportional to; "" for no such unknown.
    """

    forward: Forward
    modulus: str
    roots: FloatArray
    factor: FloatArray
    _tables: dict[tuple[float, ...], FloatArray] = field(default_factory=dict, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """What the force depends on."""
        return self.forward.names

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (n,), in N, at depths (n,) in m."""
        scale = values[self.modulus] if self.modulus else 1.0
        key = tuple(values[name] for name in self.names if name != self.modulus)
        if key not in self._tables:
            self._tables[key] = self.forward.force(self.roots**2, values) / scale
        knots, coefficients = _interpolation(float(self.roots[-1]), len(self.roots))
        spline = BSpline.construct_fast(knots, coefficients @ (scale * self.factor * self._tables[key]), _DEGREE)
        return np.asarray(spline(np.sqrt(np.maximum(depth, 0.0))))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the relative error (n,) of what was tabulated."""
        return self.forward.error(depth, values)

    def times(self, factor: FloatArray) -> "Tabulated":
        """Return the force with a further ``factor`` (points,) at the depths of the table."""
        return replace(self, factor=self.factor * factor)


def tabulated(forward: Forward, unknowns: Sequence[Unknown], values: Values, deepest: float) -> Tabulated:
    """Return a force that takes factors over the depth, down to beyond the ``deepest`` point (m).

    One table will do if the force is proportional to its only unknown, as about ``values``. Otherwise there is one for
    all values: far from a fit, as hidden parts bring it, no force is linear in Poisson's ratio or a thickness.
    """
    own = [unknown for unknown in unknowns if unknown.name in forward.names]
    roots = np.linspace(0.0, np.sqrt(_BEYOND * deepest), _POINTS)
    modulus = ""
    if len(own) == 1 and own[0].low > 0:
        (one,) = own
        table = forward.force(roots**2, values) / values[one.name]
        ends = [forward.force(roots**2, {**values, one.name: end}) / end for end in (one.low, one.high)]
        if all(np.allclose(end, table, rtol=_SAME, atol=0.0) for end in ends):
            modulus = one.name
    return Tabulated(forward, modulus, roots, np.ones(len(roots)))


@lru_cache
def _interpolation(end: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Return knots of splines over ``count`` places from 0 to ``end``, and the matrix from values to coefficients."""
    spline = make_interp_spline(np.linspace(0.0, end, count), np.eye(count), k=_DEGREE)
    return spline.t, spline.c
