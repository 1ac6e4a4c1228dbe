"""Material of a region of tissue."""

from math import inf
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from pipeline.shapes.section import Section, Words
from pipeline.units import Density, Pressure, Time
from pipeline.viscoelastic import Terms


class Relaxation(Section):
    """A term of a Prony series: a share of the instantaneous modulus, which decays exponentially."""

    name: Annotated[
        str,
        Field(exclude=True, pattern=r"^([A-Za-z][A-Za-z0-9_-]*)?$"),
        Words(
            "Name of the term: letters, digits, _ and -. The dimension of a sweep begins with it: fast_time.",
            '"fast"',
            default="none",
        ),
    ] = ""
    share: Annotated[
        float,
        Field(gt=0, lt=1),
        Words("Share of the instantaneous modulus that relaxes. The sum of all shares is below 1.", "0.4"),
    ]
    time: Annotated[Time, Words("Relaxation time: after it, 37 % of the share are left.", '"2 s"')]


def _below_one(terms: tuple[Relaxation, ...]) -> tuple[Relaxation, ...]:
    total = sum(term.share for term in terms)
    if total >= 1:
        raise PydanticCustomError(
            "not_supported",
            f"shares must have a sum below 1; it is {total:g}, so that the tissue would flow like a fluid",
        )
    return terms


# The keys that each law reads besides young and poisson.
LAWS = MappingProxyType(
    {
        "linear": (),
        "neo-hookean": (),
        "mooney-rivlin": ("c2",),
        "yeoh": ("c2", "c3"),
        "gent": ("limit",),
        "veronda-westmann": ("alpha",),
    }
)
# Values of those that may be omitted.
_DEFAULTS = {"c3": 0.0}
_Tissue = TypeVar("_Tissue", bound="Tissue")


class Tissue(Section):
    """Elasticity: small-strain moduli, and a law."""

    young: Annotated[Pressure, Words("Young's modulus at small strain.", '"10 kPa"', is_used=True)]
    poisson: Annotated[
        float, Field(ge=0, le=0.5), Words("Poisson's ratio at small strain. 0.5 is incompressible.", "0.45")
    ]

    law: Annotated[
        Literal[tuple(LAWS)] | None,  # type: ignore[valid-type]
        Words("Law of the region.", '"neo-hookean"', default="the material's, with its parameters"),
    ] = None
    c2: Annotated[
        float | None,
        Field(ge=-1000, le=1000),
        Words(
            "mooney-rivlin: C2 / (C1 + C2), where C1 (I1 - 3) + C2 (I2 - 3) is the strain energy; from 0 to 1. yeoh: "
            "C2 / C1, where C1 x + C2 x^2 + C3 x^3 is the strain energy and x = I1 - 3.",
            "0.3",
        ),
    ] = None
    c3: Annotated[float | None, Field(ge=0, le=1000), Words("yeoh: C3 / C1.", "0.1", default="0 with yeoh")] = None
    limit: Annotated[
        float | None,
        Field(ge=0.01, le=1e6),
        Words("gent: the value J_m of I1 - 3 at which the tissue cannot be stretched farther.", "2.0"),
    ] = None
    alpha: Annotated[
        float | None,
        Field(ge=0.25, le=100),
        Words("veronda-westmann: exponent of the strain energy. Larger values stiffen at smaller strains.", "2.0"),
    ] = None

    density: Annotated[
        Density | None,
        Field(json_schema_extra={"unit": "kg/m^3"}),
        Words("Density. Gravity needs it.", '"1060 kg/m^3"', default="none; of regions, the material's"),
    ] = None

    relaxation: Annotated[
        tuple[Relaxation, ...],
        AfterValidator(_below_one),
        Words(
            "Relaxation over time, as a Prony series: `young` is then the instantaneous modulus, and Poisson's ratio "
            "is constant. It needs [probe.history].",
            '[{share = 0.4, time = "2 s"}, {share = 0.2, time = "30 s"}]',
            default="none: elastic; of regions, the material's",
        ),
    ] = ()

    @property
    def terms(self) -> Terms:
        """Shares and times (s) of the relaxation, the shortest time first."""
        return tuple(sorted(((term.share, term.time) for term in self.relaxation), key=lambda term: term[1]))

    @property
    def is_large(self) -> bool:
        """Whether displacements are taken to be large: F is then not proportional to the depth."""
        return self.law not in (None, "linear")

    @property
    def further(self) -> dict[str, Any]:
        """The parameters of its law besides young and poisson, by key; None if one is missing."""
        return {key: _DEFAULTS.get(key) if getattr(self, key) is None else getattr(self, key) for key in self._reads}

    def completed(self: _Tissue, material: "Tissue") -> _Tissue:
        """Return this tissue with the law of ``material``, and its parameters, if it has none of its own."""
        if self.law is not None or not material.is_large:
            return self
        return self.model_copy(update={"law": material.law, **material.further})

    @property
    def _reads(self) -> tuple[str, ...]:
        return LAWS[self.law] if self.law is not None else ()

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's λ and μ (Pa); λ is infinite for an incompressible material."""
        return lame(self.young, self.poisson)


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Return Lamé's λ and μ (Pa) from Young's modulus (Pa) and Poisson's ratio; λ is infinite for ½."""
    mu = young / (2 * (1 + poisson))
    return (2 * mu * poisson / (1 - 2 * poisson) if poisson < 0.5 else inf), mu
