"""How far waves of pressure displace the surface of elastic layers: L(ξ), by a recursion over their interfaces.

The Hankel transforms U, W, T, S of u_r, u_z, σ_rz, σ_zz at a depth z fulfil y' = ξ A y, with stresses in units of ξ. A
has the eigenvalues ±1, each a Jordan block: (A² - 1)² = 0. So, with N = A² - 1,

    exp(A s) = cosh s + N s sinh(s) / 2 + A (sinh s + N (s cosh s - sinh s) / 2),    s = ξ h.

Both exponentials that grow upwards grow alike. The compliance C, of (U, W) = -C (T, S) at the lower face of a layer,
gives that at its upper one without loss of digits for long or short waves, with exp(-s) taken out of exp(A s). (It is
the transfer matrix of W. T. Thomson, J. Appl. Phys. 21, 89, 1950, in the form of a Riccati recursion.)
"""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray

# What is below a layer of ξ h above this does not move its upper face: exp(-2 ξ h) is below round-off.
_OPAQUE = 25.0


@dataclass(frozen=True)
class Solid:
    """Young's modulus (Pa), infinite if it is rigid, and Poisson's ratio, at most ½."""

    young: float
    poisson: float

    def __post_init__(self) -> None:
        """Refuse what is no elastic solid."""
        if not self.young > 0:
            raise ValueError(f"Young's modulus {self.young:g} Pa must be positive")
        if not -1 < self.poisson <= 0.5:
            raise ValueError(f"Poisson's ratio {self.poisson:g} must be above -1 and at most 0.5")

    @property
    def shear(self) -> float:
        """Shear modulus μ (Pa)."""
        return self.young / (2 * (1 + self.poisson))

    @property
    def plane(self) -> float:
        """Plane-strain modulus E* = E / (1 - ν²) (Pa)."""
        return self.young / (1 - self.poisson**2)


@dataclass(frozen=True)
class Layer(Solid):
    """An elastic layer with its thickness (m), bonded to what is below."""

    thickness: float

    def __post_init__(self) -> None:
        """Refuse a rigid layer, and one without thickness."""
        super().__post_init__()
        if not self.young < np.inf:
            raise ValueError("a layer must not be rigid")
        if not self.thickness > 0:
            raise ValueError(f"the thickness of a layer, {self.thickness:g} m, must be positive")


def compliance(layers: tuple[Layer, ...], base: Solid, wavenumber: FloatArray) -> FloatArray:
    """Return L (n,) at wavenumbers ξ (n,), in 1/m: the surface displacement relative to that of the top's half-space.

    ``layers`` are from the top. A pressure p J₀(ξ r) displaces the surface by 2 L / (E* ξ) p J₀(ξ r), with E* of the
    top. L tends to 1 for short waves.
    """
    top = layers[0] if layers else base
    below = np.zeros((2, 2)) if np.isinf(base.young) else _half_space(base.shear / top.shear, base.poisson)
    yields = np.broadcast_to(below, (len(wavenumber), 2, 2))
    for layer in reversed(layers):
        yields = _above(yields, layer, layer.shear / top.shear, wavenumber * layer.thickness)
    displaced: FloatArray = yields[:, 1, 1] / (1 - top.poisson)
    return displaced


def _half_space(shear: float, poisson: float) -> FloatArray:
    """Return C (2, 2) of a half-space: T and S of its two decaying fields, below their displacements."""
    displacement: FloatArray = np.array([[1.0, 0.0], [1.0, 3 - 4 * poisson]])
    stress: FloatArray = 2 * shear * np.array([[-1.0, 2 * poisson - 1], [-1.0, 2 * poisson - 2]])
    yields: FloatArray = displacement @ np.linalg.inv(-stress)
    return yields


def _above(below: FloatArray, layer: Solid, shear: float, s: FloatArray) -> FloatArray:
    """Return C (n, 2, 2) at the upper face of a layer of s = ξ h (n,), from that at its lower one."""
    nu, s = layer.poisson, np.minimum(s, _OPAQUE)
    bulk = nu / (1 - nu)
    rates = np.array(
        [
            [0.0, 1.0, 1 / shear, 0.0],
            [-bulk, 0.0, 0.0, (1 - 2 * nu) / (2 * shear * (1 - nu))],
            [2 * shear / (1 - nu), 0.0, 0.0, bulk],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )
    nilpotent = rates @ rates - np.eye(4)
    # cosh, sinh and s cosh - sinh, times exp(-s); upwards the sign of A changes.
    fall = np.expm1(-2 * s)
    cosh, sinh, odd = 1 + fall / 2, -fall / 2, s + (s + 1) * fall / 2
    across = (
        np.multiply.outer(cosh, np.eye(4))
        + np.multiply.outer(s * sinh / 2, nilpotent)
        - np.multiply.outer(sinh, rates)
        - np.multiply.outer(odd / 2, rates @ nilpotent)
    )
    displacement = across[:, :2, 2:] - across[:, :2, :2] @ below
    stress = across[:, 2:, 2:] - across[:, 2:, :2] @ below
    yields: FloatArray = displacement @ np.linalg.inv(-stress)
    return yields
