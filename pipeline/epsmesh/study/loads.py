"""Loads on the body: gravity, and tractions on parts of its boundary."""

from collections.abc import Mapping
from math import hypot
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import Field, create_model

from epsmesh.shapes.frame import Vector
from epsmesh.shapes.part import Part, is_part_mirrored
from epsmesh.shapes.registry import TERMS
from epsmesh.shapes.section import OptionalName, Section, Words, kept
from epsmesh.shapes.term import BodyTerm
from epsmesh.units import Acceleration, Stress

# A component of a unit vector that is smaller is none.
_NONE = 1e-12


class Traction(Section):
    """A traction on part of the boundary: a vector, or a pressure against the outward normal."""

    name: Annotated[
        OptionalName,
        Words(
            "Name of the traction: letters, digits, _ and -. The dimension of a sweep begins with it: "
            "retractor_pressure.",
            '"retractor"',
            default="none: nothing of it is swept",
        ),
    ] = ""
    on: Annotated[
        Part,
        Words(
            'Part of the boundary: a face of the body ("top", "sides", "bottom"; not of a CAD file), a hollow '
            "region by its name, "
            'a cap around a point of the surface, or "free", all of the boundary without support and '
            "tool.",
            '"sides"',
        ),
    ]
    pressure: Annotated[
        Stress | None,
        Field(json_schema_extra={"unit": "Pa"}),
        Words("Pressure, against the outward normal. Negative values pull.", '"1 kPa"', default="none: it is a vector"),
    ] = None
    traction: Annotated[
        tuple[Stress, Stress, Stress] | None,
        Words(
            "Traction vector: force per area along x, y and z.",
            '["1 kPa", "0 Pa", "0 Pa"]',
            default="none: it is a pressure",
        ),
    ] = None

    @property
    def acts(self) -> bool:
        """Whether it is not zero."""
        return bool(self.pressure) or any(self.traction or ())


class _Load(Section):
    """Loads on the body besides the probe."""

    gravity: Annotated[
        tuple[Acceleration, Acceleration, Acceleration],
        Words(
            "Acceleration along x, y and z. Every material then needs a density.",
            '["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]',
            default="none",
        ),
    ] = (0.0, 0.0, 0.0)
    traction: Annotated[
        tuple[Traction, ...], Words("Tractions on parts of the boundary.", "[[load.traction]]", default="none")
    ] = ()

    @kept
    def terms(self) -> tuple[BodyTerm, ...]:
        """What else acts on the body, of all kinds of terms."""
        return tuple(term for name in TERMS for term in getattr(self, name))

    def with_pressures(self, pressures: Mapping[str, float]) -> Self:
        """Return the load with ``pressures`` (Pa) in hollow regions, by name, as tractions on their walls."""
        if not pressures:
            return self
        inner = (Traction.model_construct(on=name, pressure=pressure) for name, pressure in pressures.items())
        return self.model_copy(update={"traction": (*self.traction, *inner)})

    @kept
    def acts(self) -> bool:
        """Whether there is any load."""
        return any(self.gravity) or any(traction.acts for traction in self.traction)

    def is_mirrored(self, normal: Vector) -> bool:
        """Tell whether it is its own image in the plane through the origin with that unit normal, as the body is."""
        if abs(_along(self.gravity, normal)) > _NONE * hypot(*self.gravity):
            return False
        for traction in (traction for traction in self.traction if traction.acts):
            vector = traction.traction or (0.0, 0.0, 0.0)
            if abs(_along(vector, normal)) > _NONE * hypot(*vector):
                return False
            if not is_part_mirrored(traction.on, normal):
                return False
        return all(term.is_mirrored(normal) and is_part_mirrored(term.on, normal) for term in self.terms)


if TYPE_CHECKING:

    class Load(_Load):
        """Loads on the body besides the probe."""

else:  # with an array of tables of each term
    Load = create_model(
        "Load",
        __base__=_Load,
        __module__=__name__,
        **{
            name: (Annotated[tuple[kind, ...], Words(kind.ABOUT, f"[[load.{name}]]", default="none")], ())
            for name, kind in TERMS.items()
        },
    )


def _along(vector: Vector, normal: Vector) -> float:
    return sum(a * b for a, b in zip(vector, normal, strict=True))
