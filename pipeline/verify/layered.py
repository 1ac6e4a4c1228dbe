"""A frictionless flat disc on a layer bonded to a half-space, or to a rigid base, by an integral equation.

The code is independent of the rest of the program. Hankel transforms reduce both solids to ordinary differential
equations in depth (D. M. Burmister, J. Appl. Phys. 16, 89, 1945): a pressure p J₀(kr) displaces the surface by

    (1 - ν) / (μ k) H(kh) p J₀(kr),

ν, μ and h the layer's. H is 1 for waves that are short beside h; for long ones the base's compliance over the layer's.
The mixed conditions make dual integral equations (I. N. Sneddon, Mixed Boundary Value Problems in Potential Theory,
1966). A pressure whose transform is p(k) = μ / (1 - ν) ∫₀ᵃ φ(t) cos(kt) dt vanishes beside the disc, and below it the
surface sinks by d everywhere if, for 0 < s < a,

    φ(s) + 2/π ∫₀ᵃ φ(t) ∫₀^∞ (H(kh) - 1) cos(ks) cos(kt) dk dt = 2 d / π,

a Fredholm equation of the second kind with a smooth kernel, which Gauss' points take to round-off. F is 2 π p(0).
"""

from dataclasses import dataclass
from math import ceil, pi

import numpy as np

from pipeline.arrays import FloatArray

SOURCE = "integral equation (D. M. Burmister 1945, I. N. Sneddon 1966)"
# H - 1 falls like k² exp(-2 k h): below round-off from here on, in units of 1 / h.
_LAST = 22.0
# Gauss' points of one panel, which is as long as h in t, and at most as long as one wave of the kernel in k.
_POINTS = 16


@dataclass(frozen=True)
class Solid:
    """Young's modulus (Pa), infinite if it is rigid, and Poisson's ratio."""

    young: float
    poisson: float

    @property
    def shear(self) -> float:
        """Shear modulus μ (Pa)."""
        return self.young / (2 * (1 + self.poisson))


def layered_disc(layer: Solid, thickness: float, base: Solid, radius: float, depth: float) -> float:
    """Return F (N) of a frictionless disc that is pressed by ``depth`` (m) onto a layer on a half-space.

    To a relative error of 1e-9 up to a disc ten times as wide as the layer is thick (m).
    """
    a = radius / thickness
    t, step = _gauss(a, ceil(a))
    k, weight = _gauss(_LAST, ceil(_LAST * (1 + a / pi)))
    waves = np.cos(np.outer(t, k))
    kernel = 2 / pi * (waves * (weight * (surface_compliance(layer, base, k) - 1))) @ waves.T
    phi = np.linalg.solve(np.eye(len(t)) + kernel * step, np.full(len(t), 2 * depth / pi))
    return float(2 * pi * layer.shear / (1 - layer.poisson) * thickness * (step @ phi))


def added_compliance(layer: Solid, thickness: float, base: Solid) -> tuple[float, float]:
    """Return the compliance that the base adds to a small tool's on a half-space of the layer: c (1/m), g (1/m³).

    The displacement by a point force is larger by c / E at the force. For points at distances s and s' from a centre it
    is larger by (c + g (s² + s'²)/2) / E, in the mean over directions: J₀ of the waves to second order.
    """
    k, weight = _gauss(_LAST, ceil(_LAST))
    beyond = weight * (surface_compliance(layer, base, k) - 1)
    scale = (1 - layer.poisson**2) / pi
    return scale * float(beyond.sum()) / thickness, -scale / 2 * float(beyond @ k**2) / thickness**3


def surface_compliance(layer: Solid, base: Solid, k: FloatArray) -> FloatArray:
    """Return H of waves ``k`` (n,), in units of 1 / h: their displacement, relative to a half-space of the layer."""
    nothing = np.zeros_like(k)
    # The layer has four fields: two decay from its upper face, two, mirrored, from its lower one. The base has two.
    top = np.concatenate([_fields(layer, nothing), _MIRROR @ _fields(layer, k)], axis=2)
    bottom = np.concatenate([_fields(layer, k), _MIRROR @ _fields(layer, nothing)], axis=2)
    softer = np.array([layer.shear / base.shear] * 2 + [1.0] * 2)
    below = softer[:, None] * _fields(base, nothing)
    system, load = np.zeros((len(k), 6, 6)), np.zeros((len(k), 6, 1))
    system[:, :2, :4] = top[:, 2:]
    system[:, 2:, :4], system[:, 2:, 4:] = bottom, -below
    load[:, 1] = -1.0
    amplitudes = np.linalg.solve(system, load)[:, :4, 0]
    sunk: FloatArray = np.sum(top[:, 1] * amplitudes, axis=1) / (2 * (1 - layer.poisson))
    return sunk


# Signs of a field's components under reflection of the depth.
_MIRROR = np.diag([1.0, -1.0, -1.0, 1.0])


def _fields(solid: Solid, depth: FloatArray) -> FloatArray:
    """Return the two fields of a solid that decay with ``depth`` (n,), in units of 1 / k, from a face: (n, 4, 2).

    Each is u_r, u_z, σ_rz, σ_zz, with stresses in units of 2 μ k: the gradient of exp(-kz) J₀(kr), and the field of
    the Papkovich potential exp(-kz) J₀(kr) along z.
    """
    nu, one = solid.poisson, np.ones_like(depth)
    gradient = np.stack([one, one, -one, -one], axis=1)
    potential = np.stack([depth, 3 - 4 * nu + depth, 2 * nu - 1 - depth, 2 * nu - 2 - depth], axis=1)
    return np.stack([gradient, potential], axis=2) * np.exp(-depth)[:, None, None]


def _gauss(end: float, panels: int) -> tuple[FloatArray, FloatArray]:
    """Return points and weights of Gauss quadrature from 0 to ``end``, on ``panels`` panels of equal length."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    half = end / panels / 2
    centres = half * (2 * np.arange(panels) + 1)
    return (centres[:, None] + half * points).ravel(), np.tile(half * weights, panels)
