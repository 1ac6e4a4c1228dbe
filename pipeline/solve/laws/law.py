"""A law: its strain energy in two parts, of shape and of volume, and invariants for energies.

    ψ(F) = shape(F) + κ/2 D(F)²

D is the change of volume, J − 1. In mixed elements λ = λ₀ + λ₁ is split: κ is then that of λ₀, and the pressure
p = λ₁ D, an unknown, adds p D(F) − p²/(2λ₁). 1/λ₁ may be 0: the tissue is incompressible. ψ is in J/m³ of undeformed
volume. ``of`` has the parameters by name, numbers or UFL: ``lame_mu`` (Pa), the shear modulus at
small strain, ``lame_lambda`` (Pa), and those that the law names. To second order in F − I, ψ must be linear elasticity
of these λ and μ.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import ufl

Of = Mapping[str, Any]
# The pressure p, and its compliance 1/λ₁.
Pressure = tuple[Any, Any]


def bulk_modulus(of: Of) -> Any:
    """Return K = λ + 2μ/3: κ of a law whose energy of shape does not change with J."""
    return of["lame_lambda"] + 2 / 3 * of["lame_mu"]


def dilation(gradient: Any) -> Any:
    """Return J − 1, J = det F."""
    return ufl.det(gradient) - 1


@dataclass(frozen=True)
class Law:
    """A law; ``parameters`` are those besides λ and μ, ``modulus`` is κ, ``dilation`` is D(F).

    ``shape`` must be NaN or infinite at J ≤ 0: Newton's method rejects inverted tissue by it.
    """

    shape: Callable[[Any, Of], Any]
    parameters: tuple[str, ...] = ()
    modulus: Callable[[Of], Any] = bulk_modulus
    dilation: Callable[[Any], Any] = dilation

    def density(self, gradient: Any, of: Of, pressure: Pressure | None = None) -> Any:
        """Return ψ(F), or with a ``pressure``, to which λ₁ belongs while ``of`` has λ₀, ψ(F, p)."""
        change = self.dilation(gradient)
        energy = self.shape(gradient, of) + self.modulus(of) / 2 * change**2
        if pressure is None:
            return energy
        value, compliance = pressure
        return energy + value * change - compliance * value**2 / 2


def isochoric(gradient: Any) -> tuple[Any, Any]:
    """Return J and the invariant Ī₁ = J^(−2/3) F : F of the change of shape; Ī₁ is NaN or infinite at J ≤ 0."""
    volume = ufl.det(gradient)
    return volume, volume ** (-2 / 3) * ufl.inner(gradient, gradient)


def second_isochoric(gradient: Any, volume: Any) -> Any:
    """Return the invariant Ī₂ = J^(2/3) F⁻¹ : F⁻¹, from cofactors: J^(−4/3) cof F : cof F."""
    cofactor = ufl.cofac(gradient)
    return volume ** (-4 / 3) * ufl.inner(cofactor, cofactor)
