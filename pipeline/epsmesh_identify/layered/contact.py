"""A frictionless round tool on elastic layers, by an integral equation: depth, force and stiffness at contact radii.

The pressure p(r) = (E*/2) ∫ ξ A(ξ) J₀(ξ r) dξ, with A(ξ) = ∫ φ(t) cos(ξ t) dt for 0 < t < a, displaces the surface by
∫ A(ξ) L(ξ) J₀(ξ r) dξ. Below the tool this is d - f(r):

    φ(x) - (2/π) ∫ φ(t) K(x, t) dt = (2/π) (d - x ∫ f'(x sin s) ds),    K = ∫ (1 - L(ξ)) cos(ξ x) cos(ξ t) dξ,

for 0 < s < π/2. The force is π E* ∫ φ dt; if the contact radius is free, φ(a) = 0. (N. N. Lebedev and Ya. S. Ufliand,
J. Appl. Math. Mech. 22, 442, 1958; I. N. Sneddon, Mixed Boundary Value Problems in Potential Theory, 1966.) E* and L
are those of the top. The kernel is smooth, so Gauss' points converge to round-off.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, inf, log2, pi

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.layered.compliance import Layer, Solid, compliance

# 1 - L falls like (ξ h)² exp(-2 ξ h), h the top layer's thickness: below round-off from ξ h here on.
_LAST = 20.0
# Gauss' points of a panel of waves, which is at most twice as far from 0 as it is long, and spans at most one wave.
_PANEL = 16
# Waves that are so much longer than all layers together see a base only.
_LONGEST = 1e-3
# Gauss' points along a contact radius, at least, and more for each thickness of the top layer.
_LEAST, _MORE = 20, 8
# So many radii are solved for at once, if contact is less wide than so many thicknesses of the top layer.
_AT_ONCE, _WIDE = 8, 15.0
# Widest contact, in thicknesses of the top layer: a table then takes seconds.
WIDEST = 50.0
# Gauss' points over a quarter of a turn, of each part between kinks.
_TURN = 32


@dataclass(frozen=True)
class Profile:
    """The section of a round tool: its ``slope`` (n,) at distances (n,) from the axis (m).

    The tool ends at the radius ``limit`` (m). It is flat up to the radius ``flat`` (m), all of it if that is its limit.
    ``kinks`` are radii (m) at which the slope is not smooth.
    """

    slope: Callable[[FloatArray], FloatArray]
    limit: float = inf
    flat: float = 0.0
    kinks: tuple[float, ...] = ()

    @property
    def breaks(self) -> tuple[float, ...]:
        """Radii (m) off the axis at which the slope is not smooth, in order."""
        return tuple(sorted({radius for radius in (*self.kinks, self.flat) if radius > 0}))

    def sneddon(self, x: FloatArray) -> FloatArray:
        """Return x ∫ f'(x sin s) ds over a quarter turn: the depths (m) of contact radii x (n,) on a half-space."""
        if self.flat >= self.limit:
            return np.zeros_like(x)
        nodes, weights = _gauss(_TURN)
        total, start = np.zeros_like(x), np.zeros_like(x)
        for radius in (*self.breaks, inf):
            end = np.arcsin(np.minimum(1.0, radius / x))
            half = (end - start) / 2
            angles = start[:, None] + half[:, None] * (nodes + 1)
            total += half * (self.slope(x[:, None] * np.sin(angles)) @ weights)
            start = end
        return x * total


def flat(radius: float) -> Profile:
    """Return the section of a flat disc of a ``radius`` (m)."""
    return Profile(np.zeros_like, limit=radius, flat=radius)


@dataclass(frozen=True)
class Touch:
    """Depth (m), F / E* (m²) and its slope over depth (m) at contact radii (m), all (n,)."""

    radius: FloatArray
    depth: FloatArray
    force: FloatArray
    stiffness: FloatArray


