"""A frictionless sharp wedge on a strip bonded to a rigid base, in plane strain, by an integral equation.

With the line load's transform P(ξ) = ∫ φ(t) J₀(ξ t) dt for 0 < t < b, the pressure is (1/π) ∫ φ(t) (t² - y²)^-½ dt for
|y| < t < b, and the surface displacement (2 / π E*) ∫ P(ξ) L(ξ h) / ξ cos(ξ y) dξ. Its slope is that of the wedge, m:

    φ(x) - ∫ φ(t) x ∫ (1 - L(ξ h)) ξ J₀(ξ x) J₀(ξ t) dξ dt = E* m.

The pressure is zero at b for every φ, and the load is ∫ φ dt. On a half-plane φ = E* m, where the pressure is
E* m / π arcosh(b / |y|) (K. L. Johnson, Contact Mechanics, 5.2). L is that of :mod:`epsmesh.layered.compliance`.
"""

from math import pi

import numpy as np
from scipy.special import j0

from epsmesh.layered.body import LayeredBody
from epsmesh.layered.compliance import Layer

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
    share = LayeredBody((Layer(1.0, poisson, 1.0),)).compliance(s)
    bessel = j0(np.outer(t, s / thickness))
    kernel = t[:, None] * ((bessel * ((1 - share) * s * ds / thickness**2)) @ bessel.T)
    phi = np.linalg.solve(np.eye(_ACROSS) - kernel * w, np.full(_ACROSS, slope))
    # ∫ J₀(ξ t) (1 - exp(-ξ h)) / ξ dξ = arsinh(h / t); the remainder of L falls like exp(-ξ h).
    sunk = np.arcsinh(thickness / t) + bessel @ ((share - 1 + np.exp(-s)) / s * ds)
    return float(2 / pi * (phi * w) @ sunk), float(phi @ w)
