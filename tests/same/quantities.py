"""Quantities in studies: every text that is a number and a unit, found, written in another unit, or scaled."""

import random
import re
from collections.abc import Callable
from typing import Any

from tests.pairs import Study

# Units of studies: what they are of, and what one of them is in SI units.
_UNITS = {
    "mm": ("length", 1e-3), "cm": ("length", 1e-2), "m": ("length", 1.0), "µm": ("length", 1e-6),
    "Pa": ("modulus", 1.0), "kPa": ("modulus", 1e3), "MPa": ("modulus", 1e6), "mbar": ("modulus", 1e2),
    "s": ("time", 1.0), "ms": ("time", 1e-3), "min": ("time", 60.0),
    "deg": ("angle", 1.0), "°": ("angle", 1.0),
    "%": ("share", 1.0),
    "kg/m^3": ("density", 1.0), "g/cm^3": ("density", 1e3),
    "m/s^2": ("acceleration", 1.0), "mm/s^2": ("acceleration", 1e-3),
    "N": ("force", 1.0), "mN": ("force", 1e-3),
    "J/m^2": ("toughness", 1.0), "mJ/m^2": ("toughness", 1e-3), "N/mm": ("toughness", 1e3),
}  # fmt: skip
_TEXT = re.compile(r"^([-+0-9.eE]+) ?(\S+)$")


def rewritten(study: Study, write: Callable[[float, str, str], str]) -> Study:
    """Return the study with every quantity as ``write`` has it, given its number, its unit and what it is of."""

    def visit(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: visit(one) for key, one in value.items()}
        if isinstance(value, list):
            return [visit(one) for one in value]
        found = _TEXT.match(value) if isinstance(value, str) else None
        if found and found[2] in _UNITS:
            return write(float(found[1]), found[2], _UNITS[found[2]][0])
        return value

    return {section: visit(table) for section, table in study.items()}


def in_other_units(study: Study, dice: random.Random) -> Study:
    """Return the study with every quantity in another unit."""

    def write(number: float, unit: str, kind: str) -> str:
        others = [name for name, (other, _) in _UNITS.items() if other == kind and name != unit]
        chosen = dice.choice(others or [unit])
        return f"{_text(number * _UNITS[unit][1] / _UNITS[chosen][1])} {chosen}"

    return rewritten(study, write)


def scaled(study: Study, length: float, modulus: float) -> Study:
    """Return the study with lengths and moduli times these factors, and what follows from them."""
    factors = {"length": length, "modulus": modulus, "density": modulus / length}
    factors |= {"toughness": modulus * length, "force": modulus * length**2}
    return rewritten(study, lambda number, unit, kind: f"{_text(number * factors.get(kind, 1.0))} {unit}")


def times(text: str, factor: float) -> str:
    """Return a quantity times a factor."""
    number, unit = text.split(maxsplit=1)
    return f"{_text(float(number) * factor)} {unit}"


def number_of(text: str) -> float:
    """Return a quantity in SI units."""
    number, unit = text.split(maxsplit=1)
    return float(number) * _UNITS[unit][1]


def _text(number: float) -> str:
    return f"{number:.12g}"
