"""Quantities written with their unit, as text, and read into SI numbers."""

from functools import cache
from math import pi
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

if TYPE_CHECKING:
    import pint

# The units a study file may use. A small registry loads in a millisecond, and a unit that makes no
# sense here (light years, barn) is refused rather than converted.
_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
second = [time] = s
gram = [mass] = g
newton = kilogram * meter / second ** 2 = N
pascal = newton / meter ** 2 = Pa
bar = 1e5 * pascal
percent = 0.01 = %
radian = [] = rad
degree = 3.14159265358979323846 / 180 * radian = deg = °
""".strip().splitlines()

# By SI unit: an example of a quantity, and what it is.
_KINDS = {
    "m": ("10 mm", "a length"),
    "Pa": ("10 kPa", "a pressure"),
    "s": ("10 ms", "a time"),
    "": ("1 %", "a share"),
    "rad": ("60 deg", "an angle"),
    "kg/m^3": ("1060 kg/m^3", "a density"),
    "m/s^2": ("-9.81 m/s^2", "an acceleration"),
}
# Twelve digits: "3 mm" and "0.3 cm" must be one number wherever two cases are compared.
_DIGITS = 12


@cache
def _registry() -> "pint.UnitRegistry":
    import pint  # noqa: PLC0415 (a tenth of a second, which `--help` does without)

    registry = pint.UnitRegistry(None)
    for line in _DEFINITIONS:
        registry.define(line)
    return registry


def canonical(value: float) -> float:
    """Return ``value`` rounded to the digits in which two inputs count as equal."""
    return float(f"{value:.{_DIGITS}g}")


def parse_quantity(text: Any, unit: str) -> float:
    """Read ``"10 mm"`` into a number in the SI ``unit``; a bare number is refused, never guessed."""
    example, kind = _KINDS[unit]
    allowed = f'a number with a unit as text, such as "{example}"'
    if not isinstance(text, str):
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed})
    try:
        quantity = _registry().Quantity(text)
        if not quantity.is_compatible_with(unit):
            raise PydanticCustomError("quantity", "{allowed}", {"allowed": f'{kind}, such as "{example}"'})
        magnitude = float(quantity.to(unit).magnitude)
    except PydanticCustomError:
        raise
    except Exception:  # pint raises many kinds, down to tokenizer errors, on text that is no quantity
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed}) from None
    if not abs(magnitude) < float("inf"):
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": "a finite number with a unit"})
    return canonical(magnitude)


def _length(text: Any) -> float:
    return parse_quantity(text, "m")


def _pressure(text: Any) -> float:
    return parse_quantity(text, "Pa")


def _density(text: Any) -> float:
    return parse_quantity(text, "kg/m^3")


def _acceleration(text: Any) -> float:
    return parse_quantity(text, "m/s^2")


def _angle(text: Any) -> float:
    angle = parse_quantity(text, "rad")
    if not 0 < angle < canonical(pi / 2):
        allowed = 'an angle between 0 and 90 deg, such as "60 deg"'
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed})
    return angle


def _share(text: Any) -> float:
    return parse_quantity(text, "")


Coordinate = Annotated[float, BeforeValidator(_length), Field(json_schema_extra={"unit": "m"})]
Length = Annotated[Coordinate, Field(gt=0)]
Angle = Annotated[float, BeforeValidator(_angle), Field(json_schema_extra={"unit": "rad"})]
Rounding = Annotated[Coordinate, Field(ge=0)]
Travel = Annotated[Coordinate, Field(ge=0)]
Share = Annotated[float, BeforeValidator(_share), Field(json_schema_extra={"unit": "1"})]
Stress = Annotated[float, BeforeValidator(_pressure), Field(json_schema_extra={"unit": "Pa"})]
Pressure = Annotated[Stress, Field(gt=0)]
Density = Annotated[float, BeforeValidator(_density), Field(gt=0, json_schema_extra={"unit": "kg/m^3"})]
Acceleration = Annotated[float, BeforeValidator(_acceleration), Field(json_schema_extra={"unit": "m/s^2"})]
