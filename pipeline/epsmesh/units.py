"""Quantities written with their unit, as text, and read into SI numbers.

One number and one unit, by a grammar of our own: pint, whose texts are calculations, is asked what a unit is worth that
few people write.
"""

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from math import inf, pi
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

if TYPE_CHECKING:
    import pint

# The units a study file may use. A small registry loads in a millisecond, and a unit that makes no
# sense here (light years, barn) is refused rather than converted.
_DEFINITIONS = """
pico- = 1e-12 = p-
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
mega- = 1e6 = M-
giga- = 1e9 = G-
meter = [length] = m = metre
second = [time] = s
hertz = 1 / second = Hz
gram = [mass] = g
newton = kilogram * meter / second ** 2 = N
pascal = newton / meter ** 2 = Pa
joule = newton * meter = J
bar = 1e5 * pascal
percent = 0.01 = %
radian = [] = rad
degree = 3.14159265358979323846 / 180 * radian = deg = °
"""


@dataclass(frozen=True)
class _Kind:
    """What a quantity is called, an example of one, and what the units that people write it in are worth in SI's."""

    name: str
    example: str
    units: Mapping[str, float]


# By SI unit.
_KINDS = {
    "m": _Kind("a length", "10 mm", {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "µm": 1e-6, "nm": 1e-9}),
    "Pa": _Kind(
        "a pressure",
        "10 kPa",
        {
            "Pa": 1.0,
            "kPa": 1e3,
            "MPa": 1e6,
            "GPa": 1e9,
            "bar": 1e5,
            "mbar": 1e2,
            "mmHg": 133.322387415,
            "N/m^2": 1.0,
            "N/mm^2": 1e6,
        },
    ),
    "s": _Kind("a time", "10 ms", {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "min": 60.0, "h": 3600.0}),
    "Hz": _Kind("a frequency", "1 Hz", {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3, "1/s": 1.0}),
    "": _Kind("a share", "1 %", {"%": 1e-2}),
    "rad": _Kind("an angle", "60 deg", {"deg": pi / 180, "°": pi / 180, "rad": 1.0}),
    "kg/m^3": _Kind("a density", "1060 kg/m^3", {"kg/m^3": 1.0, "g/cm^3": 1e3}),
    "m/s^2": _Kind("an acceleration", "-9.81 m/s^2", {"m/s^2": 1.0, "mm/s^2": 1e-3}),
    "m/s": _Kind("a speed", "5 mm/s", {"m/s": 1.0, "mm/s": 1e-3, "cm/s": 1e-2, "mm/min": 1e-3 / 60, "µm/s": 1e-6}),
    "N": _Kind("a force", "10 mN", {"N": 1.0, "mN": 1e-3, "µN": 1e-6, "nN": 1e-9, "kN": 1e3}),
    "N/m": _Kind("a stiffness", "60 N/mm", {"N/m": 1.0, "N/mm": 1e3, "mN/mm": 1.0, "N/µm": 1e6}),
    "N/m^3": _Kind(
        "a stiffness per area",
        "50 kPa/mm",
        {"N/m^3": 1.0, "Pa/m": 1.0, "kPa/m": 1e3, "MPa/m": 1e6, "Pa/mm": 1e3, "kPa/mm": 1e6, "N/mm^3": 1e9},
    ),
    "J/m^2": _Kind("a toughness", "200 J/m^2", {"J/m^2": 1.0, "kJ/m^2": 1e3, "mJ/m^2": 1e-3, "N/m": 1.0, "N/mm": 1e3}),
    "N/s": _Kind("a rate of force", "1 mN/s", {"N/s": 1.0, "mN/s": 1e-3, "µN/s": 1e-6}),
}
# Pure numbers by another name: alone they are a unit, within another one they would hide a factor.
_PURE = {"": ("%", "percent"), "rad": ("deg", "degree", "°", "rad", "radian")}
# Twelve digits: "3 mm" and "0.3 cm" must be one number wherever two cases are compared.
_DIGITS = 12

# Beyond these, in SI units, volumes and their like are numbers no more; within them is all that anyone measures.
_LEAST, _MOST = 1e-30, 1e30

# Characters of a quantity; what is longer is none.
_LONGEST = 80

