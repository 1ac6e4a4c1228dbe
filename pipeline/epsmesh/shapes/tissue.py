"""Material of a region of tissue."""

from math import hypot, inf, log1p
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, Field, ModelWrapValidatorHandler, PrivateAttr, model_validator
from pydantic_core import PydanticCustomError

from epsmesh.shapes.frame import Vector
from epsmesh.shapes.section import OptionalName, Section, Words, in_mm
from epsmesh.shapes.varying import Varying
from epsmesh.units import Density, Length, Pressure, Share, Time
from epsmesh.viscoelastic import Terms


class Relaxation(Section):
    """A term of a Prony series: a share of the instantaneous modulus, which decays exponentially."""

    name: Annotated[
        OptionalName,
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
        "ogden": ("terms",),
        "gent": ("limit",),
        "holzapfel": ("fibres",),
        "veronda-westmann": ("alpha",),
    }
)
# These, and that of the law itself.
KEYS_OF_LAWS = ("law", *sorted({key for keys in LAWS.values() for key in keys}))
# Names that solvers have for the direction of fibres.
FIBRE = ("fibre_x", "fibre_y", "fibre_z")
# Tolerance of directions and of a dispersion.
_ALIGNED = 1e-9
# Most terms of Ogden's law.
MOST_TERMS = 3
# Of parameters, as the reference says it.
_OF_LAW = "none; required with this law, but where it is the material's"
# Values of those that may be omitted.
_DEFAULTS = {"c3": 0.0}
_Tissue = TypeVar("_Tissue", bound="Tissue")


class Term(Section):
    """One term of Ogden's law."""

    name: Annotated[
        OptionalName,
        Words(
            "Name of the term: letters, digits, _ and -. The dimension of a sweep begins with it: steep_alpha.",
            '"steep"',
            default="none: the dimension is share or alpha",
        ),
    ] = ""
    share: Annotated[
        float | None,
        Field(gt=0, le=1),
        Words("Share of the shear modulus. The shares of all terms add up to 1.", "0.3", default="the rest of 1"),
    ] = None
    alpha: Annotated[
        float,
        Field(ge=-50, le=50),
        Words("Exponent of the stretches: 2 is a neo-Hookean term, -2 one of C2 in Mooney-Rivlin. Not 0.", "9.0"),
    ]


class Fibres(Section):
    """Fibres of Holzapfel's law."""

    direction: Annotated[
        tuple[float, float, float],
        Words("Direction of the fibres, in the coordinates of the body. Its length has no effect.", "[1, 0, 0]"),
    ]
    k1: Annotated[
        float,
        Field(ge=0, le=1000),
        Words("Stiffness of the fibres, in units of young. The strain energy is k1/(2 k2) (exp(k2 E^2) - 1).", "0.5"),
    ]
    k2: Annotated[
        float,
        Field(ge=1e-3, le=1000),
        Words("Exponent of the fibres: larger values stiffen at smaller strains.", "2.0"),
    ]
    dispersion: Annotated[
        float,
        Field(ge=0, le=1 / 3),
        Words("Dispersion of the directions: 0 is a single direction, 1/3 is isotropic.", "0.1"),
    ] = 0.0

    @property
    def unit(self) -> Vector:
        """The unit vector of the direction."""
        length = hypot(*self.direction)
        x, y, z = (component / length for component in self.direction)
        return x, y, z

    def is_mirrored(self, normal: Vector) -> bool:
        """Return whether they are their own image in a plane with that unit normal."""
        along = abs(sum(a * b for a, b in zip(self.unit, normal, strict=True)))
        return self.is_isotropic or along < _ALIGNED or along > 1 - _ALIGNED

    @property
    def is_isotropic(self) -> bool:
        """Whether their direction has no effect."""
        return self.k1 == 0 or self.dispersion > 1 / 3 - _ALIGNED


class Spread(Section):
    """What is not known of Young's modulus within a tissue: a random field about it.

    ln E is normally distributed, and Matérn's covariance of smoothness 3/2 is that of ln E at two places. The mean of E
    is ``young`` of the tissue, or its field.
    """

    young: Annotated[
        Share,
        Field(gt=0, le=1),
        Words(
            "Standard deviation of Young's modulus at a place, relative to its mean, which is the tissue's `young`.",
            '"30 %"',
        ),
    ]
    correlation_length: Annotated[
        Length,
        Words(
            "Distance l over which the modulus stays alike: the correlation at a distance r is "
            "(1 + sqrt(3) r/l) exp(-sqrt(3) r/l), 0.48 at l.",
            '"5 mm"',
        ),
    ]

    @property
    def deviation(self) -> float:
        """The standard deviation of ln E."""
        return log1p(self.young**2) ** 0.5

    def __str__(self) -> str:
        return f"\N{PLUS-MINUS SIGN} {100 * self.young:.3g} % over {in_mm(self.correlation_length)}"


