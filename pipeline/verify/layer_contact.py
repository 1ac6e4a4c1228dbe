"""A frictionless round tool on an elastic layer bonded to a rigid base, by an integral equation.

The pressure p(r) = (E*/2) ∫ ξ A(ξ) J₀(ξ r) dξ, with A(ξ) = ∫ φ(t) cos(ξ t) dt for 0 < t < a, displaces the surface by
∫ A(ξ) L(ξ h) J₀(ξ r) dξ. Below the tool this is d - f(r):

    φ(x) - (2/π) ∫ φ(t) K(x, t) dt = (2/π) (d - x ∫ f'(x sin s) ds),    K = ∫ (1 - L(ξ h)) cos(ξ x) cos(ξ t) dξ,

for 0 < s < π/2. The force is π E* ∫ φ dt; if the contact radius is free, φ(a) = 0. (N. N. Lebedev and Ya. S. Ufliand,
J. Appl. Math. Mech. 22, 442, 1958, with L of I. I. Vorovich et al., 1974.)
"""

from collections.abc import Callable
from math import pi

import numpy as np

from pipeline.arrays import FloatArray

# Gauss points along the radius, over a quarter of a turn, and along ξ h up to where 1 - L is below 1e-16.
_RADIAL, _TURN, _WAVES, LAST = 64, 64, 400, 24.0


def layer_contact(
    slope: Callable[[FloatArray], FloatArray], radius: float, thickness: float, poisson: float
) -> tuple[float, float]:
    """Return depth (m) and F / E* (m²) of a tool with this ``slope`` for a contact ``radius`` (m)."""
    nodes, weights = np.polynomial.legendre.leggauss(_RADIAL)
    x, w = radius * (nodes + 1) / 2, radius * weights / 2
    at = np.append(x, radius)
    turn, turned = np.polynomial.legendre.leggauss(_TURN)
    sine = np.sin(pi / 4 * (turn + 1))
    shape = at * (slope(at[:, None] * sine) @ (pi / 4 * turned))
    kernel = 2 / pi * _kernel(at, x, thickness, poisson)
    matrix = np.eye(_RADIAL) - kernel[:-1] * w
    # φ = d φ₁ - φ₂: φ₁ for a flat punch at unit depth, φ₂ for the tool's shape.
    punch, shaped = np.linalg.solve(matrix, 2 / pi * np.column_stack([np.ones(_RADIAL), shape[:-1]])).T
    last = kernel[-1] * w
    depth = (2 / pi * shape[-1] + last @ shaped) / (2 / pi + last @ punch)
    return float(depth), pi * float(w @ (depth * punch - shaped))


def _kernel(x: FloatArray, t: FloatArray, thickness: float, poisson: float) -> FloatArray:
    nodes, weights = np.polynomial.legendre.leggauss(_WAVES)
    s, w = LAST * (nodes + 1) / 2, LAST * weights / 2
    waves = (1 - layer_share(s, poisson)) * w / thickness
    return np.asarray((np.cos(np.outer(x, s / thickness)) * waves) @ np.cos(np.outer(s / thickness, t)))


def layer_share(s: FloatArray, poisson: float) -> FloatArray:
    """Return L at s = ξ h: the displacement of a layer by a pressure wave, in units of that of a half-space."""
    kappa = 3 - 4 * poisson
    return np.asarray((2 * kappa * np.sinh(2 * s) - 4 * s) / (2 * kappa * np.cosh(2 * s) + 1 + kappa**2 + 4 * s**2))
