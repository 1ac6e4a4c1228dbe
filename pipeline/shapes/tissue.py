"""Material of a region of tissue."""

from math import inf
from typing import Annotated

from pydantic import Field

from pipeline.shapes.section import Section, Words
from pipeline.units import Density, Pressure


class Tissue(Section):
    """Isotropic linear elasticity."""

    young: Annotated[Pressure, Words("Young's modulus.", '"10 kPa"', is_used=True)]
    poisson: Annotated[float, Field(ge=0, le=0.5), Words("Poisson's ratio. 0.5 is incompressible.", "0.45")]

    density: Annotated[
        Density | None,
        Field(json_schema_extra={"unit": "kg/m^3"}),
        Words("Density. Gravity needs it.", '"1060 kg/m^3"', default="none; of regions, the material's"),
    ] = None

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's λ and μ (Pa); λ is infinite for an incompressible material."""
        return lame(self.young, self.poisson)


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Return Lamé's λ and μ (Pa) from Young's modulus (Pa) and Poisson's ratio; λ is infinite for ½."""
    mu = young / (2 * (1 + poisson))
    return (2 * mu * poisson / (1 - 2 * poisson) if poisson < 0.5 else inf), mu
