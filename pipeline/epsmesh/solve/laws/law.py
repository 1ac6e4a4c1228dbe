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
from functools import cached_property
from typing import Any

import ufl

Of = Mapping[str, Any]
# The pressure p, and its compliance 1/λ₁.
Pressure = tuple[Any, Any]


def bulk_modulus(of: Of) -> Any:
    """Return K = λ + 2μ/3: κ of a law whose energy of shape does not change with J."""
    return of["lame_lambda"] + 2 / 3 * of["lame_mu"]


class Shape:
    """A deformation: its ``gradient`` F, and the invariants that an energy of it reads.

    Invariants are UFL variables of the ``parts``, F : F, cof F : cof F, J and |F a|². The derivatives of an energy by
    them are scalars: the code of a tangent is several times shorter than by the derivatives of all steps of the energy.
    """

    def __init__(self, gradient: Any):
        self.gradient = gradient
        self.parts: dict[Any, Any] = {}

    @cached_property
    def volume(self) -> Any:
        """J = det F."""
        return self.part(ufl.det(self.gradient))

    @cached_property
    def first(self) -> Any:
        """The invariant Ī₁ = J^(−2/3) F : F of the change of shape; NaN or infinite at J ≤ 0."""
        return self.volume ** (-2 / 3) * self.part(ufl.inner(self.gradient, self.gradient))

    @cached_property
    def second(self) -> Any:
        """The invariant Ī₂ = J^(2/3) F⁻¹ : F⁻¹, from cofactors: J^(−4/3) cof F : cof F."""
        cofactor = ufl.cofac(self.gradient)
        return self.volume ** (-4 / 3) * self.part(ufl.inner(cofactor, cofactor))

    def fourth(self, direction: Any) -> Any:
        """Return the invariant Ī₄ = J^(−2/3) |F a|² of a unit vector a."""
        along = self.gradient * direction
        return self.volume ** (-2 / 3) * self.part(ufl.inner(along, along))

    def part(self, expression: Any) -> Any:
        """Return a variable for an ``expression`` of the gradient."""
        variable = ufl.variable(expression)
        self.parts[variable] = expression
        return variable


@dataclass(frozen=True)
class Energy:
    """An energy density, or a derivative of it: the sum of products of two factors, in ``terms``.

    The first factor depends on the displacement by the ``parts`` alone, if there are any, the second directly.
    """

    terms: tuple[tuple[Any, Any], ...]
    parts: Mapping[Any, Any]

    @property
    def value(self) -> Any:
        """The sum."""
        return sum(scalar if factor is None else scalar * factor for scalar, factor in self.terms)

    def derivative(self, field: Any, direction: Any, *, of_shape: bool = True) -> "Energy":
        """Return the derivative by a ``field``; ``of_shape`` if that is the displacement."""
        if not (self.parts and of_shape):
            return Energy(tuple((ufl.derivative(a, field, direction), b) for a, b in self.terms), self.parts)
        changes = {part: ufl.derivative(expression, field, direction) for part, expression in self.parts.items()}
        found = []
        for scalar, factor in self.terms:
            found += [
                (ufl.diff(scalar, part), change if factor is None else factor * change)
                for part, change in changes.items()
            ]
            if factor is not None:
                found.append((scalar, ufl.derivative(factor, field, direction)))
        return Energy(tuple(found), self.parts)


def dilation(shape: Shape) -> Any:
    """Return J − 1, J = det F."""
    return shape.volume - 1


@dataclass(frozen=True)
class Law:
    """A law; ``parameters`` are those besides λ and μ, ``modulus`` is κ, ``dilation`` is D(F).

    ``shape`` must be NaN or infinite at J ≤ 0: Newton's method rejects inverted tissue by it. Both functions read
    either the invariants of a :class:`Shape`, or its gradient.
    """

    shape: Callable[[Shape, Of], Any]
    parameters: tuple[str, ...] = ()
    modulus: Callable[[Of], Any] = bulk_modulus
    dilation: Callable[[Shape], Any] = dilation

    def density(self, gradient: Any, of: Of, pressure: Pressure | None = None) -> Energy:
        """Return ψ(F), or with a ``pressure``, to which λ₁ belongs while ``of`` has λ₀, ψ(F, p)."""
        shape = Shape(gradient)
        change = self.dilation(shape)
        energy = self.shape(shape, of) + self.modulus(of) / 2 * change**2
        if pressure is not None:
            value, compliance = pressure
            energy = energy + value * change - compliance * value**2 / 2
        return Energy(((energy, None),), shape.parts)
