"""Frictionless contact of a tool with a body, from c, h and their gradients at one place: closed forms, E = 1.

A force F at t displaces the face at s (both from the tool's axis) by its field on a half-space, plus
F·(c + g·(s + t) + h (s² + t²)/4), ∇c = 2g: the regular part of the body's Green's function up to second order. For a
round tool this is exactly the half-space under a tool whose profile has Fh/4·r² more (I. N. Sneddon, 1965):

    D(a) = a ∫ f'(r) / (a² - r²)^½ dr,    F = 2E* ∫ D_e(a) - D_e(s) ds,    D_e(s) = D(s) + F h s²/2,
    d = D_e(a) + F c + h/4·∫ p r²,    ∫ p r² = 4E* ∫ s² (D_e(a) - D_e(s)) ds.

The gradient g tilts the face by Fg. The pressure changes as under a tilted disc of the contact's radius, which adds
-2/3·E* a³ F² g² to the complementary energy U(F), d = ∂U/∂F. All forces derive from one energy: at a fixed depth the
lateral force is ∂U/∂x, so a closed path does no work.
"""

from dataclasses import dataclass
from math import log1p, pi, sqrt, tan
from typing import ClassVar, NamedTuple

import numpy as np

from pipeline.realtime.place import Array, Contact, Place, Tool

# Newton steps, within a bracket; relative step at rounding, and the one after which one more step reaches rounding.
_STEPS, _SAME, _NEXT = 60, 4e-16, 1e-8
# Number of terms in the series of a ball: the last is below rounding for contact radii up to 0.6 of its radius.
_TERMS, _NEGLIGIBLE = 40, 1e-17
# For smaller 1 - 2ν, a logarithm divided by it is replaced by its limit.
_SOFT = 1e-12


@dataclass(frozen=True)
class Disc(Tool):
    """A flat round punch of ``radius`` (m)."""

    radius: float

    def press(self, depth: float, place: Place, most: float) -> Contact | None:
        """Return the contact at a ``depth`` (m), or nothing if its radius is more than ``most`` (m)."""
        a, h, stiff = self.radius, place.h, place.plane
        if a > most:
            return None
        force = depth / (tangent(a, place) - 4 / 3 * stiff * a**3 * place.tilt)
        half, of_h, of_tilt = 0.5 * force**2, a**2 / 3 - 4 / 45 * stiff * h * a**5, -4 / 3 * stiff * a**3
        aside_x, aside_y = (
            half * (slope_c + of_h * slope_h + of_tilt * slope_tilt)
            for slope_c, slope_h, slope_tilt in zip(place.slope_c, place.slope_h, place.slope_tilt, strict=True)
        )
        return Contact(force, (aside_x, aside_y), force / depth, a, 2 / 3 * a**2 - 8 / 45 * stiff * h * a**5)

    def moment(self, force: float, plane: float) -> tuple[float, float]:
        """It does not depend on the force of a flat tool."""
        return 2 / 3 * self.radius**2, 0.0


