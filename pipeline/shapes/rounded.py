"""The section of tools that are the same all round or all along: a straight flank at an angle, its tip rounded."""

from dataclasses import dataclass
from functools import lru_cache
from math import cos, inf, log, pi, sin, tan

import numpy as np

from pipeline.arrays import FloatArray

# Points of Gauss's rule over a quarter of a turn, and halvings until a half width is known to rounding.
_POINTS, _HALVINGS = 64, 60
_MANY = 100_000  # depths of a large study
# Of a wedge's pressure arcosh(b/|y|), the mean of ln(b/|y|).
_WEDGE = 1 + log(2)


@dataclass(frozen=True)
class Rounded:
    """A flank at ``angle`` (rad) to the axis that begins where a rounding of radius ``tip`` (m) touches it.

    An angle of nought is a ball: its flank begins at the equator, where it ends. Heights are above the lowest point.
    """

    angle: float
    tip: float = 0.0

    @property
    def tangent(self) -> float:
        """Distance (m) from the axis at which the rounding ends."""
        return self.tip * cos(self.angle)

    def height(self, distance: FloatArray) -> FloatArray:
        """Return heights (n,), in m, at distances (n,) from the axis, in m; infinite beyond a ball's equator."""
        within = np.minimum(distance, self.tangent)
        # As one over a sum: near the lowest point the difference of R and (R² - r²)^½ would be rounding.
        root = np.sqrt(np.maximum(self.tip**2 - within**2, 0.0))
        low = within**2 / np.maximum(self.tip + root, 1e-300)
        beyond = np.maximum(distance - self.tangent, 0.0)
        flank = beyond / tan(self.angle) if self.angle else np.where(beyond > 0, inf, 0.0)
        height: FloatArray = low + flank
        return height

    def slope(self, distance: FloatArray) -> FloatArray:
        """Return the slopes (n,) at distances (n,) from the axis (m)."""
        within = np.minimum(distance, self.tangent)
        rounding = within / np.maximum(np.sqrt(np.maximum(self.tip**2 - within**2, 0.0)), 1e-300)
        flank = 1 / tan(self.angle) if self.angle else inf
        slope: FloatArray = np.where(distance < self.tangent, rounding, flank)
        return slope

    def reach(self, depth: float) -> float:
        """Return the distance (m) from the axis at which it is ``depth`` (m) above its lowest point; a ball's, its own
        radius, where it is not that high.
        """
        end = self.tip * (1 - sin(self.angle))
        if depth < end or not self.angle:
            return float(np.sqrt(max(2 * self.tip * depth - depth**2, 0.0))) if depth < self.tip else self.tip
        return self.tangent + (depth - end) * tan(self.angle)

    def contact_radius(self, depth: float) -> float:
        """Return the radius (m) of contact of the body of revolution, pushed ``depth`` (m) into an elastic half-space.

        I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965): d = a ∫ f'(a sin t) dt over a quarter of a turn.
        """
        return _solved(self, depth, inf)

    def contact_width(self, depth: float, length: float) -> float:
        """Return half the width (m) of contact of an edge of some ``length`` (m), about that in the middle of it.

        The line load is that of the plane, E* b ∫ sin t f'(b sin t) dt; a half-space under as much over that length
        gives way by 2/(π E*) (ln(length / b) + 1 + ln 2) times it.
        """
        return _solved(self, depth, length)


@lru_cache(_MANY)
def _solved(section: Rounded, depth: float, length: float) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    sine, weights = np.sin(pi / 4 * (nodes + 1)), pi / 4 * weights

    def indented(half: float) -> float:
        slope = section.slope(half * sine)
        if length == inf:
            return half * float(weights @ slope)
        line_load = half * float(weights @ (sine * slope))
        return 2 / pi * line_load * (max(log(length / half), 0.0) + _WEDGE)

    low, high = 0.0, section.reach(depth)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if indented(middle) < depth else (low, middle)
    return (low + high) / 2