def name_in_term(own: str, number: int, key: str) -> str:
    """Return the name of a key of a table of a list, the ``number``-th from 0, which may have its ``own`` name."""
    return f"{own}_{key}" if own else f"{key}_{number + 1}"


class _Young(BaseModel):
    """A modulus that is a table; errors then have the place of the table."""

    young: Varying


class Tissue(Section):
    """Elasticity: small-strain moduli, and a law.

    Of a modulus that varies, ``young`` is what ``varying``, the field, is relative to.
    """

    young: Annotated[
        Pressure,
        Words("Young's modulus at small strain, or its field.", '"10 kPa"', is_used=True, takes="pressure > 0 | table"),
    ]
    poisson: Annotated[
        float, Field(ge=0, le=0.5), Words("Poisson's ratio at small strain. 0.5 is incompressible.", "0.45")
    ]

    law: Annotated[
        Literal[tuple(LAWS)] | None,  # type: ignore[valid-type]
        Words(
            "Law of the region.",
            '"neo-hookean"',
            default="the material's, with its parameters; linear where layers fill the body",
        ),
    ] = None
    c2: Annotated[
        float | None,
        Field(ge=-1000, le=1000),
        Words(
            "mooney-rivlin: C2 / (C1 + C2), where C1 (I1 - 3) + C2 (I2 - 3) is the strain energy; from 0 to 1. yeoh: "
            "C2 / C1, where C1 x + C2 x^2 + C3 x^3 is the strain energy and x = I1 - 3.",
            "0.3",
            default=_OF_LAW,
        ),
    ] = None
    c3: Annotated[float | None, Field(ge=0, le=1000), Words("yeoh: C3 / C1.", "0.1", default="0 with yeoh")] = None
    terms: Annotated[
        tuple[Term, ...],
        Words("ogden: one to three terms of the strain energy.", "[{share = 0.7, alpha = 2.0}, {alpha = 9.0}]"),
    ] = ()
    fibres: Annotated[
        Fibres | None,
        Words(
            "holzapfel: fibres in a neo-Hookean tissue of young and poisson. They bear tension alone.",
            "{direction = [1, 0, 0], k1 = 0.5, k2 = 2.0}",
            default=_OF_LAW,
        ),
    ] = None
    limit: Annotated[
        float | None,
        Field(ge=0.01, le=1e6),
        Words("gent: the value J_m of I1 - 3 at which the tissue cannot be stretched farther.", "2.0", default=_OF_LAW),
    ] = None
    alpha: Annotated[
        float | None,
        Field(ge=0.25, le=100),
        Words(
            "veronda-westmann: exponent of the strain energy. Larger values stiffen at smaller strains.",
            "2.0",
            default=_OF_LAW,
        ),
    ] = None

    density: Annotated[
        Density | None,
        Field(json_schema_extra={"unit": "kg/m^3"}),
        Words(
            "Density. Gravity needs it.",
            '"1060 kg/m^3"',
            default="none; of regions, the material's, none where layers fill the body",
        ),
    ] = None

    relaxation: Annotated[
        tuple[Relaxation, ...],
        AfterValidator(_below_one),
        Words(
            "Relaxation over time, as a Prony series: `young` is then the instantaneous modulus, and Poisson's ratio "
            "is constant. It needs [probe.history]. Regions that relax differently are computed in time steps.",
            '[{share = 0.4, time = "2 s"}, {share = 0.2, time = "30 s"}]',
            default="none: elastic; of regions, the material's, none where layers fill the body",
        ),
    ] = ()

    spread: Annotated[
        Spread | None,
        Words(
            "Random deviation of Young's modulus from place to place: `force_uncertainty_tissue` is what it does to F.",
            '{young = "30 %", correlation_length = "5 mm"}',
            default="none: the modulus is known; of regions, too",
        ),
    ] = None

    _varying: Varying | None = PrivateAttr(None)

    @model_validator(mode="wrap")
    @classmethod
    def _read_young(cls, raw: Any, handler: ModelWrapValidatorHandler["Tissue"]) -> "Tissue":
        """Read a table of a field in place of the modulus."""
        if not (isinstance(raw, dict) and isinstance(raw.get("young"), dict)):
            return handler(raw)
        varying = _Young.model_validate({"young": raw["young"]}).young
        return handler(raw | {"young": f"{varying.young!r} Pa"}).with_field(varying)

    def with_field(self: _Tissue, varying: Varying | None) -> _Tissue:
        """Return this tissue, whose modulus is that of a field."""
        self._varying = varying
        return self

    @property
    def varying(self) -> Varying | None:
        """The field of its modulus; None if that is constant."""
        return self._varying

    @property
    def prony(self) -> Terms:
        """Shares and times (s) of the relaxation, the shortest time first."""
        return tuple(sorted(((term.share, term.time) for term in self.relaxation), key=lambda term: term[1]))

    @property
    def is_large(self) -> bool:
        """Whether displacements are taken to be large: F is then not proportional to the depth."""
        return self.law not in (None, "linear")

    @property
    def given(self) -> dict[str, Any]:
        """What its law reads besides young and poisson, by key; None if it is missing."""
        keys = LAWS[self.law] if self.law is not None else ()
        return {key: _DEFAULTS.get(key) if getattr(self, key) in (None, ()) else getattr(self, key) for key in keys}

    @property
    def keys_of_law(self) -> dict[str, Any]:
        """The keys of a study that set its law, {} of a linear one."""
        if not self.is_large:
            return {}
        return self.model_dump(include=set(KEYS_OF_LAWS), exclude_none=True, exclude_defaults=True)

    @property
    def further(self) -> dict[str, float]:
        """The parameters of its law besides λ and μ, by the names that solvers have for them."""
        found = self.given
        if "terms" in found:
            return _of_terms(self.terms)
        if (fibres := found.get("fibres")) is not None:
            direction = dict(zip(FIBRE, fibres.unit, strict=True))
            of_shear = 2 * (1 + self.poisson)  # young over μ
            return {**direction, "k1": of_shear * fibres.k1, "k2": fibres.k2, "dispersion": fibres.dispersion}
        return found

    def is_mirrored(self, normal: Vector) -> bool:
        """Return whether it is its own image in a plane with that unit normal."""
        if self.varying is not None and not self.varying.is_mirrored(normal):
            return False
        return not self.has_fibres or self.fibres is None or self.fibres.is_mirrored(normal)

    @property
    def has_fibres(self) -> bool:
        """Whether its stiffness depends on the direction."""
        return "fibres" in self.given and not (self.fibres and self.fibres.is_isotropic)

    def completed(self: _Tissue, material: "Tissue") -> _Tissue:
        """Return this tissue; the law with its parameters, relaxation and density that it lacks are ``material``'s."""
        own: dict[str, Any] = {}
        if self.law is None and material.is_large:
            own = {"law": material.law, **material.given}
        if "relaxation" not in self.model_fields_set and material.relaxation:
            own["relaxation"] = material.relaxation
        if self.density is None and material.density is not None:
            own["density"] = material.density
        return self.model_copy(update=own) if own else self

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's λ and μ (Pa); λ is infinite for an incompressible material."""
        return lame(self.young, self.poisson)


def _of_terms(terms: tuple[Term, ...]) -> dict[str, float]:
    """Return share and alpha of each of ``MOST_TERMS`` terms, by name; those that are not given have the share 0."""
    rest = 1 - sum(term.share or 0.0 for term in terms)
    found = {}
    for number in range(MOST_TERMS):
        term = terms[number] if number < len(terms) else None
        found[f"share{number + 1}"] = 0.0 if term is None else rest if term.share is None else term.share
        found[f"alpha{number + 1}"] = 2.0 if term is None else term.alpha
    return found


def lame(young: float, poisson: float) -> tuple[float, float]:
    """Return Lamé's λ and μ (Pa) from Young's modulus (Pa) and Poisson's ratio; λ is infinite for ½."""
    mu = young / (2 * (1 + poisson))
    return (2 * mu * poisson / (1 - 2 * poisson) if poisson < 0.5 else inf), mu


NUMBERS_OF_LAWS = tuple(key for key in KEYS_OF_LAWS if Tissue.model_fields[key].annotation == float | None)
"""Keys of laws that are numbers, not tables of them."""
