"""Forces times a factor that is tabulated over the depth: what many similar fits of one curve need."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.arrays import FloatArray
from pipeline.identify.parts import Forward, Unknown, Values

# Points of the depth, evenly spaced in its root; how far tables go beyond the depth of the fit.
_POINTS, _BEYOND = 80, 1.3
# Relative difference of forces that are the same but for rounding.
_SAME = 1e-9


@dataclass(frozen=True)
class Proportional:
    """A force that is ``modulus`` times a ``table`` (points,), in m², over ``roots`` (points,) of the depth, in m^½."""

    forward: Forward
    modulus: str
    roots: FloatArray
    table: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        """What the force depends on."""
        return self.forward.names

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.roots, self.table)

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (n,), in N, at depths (n,) in m."""
        return np.asarray(values[self.modulus] * self._spline(np.sqrt(np.maximum(depth, 0.0))))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the relative error (n,) of what was tabulated."""
        return self.forward.error(depth, values)

    def times(self, factor: FloatArray) -> "Proportional":
        """Return the force with a ``factor`` (points,) at the depths of the table."""
        return replace(self, table=self.table * factor)


@dataclass(frozen=True)
class Scaled:
    """A force times a ``factor`` (points,) over ``roots`` (points,) of the depth, in m^½."""

    forward: Forward
    roots: FloatArray
    factor: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        """What the force depends on."""
        return self.forward.names

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (n,), in N, at depths (n,) in m."""
        logarithm = np.interp(np.sqrt(np.maximum(depth, 0.0)), self.roots, np.log(self.factor))
        return np.asarray(self.forward.force(depth, values) * np.exp(logarithm))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the relative error (n,) of the force."""
        return self.forward.error(depth, values)

    def times(self, factor: FloatArray) -> "Scaled":
        """Return the force with a further ``factor`` (points,)."""
        return replace(self, factor=self.factor * factor)


def tabulated(forward: Forward, unknowns: Sequence[Unknown], values: Values, deepest: float) -> Proportional | Scaled:
    """Return a force that takes factors over the depth, down to beyond the ``deepest`` point (m).

    It is a table if the force is proportional to its only unknown, as about ``values``. Otherwise it is computed for
    all values: far from a fit, as hidden parts bring it, no force is linear in Poisson's ratio or a thickness.
    """
    own = [unknown for unknown in unknowns if unknown.name in forward.names]
    roots = np.linspace(0.0, np.sqrt(_BEYOND * deepest), _POINTS)
    if len(own) == 1 and own[0].low > 0:
        (one,) = own
        table = forward.force(roots**2, values) / values[one.name]
        ends = [forward.force(roots**2, {**values, one.name: end}) / end for end in (one.low, one.high)]
        if all(np.allclose(end, table, rtol=_SAME, atol=0.0) for end in ends):
            return Proportional(forward, one.name, roots, table)
    return Scaled(forward, roots, np.ones(len(roots)))
