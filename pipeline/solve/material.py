"""What the body is made of."""

from dataclasses import dataclass
from math import inf

# λ₁ in units of μ, at least: λ₀ may then be −μ/4, and K₀ is definite as long as it is above −2μ/3.
_LEAST_REST = 0.25


@dataclass(frozen=True)
class MaterialLaw:
    """Isotropic linear elasticity: Lamé's λ and μ (Pa) of each region of the mesh, in the order of its numbers.

    λ is infinite where the material is incompressible.
    """

    lame_lambda: tuple[float, ...]
    lame_mu: tuple[float, ...]

    @staticmethod
    def of(lame_lambda: float, lame_mu: float) -> "MaterialLaw":
        """Return the law of a body of one material, from λ and μ (Pa)."""
        return MaterialLaw((lame_lambda,), (lame_mu,))

    @staticmethod
    def of_moduli(young: float, poisson: float) -> "MaterialLaw":
        """Return the law of a body of one material, from Young's modulus (Pa) and Poisson's ratio, 0 to ½."""
        mu = young / (2 * (1 + poisson))
        return MaterialLaw.of(2 * mu * poisson / (1 - 2 * poisson) if poisson < 0.5 else inf, mu)

    @property
    def is_uniform(self) -> bool:
        """Whether there is one material, for all regions that the mesh may have."""
        return len(self.lame_mu) == 1

    @property
    def lame(self) -> tuple[float, float]:
        """λ and μ (Pa) of a body of one material."""
        ((lame_lambda,), (lame_mu,)) = self.lame_lambda, self.lame_mu
        return lame_lambda, lame_mu

    @property
    def poisson(self) -> float:
        """Poisson's ratio of a body of one material."""
        lame_lambda, lame_mu = self.lame
        return 0.5 if lame_lambda == inf else lame_lambda / (2 * (lame_lambda + lame_mu))

    @property
    def ratio(self) -> float:
        """λ/μ of a body of one material: all that F/μ depends on."""
        lame_lambda, lame_mu = self.lame
        return lame_lambda / lame_mu


@dataclass(frozen=True)
class SplitLaw:
    """A law in units of ``unit`` (Pa), with λ = λ₀ + λ₁ split: λ₀ and μ in ``elastic``, 1/λ₁ in ``compliance``."""

    unit: float
    elastic: MaterialLaw
    compliance: tuple[float, ...]

    @staticmethod
    def of(law: MaterialLaw) -> "SplitLaw":
        """Split a law: λ₀ = μ, and less where λ is not much larger than μ, so that λ₁ stays positive."""
        unit = max(law.lame_mu)
        elastic, compliance = [], []
        for lame_lambda, lame_mu in zip(law.lame_lambda, law.lame_mu, strict=True):
            mu = lame_mu / unit
            rest, kept = lame_lambda / unit - mu, mu
            if not law.is_uniform and rest < _LEAST_REST * mu:
                rest = _LEAST_REST * mu
                kept = lame_lambda / unit - rest
            elastic.append(kept)
            compliance.append(0.0 if rest == inf else 1 / rest)
        return SplitLaw(unit, MaterialLaw(tuple(elastic), tuple(mu / unit for mu in law.lame_mu)), tuple(compliance))
