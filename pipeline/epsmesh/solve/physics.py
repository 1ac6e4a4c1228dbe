"""Material of each region: its law, by name, and its parameters. The strain energies are in ``laws``."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from types import MappingProxyType
from typing import Any

import numpy as np
import ufl

from epsmesh.arrays import FloatArray, Int32Array, IntArray
from epsmesh.shapes.tissue import lame
from epsmesh.solve.laws import LAWS
from epsmesh.viscoelastic import Terms

# Parameters of every law.
COEFFICIENTS = ("lame_lambda", "lame_mu")
# Least λ₁, in units of μ: λ₀ may then be −μ/4, and K₀ is positive definite as long as λ₀ is above −2μ/3.
_LEAST_REST = 0.25


@dataclass(frozen=True)
class Parameters:
    """Material of one region. Lamé's λ and μ (Pa) are those of small strain; λ is infinite if incompressible.

    ``law`` is one of :data:`epsmesh.solve.laws.LAWS`, ``further`` its parameters besides λ and μ, by name,
    ``relaxation`` its Prony series, which time steps read.
    ``given_poisson`` is Poisson's ratio as given, None if λ and μ were given.
    """

    lame_lambda: float
    lame_mu: float
    given_poisson: float | None = field(default=None, compare=False)
    law: str = "linear"
    further: tuple[tuple[str, float], ...] = ()
    relaxation: Terms = ()

    @staticmethod
    def of_moduli(
        young: float, poisson: float, law: str = "linear", further: Mapping[str, float] = MappingProxyType({})
    ) -> "Parameters":
        """Return parameters from Young's modulus (Pa) and Poisson's ratio, 0 to ½, with the law's ``further`` ones."""
        return Parameters(*lame(young, poisson), poisson, law, tuple(further.items()))

    def value(self, name: str) -> float | None:
        """Return a parameter of a law by its name, None if this law has no such parameter."""
        if name not in COEFFICIENTS and not any(name in law.parameters for law in LAWS.values()):
            raise KeyError(name)
        return getattr(self, name) if name in COEFFICIENTS else dict(self.further).get(name)

    @property
    def poisson(self) -> float:
        """Poisson's ratio."""
        if self.given_poisson is not None:
            return self.given_poisson
        return 0.5 if self.lame_lambda == inf else self.lame_lambda / (2 * (self.lame_lambda + self.lame_mu))

    @property
    def ratio(self) -> float:
        """λ/μ, the only parameter of F/μ."""
        return self.lame_lambda / self.lame_mu

    @property
    def plane_modulus(self) -> float:
        """E / (1 - ν²) (Pa)."""
        return 4 * self.lame_mu * (1 - self.lame_mu / (self.lame_lambda + 2 * self.lame_mu))


@dataclass(frozen=True)
class MaterialLaw:
    """Laws and ``parameters`` of the regions of the mesh, by region number; a single one applies to all regions.

    Moduli are in units of ``unit`` (Pa).
    """

    parameters: tuple[Parameters, ...]
    unit: float = field(default=1.0, compare=False)

    @staticmethod
    def of(lame_lambda: float | Sequence[float], lame_mu: float | Sequence[float]) -> "MaterialLaw":
        """Return linear elasticity from λ and μ (Pa): a number each, or one for each region."""
        if isinstance(lame_lambda, Sequence) and isinstance(lame_mu, Sequence):
            return MaterialLaw(tuple(map(Parameters, lame_lambda, lame_mu)))
        return MaterialLaw((Parameters(lame_lambda, lame_mu),))  # type: ignore[arg-type]

    @staticmethod
    def of_moduli(young: float, poisson: float, law: str = "linear", **further: float) -> "MaterialLaw":
        """Return the law of a body of one material: see :meth:`Parameters.of_moduli`."""
        return MaterialLaw((Parameters.of_moduli(young, poisson, law, further),))

    @property
    def names(self) -> tuple[str, ...]:
        """The name of the law of each region."""
        return tuple(each.law for each in self.parameters)

    @property
    def is_linear(self) -> bool:
        """Whether forces are proportional to displacements."""
        return set(self.names) == {"linear"}

    def values(self, name: str) -> tuple[float, ...]:
        """Return one parameter, by its name, for each region; 1, which no energy reads, where the law lacks it."""
        found = (each.value(name) for each in self.parameters)
        return tuple(1.0 if value is None else value for value in found)

    @cached_property
    def lame_lambda(self) -> tuple[float, ...]:
        """Lamé's λ (Pa) of each region."""
        return tuple(each.lame_lambda for each in self.parameters)

    @cached_property
    def lame_mu(self) -> tuple[float, ...]:
        """Lamé's μ (Pa) of each region."""
        return tuple(each.lame_mu for each in self.parameters)

    @property
    def plane_moduli(self) -> tuple[float, ...]:
        """E / (1 - ν²) (Pa) of each region."""
        return tuple(each.plane_modulus for each in self.parameters)

    def softened(self, ratio: float) -> "MaterialLaw":
        """Return linear elasticity of the same μ, with λ/μ of each region limited to ``ratio``."""
        return MaterialLaw.of([min(each.lame_lambda, ratio * each.lame_mu) for each in self.parameters], self.lame_mu)

    @property
    def is_uniform(self) -> bool:
        """Whether there is only one material."""
        return len(self.parameters) == 1


