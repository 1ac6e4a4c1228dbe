"""Forces near a fit from a table over the depth: what many similar fits of one curve need."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.arrays import FloatArray
from pipeline.identify.parts import Forward, Unknown, Values

# Points of the depth, evenly spaced in its root; how far tables go beyond the depth of the fit; differences.
_POINTS, _BEYOND, _STEP = 80, 1.3, 1e-4


@dataclass(frozen=True)
class Tabulated:
    """A force whose logarithm is linear in the unknowns, or in their logarithms, about some values.

    It is exact for a modulus to which the force is proportional. ``table`` (points, 1 + names) has the force (N) and
    the derivatives of its logarithm over ``roots`` (points,) of the depth, in m^½.
    """

    names: tuple[str, ...]
    roots: FloatArray
    table: FloatArray
    about: tuple[float, ...]
    is_logarithmic: tuple[bool, ...]
    error_of: Forward

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.roots, self.table)

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (n,), in N, at depths (n,) in m."""
        found = self._spline(np.sqrt(np.maximum(depth, 0.0)))
        change = [
            (np.log(values[name]) if is_log else values[name]) - about
            for name, about, is_log in zip(self.names, self.about, self.is_logarithmic, strict=True)
        ]
        return np.asarray(found[:, 0] * np.exp(found[:, 1:] @ np.array(change)))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the relative error (n,) of what was tabulated."""
        return self.error_of.error(depth, values)

    def times(self, factor: FloatArray) -> "Tabulated":
        """Return the force with a ``factor`` (points,) at the depths of the table."""
        return replace(self, table=np.column_stack([self.table[:, 0] * factor, self.table[:, 1:]]))


def tabulated(forward: Forward, unknowns: Sequence[Unknown], values: Values, deepest: float) -> Tabulated:
    """Return a table of a force about ``values`` of its ``unknowns``, down to beyond the ``deepest`` point (m)."""
    own = [unknown for unknown in unknowns if unknown.name in forward.names]
    roots = np.linspace(0.0, np.sqrt(_BEYOND * deepest), _POINTS)
    force = forward.force(roots**2, values)
    columns = [force]
    for unknown in own:
        value = values[unknown.name]
        step = _STEP * (value if unknown.is_logarithmic else unknown.high - unknown.low)
        step = -step if value + step > unknown.high else step
        moved = forward.force(roots[1:] ** 2, {**values, unknown.name: value + step})
        rate = np.log(moved / force[1:]) / (np.log1p(step / value) if unknown.is_logarithmic else step)
        columns.append(np.concatenate([rate[:1], rate]))
    about = tuple(float(np.log(values[one.name])) if one.is_logarithmic else values[one.name] for one in own)
    return Tabulated(
        tuple(one.name for one in own),
        roots,
        np.column_stack(columns),
        about,
        tuple(one.is_logarithmic for one in own),
        forward,
    )
