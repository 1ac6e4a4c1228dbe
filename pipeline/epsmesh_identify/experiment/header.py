"""Headers of columns, the units in them, and what columns of force curves are called."""

import re
from dataclasses import dataclass
from functools import cache

from epsmesh.units import registry_of, unit_factor

# A header's name and unit: "load (N)", "Z [mm]", "depth / nm", "t {s}", "depth in mm"; then "force_mN".
_BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[{]\s*(?P<unit>[^()\[\]{}]*?)\s*[)\]}]\s*")
_DIVIDED = re.compile(r"(?P<name>.*?)(?:\s*/\s*|\s+in\s+|,\s*|\s+|_)(?P<unit>[^\s/,_]+)\s*")
_SI = ("m", "N", "s")
# Units of machines and scales, besides those of a study, with their spellings. Scales show forces as masses.
_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = µ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
meter = [length] = m = metre
second = [time] = s = sec = Sec = SEC
newton = [force] = N
gram = [mass] = g = gramm = gr
pound = 453.59237 * gram = lb = LB
ounce = 28.349523125 * gram = oz = OZ
gram_force = 9.80665e-3 * newton = gf
kilogram_force = 9.80665 * newton = kp
pound_force = 4.4482216152605 * newton = lbf
ounce_force = 0.27801385095378 * newton = ozf
dyne = 1e-5 * newton = dyn
inch = 0.0254 * meter = in = IN = inches = zoll
foot = 0.3048 * meter = ft = FT = feet
mil = 2.54e-5 * meter = thou
micron = 1e-6 * meter
angstrom = 1e-10 * meter = Å = å
"""
# The weight (N) of a gram.
_WEIGHT = 9.80665e-3
_WORD = re.compile(r"[A-Za-zµÅå]+")
_LONG_PREFIX = re.compile(r"^(nano|micro|milli|centi|kilo)[ -]", re.IGNORECASE)
# Letters from which on a unit may also be written in capitals.
_LONG = 4
_MARK = re.compile(r"\s*(#|%|//|!)+\s*")
# Units of other quantities: a column that has one is neither depth, force nor time.
_OTHERS = frozenset({
    "-", "%", "1", "V", "mV", "µV", "A", "mA", "Pa", "kPa", "MPa", "GPa", "psi", "°C", "K", "Hz", "deg", "rad",
    "counts", "a.u.", "mm/s", "mm/min", "N/mm", "mm/mm", "J",
})  # fmt: skip
# Words of columns, by what they are; and of columns that are derived from those.
_WORDS = {
    "depth": "depth indentation indent displacement disp position pos piezo extension stroke travel compression "
    "crosshead deformation height separation z weg h d",
    "force": "force load kraft weight gewicht mass f fn fz p",
    "deflection": "deflection defl bending",
    "time": "time timestamp elapsed zeit t",
}
_DERIVED = "strain stress rate speed velocity error std target limit step"
_SPLIT = re.compile(r"[^A-Za-zäöüÄÖÜ]+|(?<=[a-z])(?=[A-Z])")


@dataclass(frozen=True)
class Header:
    """A header: all of it, its name, and its unit ("": none)."""

    text: str
    name: str
    unit: str = ""

    def is_called(self, kind: str) -> bool:
        """Tell whether the name is one of depth, force, deflection or time, and none of a stress, rate or the like."""
        words = {word.lower() for word in _SPLIT.split(self.name)}
        return bool(words.intersection(_WORDS[kind].split())) and not words.intersection(_DERIVED.split())


@cache
def _worth(text: str) -> tuple[str, float]:
    """Return m, N, s or g, and what a unit of machines is worth in it; ("", 0.0) for what is none.

    "MICRON" is a length, and "MicroN" a force.
    """
    plain = _LONG_PREFIX.sub(r"\1", text.strip().rstrip("."))
    spellings = [plain, plain[:1].lower() + plain[1:], plain.lower()] if len(plain) >= _LONG else [plain]
    for unit in spellings:
        if _WORD.fullmatch(unit) and unit in registry_of(_DEFINITIONS):
            quantity = registry_of(_DEFINITIONS).Quantity(1.0, unit)
            kind = next(kind for kind in (*_SI, "g") if quantity.is_compatible_with(kind))
            return kind, float(quantity.to(kind).magnitude)
    return "", 0.0


def is_mass(text: str) -> bool:
    """Tell a unit of mass, which is one of force in columns that are called so."""
    return _worth(text)[0] == "g"


def is_unit(text: str) -> bool:
    """Tell whether a text is a unit of length, force or time."""
    return any(is_unit_of(text, kind) for kind in _SI)


def is_unit_of(text: str, kind: str) -> bool:
    """Tell whether a text is a unit of the same kind as an SI unit."""
    try:
        return factor_of(text, kind) > 0
    except ValueError:
        return False


def factor_of(text: str, kind: str) -> float:
    """Return what a number in the unit ``text`` is multiplied with to be one in the SI unit ``kind``.

    Raises:
        ValueError: if ``text`` is no unit of that kind, with those that are.
    """
    own, worth = _worth(text)
    if own == "g" and kind == "N":
        return worth * _WEIGHT
    return worth if own == kind else unit_factor(text.strip(), kind)


def written(value: float, kind: str) -> str:
    """Return a value in the SI unit ``kind`` with the prefix that people read."""
    return f"{registry_of(_DEFINITIONS).Quantity(value, kind).to_compact():.4g~P}"


def is_comment(line: str) -> bool:
    """Tell a line that is marked as a comment."""
    return _MARK.match(line) is not None


def without_mark(line: str) -> str:
    """Return a line without the mark of a comment."""
    return _MARK.sub("", line, count=1)


def header_of(text: str) -> Header:
    """Return a header with its unit, where it has one."""
    found = _BRACKETED.fullmatch(text)
    if found and found["name"] and (is_unit(found["unit"]) or found["unit"] in _OTHERS):
        return Header(text, found["name"], found["unit"])
    if (found := _DIVIDED.fullmatch(text)) and found["name"] and is_unit(found["unit"]):
        return Header(text, found["name"], found["unit"])
    return Header(text, text)