def of_regions(values: Sequence[float], regions: Int32Array | IntArray | None, count: int) -> FloatArray:
    """Return the value of each of ``count`` cells from ``values`` by region; a single value applies to all cells."""
    if regions is None or len(values) == 1:
        return np.full(count, values[0], dtype=np.float64)
    return np.array(values, dtype=np.float64)[regions[:count]]


@dataclass(frozen=True)
class SplitLaw:
    """A law in units of ``unit`` (Pa), with λ = λ₀ + λ₁ split: λ₀ and μ in ``elastic``, 1/λ₁ in ``compliance``."""

    unit: float
    elastic: MaterialLaw
    compliance: tuple[float, ...]

    @staticmethod
    def of(law: MaterialLaw) -> "SplitLaw":
        """Split a law: λ₀ = μ, or less where λ is not much larger than μ, so that λ₁ stays positive."""
        unit = max(law.lame_mu)
        elastic, compliance = list[Parameters](), []
        for region in law.parameters:
            mu = region.lame_mu / unit
            rest, kept = region.lame_lambda / unit - mu, mu
            if not law.is_uniform and rest < _LEAST_REST * mu:
                rest = _LEAST_REST * mu
                kept = region.lame_lambda / unit - rest
            elastic.append(replace(region, lame_lambda=kept, lame_mu=mu, given_poisson=None))
            compliance.append(0.0 if rest == inf else 1 / rest)
        return SplitLaw(unit, MaterialLaw(tuple(elastic), unit), tuple(compliance))


def strain(u: Any) -> Any:
    """Return the small strain tensor ε(u)."""
    return ufl.sym(ufl.grad(u))


def axisymmetric_strain(u: Any, r: Any) -> Any:
    """Return the strain ε (r, θ, z) of a displacement (u_r, u_z) in the half plane with radius r."""
    slide = (u[0].dx(1) + u[1].dx(0)) / 2
    return ufl.as_tensor([[u[0].dx(0), 0, slide], [0, u[0] / r, 0], [slide, 0, u[1].dx(1)]])


def axisymmetric_gradient(u: Any, r: Any) -> Any:
    """Return the deformation gradient F (r, θ, z) of a displacement (u_r, u_z) in the half plane with radius r."""
    rows = [[u[0].dx(0), 0, u[0].dx(1)], [0, u[0] / r, 0], [u[1].dx(0), 0, u[1].dx(1)]]
    return ufl.Identity(3) + ufl.as_tensor(rows)


def plane_gradient(u: Any) -> Any:
    """Return the deformation gradient F (x, y, z) of a displacement (u_x, u_z) in plane strain."""
    return ufl.Identity(3) + ufl.as_tensor([[u[0].dx(0), 0, u[0].dx(1)], [0, 0, 0], [u[1].dx(0), 0, u[1].dx(1)]])


def small_strain(strain: Any, lame_lambda: Any, lame_mu: Any) -> Any:
    """Linear elasticity: λ/2 (tr ε)² + μ ε : ε."""
    return lame_lambda / 2 * ufl.tr(strain) ** 2 + lame_mu * ufl.inner(strain, strain)


def pressurised(strain: Any, lame_lambda: Any, lame_mu: Any, pressure: Any, compliance: Any) -> Any:
    """Linear elasticity, with λ₁ added to λ by a pressure p = λ₁ tr ε and the compliance 1/λ₁; stationary in both."""
    return small_strain(strain, lame_lambda, lame_mu) + pressure * ufl.tr(strain) - compliance * pressure**2 / 2