@dataclass(frozen=True)
class Round(Tool):
    """A tool of revolution, given by D(s), D'(s), ∫ D and ∫ s² D from 0 to s, all in m and m³."""

    grows: ClassVar[bool] = True

    limit: float

    def profile(self, s: float) -> tuple[float, float, float, float]:
        """Return the four at s (m)."""
        raise NotImplementedError

    def first(self, depth: float) -> float:
        """Return an initial guess of the contact radius (m) at a ``depth`` (m)."""
        raise NotImplementedError

    def rise(self, square: Array) -> Array:
        """Return the height (m) of the surface above its lowest point, at squared distances (m²) from the axis."""
        raise NotImplementedError

    def lifted(self, away: Array) -> Array:
        """The height follows from the profile."""
        square = away[:, 0] ** 2 + away[:, 1] ** 2
        return np.asarray(self.rise(square) - away[:, 2])

    def press(self, depth: float, place: Place, most: float) -> Contact | None:
        """Return the contact at a ``depth`` (m), or nothing if its radius is more than ``most`` (m)."""
        low, high = 0.0, min(most, self.limit)
        if not self._at(high, place).depth >= depth:
            return None
        a = min(self.first(depth), 0.5 * high)
        for _ in range(_STEPS):
            found = self._at(a, place)
            low, high = (a, high) if found.depth < depth else (low, a)
            step = a - (found.depth - depth) / found.slope if found.slope > 0 else low
            is_newton = low < step < high
            step = step if is_newton else 0.5 * (low + high)
            change, a = abs(step - a), step
            if change <= (_NEXT if is_newton else _SAME) * a:
                break
        return _contact(a, self._at(a, place), place)

    def _at(self, a: float, place: Place) -> "_Pressed":
        """Return the state for a contact radius ``a`` (m); its depth is negative if h allows no such contact."""
        stiff, h = place.plane, place.h
        sunk, steep, area, moment = self.profile(a)
        # On a dome the tool acts like a sharper one.
        sunk, steep = sunk + place.bend * a**2, steep + 2 * place.bend * a
        area, moment = area + place.bend * a**3 / 3, moment + place.bend * a**5 / 5
        own = 1 - 2 / 3 * stiff * h * a**3
        if own <= 0:
            return _Pressed(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        force = 2 * stiff * (a * sunk - area) / own
        square = 4 * stiff * (a**3 / 3 * sunk - moment) + 4 / 15 * stiff * h * force * a**5
        growth = 2 * stiff * a * steep + 2 * stiff * h * force * a**2
        if growth <= 0 or force <= 0:
            return _Pressed(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        power = own / growth * force / a
        effect = -2 / 3 * stiff * place.tilt * a**3 * force * (2 + 3 * power)
        depth = sunk + 0.5 * h * force * a**2 + place.c * force + 0.25 * h * square + effect
        compliance = tangent(a, place) + effect * (1 + 3 * power) / force
        return _Pressed(depth, compliance * growth / own, force, square, growth, compliance)


class _Pressed(NamedTuple):
    """Depth (m) and its derivative by the contact radius, force, ∫ p r², own·dF/da, and dd/dF."""

    depth: float
    slope: float
    force: float
    square: float
    growth: float
    compliance: float


def _contact(a: float, found: _Pressed, place: Place) -> Contact:
    force, stiff, square = found.force, place.plane, found.square / found.force
    of_h = 0.25 * force**2 * square + 4 / 3 * stiff**2 * place.tilt * a**5 * force**3 / found.growth
    of_tilt = -2 / 3 * stiff * a**3 * force**2
    aside_x, aside_y = (
        0.5 * force**2 * slope_c + of_h * slope_h + of_tilt * slope_tilt + 0.5 * found.square * slope_bend
        for slope_c, slope_h, slope_tilt, slope_bend in zip(
            place.slope_c, place.slope_h, place.slope_tilt, place.slope_bend, strict=True
        )
    )
    return Contact(force, (aside_x, aside_y), 1 / found.compliance, a, square)


@dataclass(frozen=True)
class Ball(Round):
    """A sphere of ``radius`` (m)."""

    kind: ClassVar[str] = "sphere"

    radius: float

    def profile(self, s: float) -> tuple[float, float, float, float]:
        """D(s) = s artanh(s/R), by a series without cancellation."""
        t = (s / self.radius) ** 2
        power, sunk, steep, area, moment = t, 0.0, 0.0, 0.0, 0.0
        for odd in range(1, 2 * _TERMS, 2):
            term = power / odd
            sunk += term
            steep += (odd + 1) * term
            area += term / (odd + 2)
            moment += term / (odd + 4)
            if term <= _NEGLIGIBLE * sunk:
                break
            power *= t
        return self.radius * sunk, self.radius / s * steep, self.radius * s * area, self.radius * s**3 * moment

    def first(self, depth: float) -> float:
        """H. Hertz, 1882."""
        return sqrt(self.radius * depth)

    def rise(self, square: Array) -> Array:
        """Beyond its radius the height is constant."""
        return np.asarray(self.radius - np.sqrt(np.maximum(self.radius**2 - square, 0.0)))

    def moment(self, force: float, plane: float) -> tuple[float, float]:
        """By H. Hertz's contact radius."""
        return 0.4 * (0.75 * force * self.radius / plane) ** (2 / 3), 2 / 3


@dataclass(frozen=True)
class Cone(Round):
    """A sharp cone whose flank rises by ``slope`` (1/tan of the half angle to the axis)."""

    kind: ClassVar[str] = "cone"

    slope: float

    def profile(self, s: float) -> tuple[float, float, float, float]:
        """D(s) = π/2·m s (A. E. H. Love, 1939)."""
        steep = 0.5 * pi * self.slope
        return steep * s, steep, steep * s**2 / 2, steep * s**4 / 4

    def first(self, depth: float) -> float:
        """A. E. H. Love, 1939."""
        return 2 / pi * depth / self.slope

    def rise(self, square: Array) -> Array:
        """A straight flank."""
        return np.asarray(self.slope * np.sqrt(square))

    def moment(self, force: float, plane: float) -> tuple[float, float]:
        """By A. E. H. Love's contact radius."""
        return 2 / 3 * force / (pi * plane * self.slope), 1.0


@dataclass(frozen=True)
class Bonded(Disc):
    """A flat round bonded punch of ``radius`` (m), which does not rotate."""

    sticks: ClassVar[bool] = True
    asks_all: ClassVar[bool] = True

    def press(self, depth: float, place: Place, most: float) -> Contact | None:
        """Return the contact at a ``depth`` (m), or nothing if its radius is more than ``most`` (m).

        Normal stiffness by V. I. Mossakovskii (1954), lateral by R. D. Mindlin for a disc without lift-off (1949).
        """
        a, ratio = self.radius, place.poisson
        if a > most or place.shape is None:
            return None
        shear = 0.5 / (1 + ratio)
        soft = 1 - 2 * ratio
        down = 4 * shear * a * (log1p(2 * soft) / soft if soft > _SOFT else 2.0)
        aside = 8 * shear * a / (2 - ratio)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = place.shape.regular
        xx, yy, zz = xx + 1 / aside, yy + 1 / aside, zz + 1 / down + a**2 / 3 * place.h
        # The last column of the inverse, by cofactors.
        flat, to_x, to_y = xx * yy - xy * xy, xy * yz - yy * xz, xy * xz - xx * yz
        share = depth / (xz * to_x + yz * to_y + zz * flat)
        return Contact(share * flat, (share * to_x, share * to_y), share * flat / depth, a, 2 / 3 * a**2)


def tangent(a: float, place: Place) -> float:
    """Return dd/dF (Pa m/N) at a contact radius ``a``, without the effect of the tilt."""
    c, h, stiff = place.c, place.h, place.plane
    return 0.5 / (stiff * a) + c + a**2 / 3 * h - 2 / 45 * stiff * h**2 * a**5


def ball(radius: float) -> Ball:
    """Return the ball of a ``radius`` (m); its series holds up to 0.6 of it."""
    return Ball(0.6 * radius, radius)


def cone(angle: float, radius: float) -> Cone:
    """Return the cone of a half ``angle`` (rad) to the axis that ends at a ``radius`` (m)."""
    return Cone(radius, 1 / tan(angle))