# What is written as something else by a keyboard, a word processor or a table that it was copied from.
_SPELLINGS = str.maketrans({"\N{MINUS SIGN}": "-", "\N{GREEK SMALL LETTER MU}": "\N{MICRO SIGN}", "²": "^2", "³": "^3",
                            "·": "*", "⋅": "*", "\N{NO-BREAK SPACE}": " ", "\N{NARROW NO-BREAK SPACE}": " ",
                            "\N{THIN SPACE}": " "})  # fmt: skip
_NUMBER = re.compile(r"[+-]?(?P<digits>[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?![0-9.])")
_FACTOR = re.compile(r"([A-Za-zµ]+|%|°)(?:(?:\^|\*\*)(-?[0-9]))?")
# Products, then divisors, one after the other: "kg/m s^2" would be read in two ways.
_UNIT = re.compile(rf"{_FACTOR.pattern}(?:(?: |\*){_FACTOR.pattern})*(?:/{_FACTOR.pattern})*")
_DIGIT = re.compile(r"[1-9]")
_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)\b", re.IGNORECASE)


@cache
def registry_of(definitions: str) -> "pint.UnitRegistry":
    """Return the registry with these units alone, each defined by a line of the text."""
    import pint  # noqa: PLC0415 (a tenth of a second, which most studies do without)

    registry = pint.UnitRegistry(None)
    for line in definitions.strip().splitlines():
        registry.define(line)
    return registry


def canonical(value: float) -> float:
    """Return ``value`` rounded to the digits in which two inputs count as equal."""
    return float(f"{value:.{_DIGITS}g}")


def parse_quantity(text: Any, unit: str) -> float:
    """Read one number and one unit, ``"10 mm"``, into a number in the SI ``unit``; nothing else is read, or guessed.

    A share may be a pure number, too: ``"0.05"``.

    Raises:
        ValueError: with what is allowed, and what is wrong with ``text``.
    """
    if not isinstance(text, str):
        raise _refusal(unit, "")
    if len(text) > _LONGEST:
        raise _refusal(unit, f"it has {len(text)} characters")
    plain = text.translate(_SPELLINGS).strip()
    if comma := _COMMA.match(plain):
        whole, fraction = comma.group().split(",")
        others = f" or {whole}{fraction}" if len(fraction) == 3 else ""
        raise _refusal(unit, f"{comma.group()} has a comma: write {whole}.{fraction}{others}")
    found = _NUMBER.match(plain)
    if found is None:
        finite = "the number must be finite" if _NOT_FINITE.match(plain) else "the number comes first"
        raise _refusal(unit, finite + _foreign(plain))
    value, rest = float(found.group()), plain[found.end() :].strip()
    factor = _factor(rest, unit)
    if not rest and 1 <= abs(value) < inf:
        raise _refusal(unit, f'{found.group()} without a unit would be {100 * value:g} %: is "{value:g} %" meant, that '
                             f"is {value / 100:g}?")  # fmt: skip
    if not abs(value * factor) < inf:
        raise _refusal(unit, "the number must be finite")
    if (value != 0 or _DIGIT.search(found["digits"])) and not _LEAST <= abs(value * factor) <= _MOST:
        raise _refusal(
            unit, f"numbers from {_LEAST:g} to {_MOST:g} {unit or '(as a share)'} are taken, of either sign, and 0"
        )
    return canonical(value * factor)


@cache
def _factor(text: str, unit: str) -> float:
    """Return what a number before the unit ``text`` is multiplied with to be one in the SI ``unit``."""
    kind = _KINDS[unit]
    if text in kind.units:
        return kind.units[text]
    if not text and unit == "":
        return 1.0
    allowed = f"allowed are {', '.join(kind.units)}" if len(kind.units) > 1 else f"write {next(iter(kind.units))}"
    if not text:
        raise _refusal(unit, f"the unit is missing; {allowed}")
    if not _UNIT.fullmatch(text):
        raise _refusal(unit, f"one number and one unit are taken, and `{text}` is no unit; {allowed}{_foreign(text)}")
    for symbol, _ in _FACTOR.findall(text):
        if symbol not in registry_of(_DEFINITIONS):
            meant = next((u for u in kind.units if u.casefold() == text.casefold()), None)
            raise _refusal(unit, f"unknown unit `{symbol}`; " + (f"did you mean {meant}?" if meant else allowed))
    is_pure = any(symbol in pure for pure in _PURE.values() for symbol, _ in _FACTOR.findall(text))
    if is_pure and text not in _PURE.get(unit, ()):
        raise _refusal(unit, f"`{text}` is no unit of {kind.name}; {allowed}")
    quantity = registry_of(_DEFINITIONS).Quantity(1.0, text.replace("**", "^"))
    if not quantity.is_compatible_with(unit) or (not is_pure and unit in _PURE):
        raise _refusal(unit, f"`{text}` is no unit of {kind.name}; {allowed}")
    return float(quantity.to(unit).magnitude)


