"""A frictionless sharp wedge on a strip bonded to a rigid base, in plane strain, by an integral equation.

With the line load's transform P(ξ) = ∫ φ(t) J₀(ξ t) dt for 0 < t < b, the pressure is (1/π) ∫ φ(t) (t² - y²)^-½ dt for
|y| < t < b, and the surface displacement (2 / π E*) ∫ P(ξ) L(ξ h) / ξ cos(ξ y) dξ. Its slope is that of the wedge, m:

    φ(x) - ∫ φ(t) x ∫ (1 - L(ξ h)) ξ J₀(ξ x) J₀(ξ t) dξ dt = E* m.

The pressure is zero at b for every φ, and the load is ∫ φ dt. On a half-plane φ = E* m, where the pressure is
E* m / π arcosh(b / |y|) (K. L. Johnson, Contact Mechanics, 5.2). For a
layer on a rigid base, with κ = 3 - 4 ν and w = ξ h, it is

    L(w) = (2 κ sinh 2w - 4 w) / (2 κ cosh 2w + 1 + κ² + 4 w²)

(N. N. Lebedev, Ya. S. Ufliand, PMM 22, 320, 1958).
"""

from math import pi

import numpy as np
from scipy.special import j0

from epsmesh.arrays import FloatArray

# Gauss points across the contact, and along ξ h up to where 1 - L is below 1e-16.
_ACROSS, _WAVES, _LAST = 64, 400, 24.0


def layer_wedge(slope: float, half_width: float, thickness: float, poisson: float) -> tuple[float, float]:
    """Return depth (m) and F / E* per length (m) of a wedge with this ``slope`` for a contact ``half_width`` (m).

    ``thickness`` is in m.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_ACROSS)
    # Denser points at the edge of the wedge, where the depth's integrand is logarithmic.
    root = (nodes + 1) / 2
    t, w = half_width * root**2, half_width * root * weights
    waves, strength = np.polynomial.legendre.leggauss(_WAVES)
    s, ds = _LAST * (waves + 1) / 2, _LAST * strength / 2
    share = _layer(s, poisson)
    bessel = j0(np.outer(t, s / thickness))
    kernel = t[:, None] * ((bessel * ((1 - share) * s * ds / thickness**2)) @ bessel.T)
    phi = np.linalg.solve(np.eye(_ACROSS) - kernel * w, np.full(_ACROSS, slope))
    # ∫ J₀(ξ t) (1 - exp(-ξ h)) / ξ dξ = arsinh(h / t); the remainder of L falls like exp(-ξ h).
    sunk = np.arcsinh(thickness / t) + bessel @ ((share - 1 + np.exp(-s)) / s * ds)
    return float(2 / pi * (phi * w) @ sunk), float(phi @ w)


def _layer(s: FloatArray, poisson: float) -> FloatArray:
    """Return L at ξ h = ``s``, with exp(2 s) taken out of both parts of the fraction."""
    kappa, fall = 3 - 4 * poisson, np.exp(-2 * s)
    above = kappa * (1 - fall**2) - 4 * s * fall
    below = kappa * (1 + fall**2) + (1 + kappa**2 + 4 * s**2) * fall
    found: FloatArray = above / below
    return found
