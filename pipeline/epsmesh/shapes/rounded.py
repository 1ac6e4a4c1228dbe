"""Section of a tool of revolution or of an edge: a straight flank at an angle, with a rounded or a flat tip."""

from dataclasses import dataclass
from functools import cache, lru_cache
from math import asin, cos, inf, log, pi, sin, tan

import numpy as np

from epsmesh.arrays import FloatArray

# Points of Gauss's rule over a quarter turn, and bisections until a half width is known to rounding.
_POINTS, _HALVINGS = 64, 60
_MANY = 100_000  # cached depths, enough for a large study
# Mean of ln(b/|y|), weighted with a wedge's pressure arcosh(b/|y|).
_WEDGE = 1 + log(2)


@dataclass(frozen=True)
class Rounded:
    """A flank at ``angle`` (rad) to the axis, tangent to a rounding of radius ``tip`` (m). Heights are above the tip.

    With a zero angle it is a ball: the flank begins at the equator, where the ball ends. Up to the distance ``flat``
    (m) from the axis it is flat, and the rounding begins there.
    """

    angle: float
    tip: float = 0.0
    flat: float = 0.0

    @property
    def tangent(self) -> float:
        """Distance (m) from the axis at which the rounding ends."""
        return self.flat + self.tip * cos(self.angle)

    def height(self, distance: FloatArray) -> FloatArray:
        """Return heights (n,), in m, at distances (n,) from the axis, in m; infinite beyond a ball's equator."""
        low = rise(self._on_rounding(distance), self.tip)
        beyond = np.maximum(distance - self.tangent, 0.0)
        flank = beyond / tan(self.angle) if self.angle else np.where(beyond > 0, inf, 0.0)
        height: FloatArray = low + flank
        return height

    def inner_height(self, distance: FloatArray, inset: FloatArray) -> FloatArray:
        """Return heights (n,), in m, of the curves ``inset`` (n,), in m, inside of it: at most ``tip``."""
        tangent = (self.tip - inset) * cos(self.angle)
        beyond = np.maximum(distance - tangent, 0.0)
        height: FloatArray = inset + rise(np.minimum(distance, tangent), self.tip - inset) + beyond / tan(self.angle)
        return height

    def slope(self, distance: FloatArray) -> FloatArray:
        """Return the slopes (n,) at distances (n,) from the axis (m)."""
        within = self._on_rounding(distance)
        rounding = within / np.maximum(np.sqrt(np.maximum(self.tip**2 - within**2, 0.0)), 1e-300)
        flank = 1 / tan(self.angle) if self.angle else inf
        slope: FloatArray = np.where(distance < self.tangent, rounding, flank)
        return slope

    def _on_rounding(self, distance: FloatArray) -> FloatArray:
        """Return the lengths (n,), in m, of the rounding between its beginning and distances (n,) from the axis."""
        return np.clip(distance, self.flat, self.tangent) - self.flat

    def reach(self, depth: float) -> float:
        """Return the distance (m) from the axis at which it is ``depth`` (m) above its lowest point.

        For a ball that is not so high, return its radius.
        """
        end = self.tip * (1 - sin(self.angle))
        if depth < end or not self.angle:
            within = float(np.sqrt(max(2 * self.tip * depth - depth**2, 0.0))) if depth < self.tip else self.tip
            return self.flat + within
        return self.tangent + (depth - end) * tan(self.angle)

    def contact_radius(self, depth: float, bump: float = 0.0) -> float:
        """Return the contact radius (m) of the body of revolution, pressed ``depth`` (m) into an elastic half-space.

        I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965): d = a ∫ f'(a sin t) dt over a quarter turn. On a surface of mean
        curvature ``bump`` (1/m), positive on a dome, the gap f has the term ``bump`` r²/2 more (H. Hertz, 1882).
        """
        return _solved(self, depth, inf, bump)

    def contact_width(self, depth: float, length: float) -> float:
        """Return half the contact width (m), approximately, at the middle of an edge of a given ``length`` (m).

        The line load is that of plane strain, E* b ∫ sin t f'(b sin t) dt. Under this load over that length the
        surface of a half-space moves by 2/(π E*) (ln(length / b) + 1 + ln 2) times it.
        """
        return _solved(self, depth, length, 0.0)


def rise(beside: FloatArray, radius: float | FloatArray) -> FloatArray:
    """Return the heights (n,), in m, of a circle of a ``radius`` (m) above its lowest point, up to its equator."""
    # In this form R - (R² - r²)^½ has no cancellation near the lowest point.
    root = np.sqrt(np.maximum(np.square(radius) - beside**2, 0.0))
    low: FloatArray = beside**2 / np.maximum(radius + root, 1e-300)
    return low


@cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(_POINTS)


def quarter_turn(least: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return sines (n,) and weights (n,) of a quadrature rule over the part of a quarter turn whose sine is larger."""
    (nodes, weights), start = _gauss(), asin(least)
    half = (pi / 2 - start) / 2
    return np.sin(start + half * (nodes + 1)), half * weights


@lru_cache(_MANY)
def _solved(section: Rounded, depth: float, length: float, bump: float) -> float:
    def indented(half: float) -> float:
        if half <= section.flat:
            return 0.0
        sine, weight = quarter_turn(section.flat / half)
        slope = section.slope(half * sine)
        if length == inf:
            return half * float(weight @ slope) + bump * half**2
        line_load = half * float(weight @ (sine * slope))
        return 2 / pi * line_load * (max(log(length / half), 0.0) + _WEDGE)

    low, high = 0.0, section.reach(depth)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if indented(middle) < depth else (low, middle)
    return (low + high) / 2