def unit_factor(text: str, unit: str) -> float:
    """Return what a number in the unit ``text`` is multiplied with to be one in the SI ``unit``.

    Raises:
        ValueError: if ``text`` is no unit of that kind, with those that are.
    """
    return _factor(text.translate(_SPELLINGS).strip(), unit)


def _foreign(text: str) -> str:
    """Name the first letter, digit or dash of ``text`` that looks like one of a quantity and is none; "" if all are."""
    found = next((c for c in text if not c.isascii() and c not in "µ°" and unicodedata.category(c)[0] in "LNPC"), None)
    return "" if found is None else f"; `{found}` is {unicodedata.name(found, 'a sign')}"


def _refusal(unit: str, why: str) -> PydanticCustomError:
    kind = _KINDS[unit]
    what = (
        f'{kind.name}, such as "{kind.example}"' if why else f'a number with a unit as text, such as "{kind.example}"'
    )
    return PydanticCustomError("quantity", "{allowed}", {"allowed": f"{what}; {why}" if why else what})


def _quantity_in(unit: str) -> BeforeValidator:
    """Return the validator that reads a quantity in the SI ``unit``."""
    return BeforeValidator(partial(parse_quantity, unit=unit))


def _angle(text: Any) -> float:
    angle = parse_quantity(text, "rad")
    if not 0 < angle < canonical(pi / 2):
        allowed = 'an angle between 0 and 90 deg, such as "60 deg"'
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed})
    return angle


Coordinate = Annotated[float, _quantity_in("m"), Field(json_schema_extra={"unit": "m"})]
Length = Annotated[Coordinate, Field(gt=0)]
Angle = Annotated[float, BeforeValidator(_angle), Field(json_schema_extra={"unit": "rad"})]
Rounding = Annotated[Coordinate, Field(ge=0)]
Travel = Annotated[Coordinate, Field(ge=0)]
Share = Annotated[float, _quantity_in(""), Field(json_schema_extra={"unit": "1"})]
Stress = Annotated[float, _quantity_in("Pa"), Field(json_schema_extra={"unit": "Pa"})]
Pressure = Annotated[Stress, Field(gt=0)]
Force = Annotated[float, _quantity_in("N"), Field(gt=0, json_schema_extra={"unit": "N"})]
Density = Annotated[float, _quantity_in("kg/m^3"), Field(gt=0, json_schema_extra={"unit": "kg/m^3"})]
Toughness = Annotated[float, _quantity_in("J/m^2"), Field(gt=0, json_schema_extra={"unit": "J/m^2"})]
Stiffness = Annotated[float, _quantity_in("N/m"), Field(gt=0, json_schema_extra={"unit": "N/m"})]
Tension = Annotated[float, _quantity_in("N/m"), Field(ge=0, json_schema_extra={"unit": "N/m"})]
Foundation = Annotated[float, _quantity_in("N/m^3"), Field(gt=0, json_schema_extra={"unit": "N/m^3"})]
Acceleration = Annotated[float, _quantity_in("m/s^2"), Field(json_schema_extra={"unit": "m/s^2"})]
Speed = Annotated[float, _quantity_in("m/s"), Field(gt=0, json_schema_extra={"unit": "m/s"})]
Duration = Annotated[float, _quantity_in("s"), Field(ge=0, json_schema_extra={"unit": "s"})]
Time = Annotated[float, _quantity_in("s"), Field(gt=0, json_schema_extra={"unit": "s"})]
Frequency = Annotated[float, _quantity_in("Hz"), Field(gt=0, json_schema_extra={"unit": "Hz"})]