def touch(layers: tuple[Layer, ...], base: Solid, profile: Profile, radius: FloatArray) -> Touch:
    """Return depth, force and stiffness of a tool in contact up to each ``radius`` (n,), in m.

    The force is relative to E* of the top. As contact grows, F changes as if its edge did not move: the stiffness is
    that of a flat punch. If ``profile`` is flat, depths are 0: F is its stiffness times the depth.
    """
    top = layers[0].thickness if layers else inf
    if (widest := float(np.max(radius))) > WIDEST * top:
        raise ValueError(too_wide(widest, top))
    size = _AT_ONCE if widest < _WIDE * top else 1
    parts = [_together(layers, base, profile, some) for some in np.split(radius, range(size, len(radius), size))]
    return Touch(radius, *np.concatenate(parts, axis=1))


def too_wide(radius: float, top: float) -> str:
    """Return that contact of a ``radius`` (m) is too wide for a top layer of a thickness (m)."""
    return f"contact of radius {radius:.3g} m is too wide for a top layer of {top:.3g} m: at most {WIDEST:g} times"


def _together(
    layers: tuple[Layer, ...], base: Solid, profile: Profile, radius: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return depth, force and stiffness (n,) at each radius (n,), with the points that the largest needs."""
    widest, top = float(np.max(radius)), layers[0].thickness if layers else inf
    waves, weights = waves_below(layers, widest)
    weights = weights * (1 - compliance(layers, base, waves))
    return _solved(profile, radius, waves, weights, _LEAST + ceil(_MORE * widest / top))


def _solved(
    profile: Profile, radius: FloatArray, waves: FloatArray, weights: FloatArray, points: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return depth, force and stiffness (n,), with ``points`` along each part of the radius (n,)."""
    x, w = _along(profile, radius, points)
    # φ = d φ₁ - φ₂: φ₁ for a flat punch at unit depth, φ₂ for the tool's shape.
    at = np.append(x, radius[:, None], axis=1)
    cosine = np.cos(np.multiply.outer(at, waves))
    kernel = 2 / pi * (cosine * weights) @ cosine[:, :-1].swapaxes(1, 2) * w[:, None]
    shape = 2 / pi * profile.sneddon(at.ravel()).reshape(at.shape)
    right = np.stack([np.full_like(x, 2 / pi), shape[:, :-1]], axis=2)
    phi = np.linalg.solve(np.eye(x.shape[1]) - kernel[:, :-1], right)
    punch, shaped = pi * np.einsum("ni,nij->jn", w, phi)
    if profile.flat >= profile.limit:
        return np.zeros_like(radius), np.zeros_like(radius), punch
    edge = np.einsum("ni,nij->jn", kernel[:, -1], phi)
    depth = (shape[:, -1] + edge[1]) / (2 / pi + edge[0])
    return depth, depth * punch - shaped, punch


def _along(profile: Profile, radius: FloatArray, points: int) -> tuple[FloatArray, FloatArray]:
    """Return points and weights (n, m) from 0 to each radius (n,), in parts between kinks; those beyond weigh 0."""
    nodes, weights = _gauss(points)
    within = [kink for kink in profile.breaks if kink < np.max(radius)]
    ends = np.stack([np.minimum(end, radius) for end in (0.0, *within, inf)])
    half = np.diff(ends, axis=0).T / 2
    x = (ends[:-1].T + half)[:, :, None] + np.multiply.outer(half, nodes)
    return x.reshape(len(radius), -1), np.multiply.outer(half, weights).reshape(len(radius), -1)


def waves_below(layers: tuple[Layer, ...], widest: float) -> tuple[FloatArray, FloatArray]:
    """Return points and weights of a quadrature over the wavenumbers (1/m) that see below the top layer.

    They resolve the waves between points that are ``widest`` (m) apart.
    """
    if not layers:
        return np.zeros(0), np.zeros(0)
    first = _LONGEST / sum(layer.thickness for layer in layers)
    last = _LAST / layers[0].thickness
    doubled = first * 2 ** np.arange(ceil(log2(last / first)) + 1)
    ends = [0.0]
    for end in doubled:
        panels = max(1, ceil((end - ends[-1]) * widest / pi))
        ends.extend(np.linspace(ends[-1], end, panels + 1)[1:])
    nodes, weights = _gauss(_PANEL)
    half = np.diff(ends) / 2
    return (ends[:-1] + half + np.multiply.outer(nodes, half)).T.ravel(), np.multiply.outer(half, weights).ravel()


@lru_cache
def _gauss(points: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(points)
