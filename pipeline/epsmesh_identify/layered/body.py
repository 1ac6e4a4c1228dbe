"""Layers on a half-space or on a rigid base, and the force of a round frictionless tool on them."""

from dataclasses import dataclass
from functools import cached_property
from math import inf, log, pi

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.special import j0

from epsmesh.arrays import FloatArray
from epsmesh_identify.layered.compliance import Layer, Solid, compliance
from epsmesh_identify.layered.contact import WIDEST, Profile, Touch, flat, too_wide, touch, waves_below

RIGID = Solid(inf, 0.0)
# Contact radii of a table: so many, from this share of the largest on.
_NODES, _FIRST = 48, 3e-3
_DEGREE = 5
# The largest contact radius of a table is found in so many steps, for a depth of 1 to 1.1 times the largest.
_STEPS, _AIM, _ENOUGH = 60, 1.03, 1.1
# Contact ends just below a ball's equator, where its slope is infinite.
_END = 1 - 1e-6


@dataclass(frozen=True)
class Table:
    """F / E* of a tool over its depth, for E* of the top layer.

    Between the depths of ``touched``, ln F is a spline of degree 5 over ln d, to a relative error of 3e-6; below them F
    is a power of d. Beyond the radius at which the tool ends, F grows as that of a flat punch.
    """

    touched: Touch

    def __call__(self, depth: FloatArray) -> FloatArray:
        """Return F / E* (n,), in m², at depths (n,) in m; 0 above the surface."""
        last, force, stiffness = self.touched.depth[-1], self.touched.force[-1], self.touched.stiffness[-1]
        beyond = force + stiffness * (depth - last)
        if last == 0:
            return np.maximum(beyond, 0.0)
        first, low = log(self.touched.depth[0]), log(self.touched.force[0])
        x = np.log(np.clip(depth, 1e-300, last))
        exponent = self.touched.depth[0] * self.touched.stiffness[0] / self.touched.force[0]
        within = np.exp(np.where(x < first, low + exponent * (x - first), self._spline(np.maximum(x, first))))
        return np.where(depth > last, beyond, np.where(depth > 0, within, 0.0))

    @cached_property
    def _spline(self) -> BSpline:
        return make_interp_spline(np.log(self.touched.depth), np.log(self.touched.force), k=_DEGREE)


@dataclass(frozen=True)
class LayeredBody:
    """Bonded elastic ``layers``, from the top, on a half-space or a rigid ``base``."""

    layers: tuple[Layer, ...] = ()
    base: Solid = RIGID

    def __post_init__(self) -> None:
        """Refuse a rigid surface."""
        if not self.layers and self.base.young == inf:
            raise ValueError("a body must have layers, or an elastic base")

    @property
    def top(self) -> Solid:
        """What the tool touches."""
        return self.layers[0] if self.layers else self.base

    @property
    def _top_thickness(self) -> float:
        return self.layers[0].thickness if self.layers else inf

    def compliance(self, wavenumber: FloatArray) -> FloatArray:
        """Return L (n,) at wavenumbers (n,), in 1/m: see :func:`epsmesh_identify.layered.compliance.compliance`."""
        return compliance(self.layers, self.base, wavenumber)

    def touch(self, profile: Profile, radius: FloatArray) -> Touch:
        """Return depth, F / E* of the top, and stiffness at contact radii (n,), in m."""
        return touch(self.layers, self.base, profile, radius)

    def force(self, profile: Profile, depth: FloatArray) -> FloatArray:
        """Return F (N) of a tool at depths (n,), in m; 0 above the surface."""
        return self.top.plane * self.table(profile, float(np.max(depth)))(depth)

    def punch(self, radius: float) -> float:
        """Return the stiffness (N/m) of a flat disc of a ``radius`` (m)."""
        return self.top.plane * float(self.touch(flat(radius), np.array([radius])).stiffness[0])

    def added_compliance(self) -> tuple[float, float]:
        """Return the compliance that is added to a small tool's on a half-space of the top layer: c (1/m), g (1/m³).

        The displacement by a point force is larger by c / E at the force, with E of the top. For points at distances s
        and s' from a centre it is larger by (c + g (s² + s'²)/2) / E, in the mean over directions: J₀ of the waves to
        second order.
        """
        waves, weights = waves_below(self.layers, 0.0)
        beyond = weights * (self.compliance(waves) - 1)
        scale = (1 - self.top.poisson**2) / pi
        return scale * float(beyond.sum()), -scale / 2 * float(beyond @ waves**2)

    def point_load(self, distance: float) -> float:
        """Return the displacement (m/N) of the surface at a ``distance`` (m) from a point force of 1 N."""
        waves, weights = waves_below(self.layers, distance)
        beyond = (weights * (self.compliance(waves) - 1)) @ j0(waves * distance)
        return float((1 / distance + beyond) / (pi * self.top.plane))

    def table(self, profile: Profile, deepest: float) -> Table:
        """Return F / E* over depth up to ``deepest`` (m).

        Raises:
            ValueError: if contact is too wide for the equation.
        """
        if profile.flat >= profile.limit:
            return Table(self.touch(profile, np.array([profile.limit])))
        widest = self._widest(profile, max(deepest, 1e-300))
        radii = profile.flat + (widest - profile.flat) * np.geomspace(_FIRST, 1.0, _NODES)
        touched = self.touch(profile, radii)
        if touched.depth[-1] < deepest and widest < _END * profile.limit:
            raise ValueError(f"a depth of {deepest:.3g} m is too large: {too_wide(widest, self._top_thickness)}")
        return Table(touched)

    def _widest(self, profile: Profile, depth: float) -> float:
        """Return a contact radius (m) that is as deep, or slightly deeper, or that of the tool's end."""
        end = min(_END * profile.limit, WIDEST * self._top_thickness)
        radius, exponent = _half_space_radius(profile, depth, end), 2.0
        tried: tuple[float, float] | None = None
        for _ in range(_STEPS):
            reached = float(self.touch(profile, np.array([radius])).depth[0])
            if depth <= reached <= _ENOUGH * depth or (radius == end and reached < depth):
                break
            width = radius - profile.flat
            if tried and tried[0] != width:
                slope = log(reached / tried[1]) / log(width / tried[0])
                exponent = float(np.clip(slope, 0.5, 4.0))
            tried = width, reached
            radius = min(profile.flat + width * (_AIM * depth / reached) ** (1 / exponent), end)
        return radius


def _half_space_radius(profile: Profile, depth: float, end: float) -> float:
    """Return about the contact radius (m) on a half-space, at most ``end``."""
    width = depth
    while profile.flat + width < end and profile.sneddon(np.array([profile.flat + width]))[0] < depth:
        width *= 1.2
    return min(profile.flat + width, end)
