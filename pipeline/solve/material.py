"""What the body is made of."""

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class MaterialLaw:
    """Isotropic linear elasticity: Lamé's λ and μ (Pa) of each region of the mesh, in the order of its numbers.

    λ is infinite where the material is incompressible. Meshes have one region today.
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
