"""Headers of columns, and the units in them."""

import re
from dataclasses import dataclass

from epsmesh.units import unit_factor

# A header's name and unit: "load (N)", "Z [mm]", "depth / nm", "t {s}", "depth in mm"; then "force_mN".
_BRACKETED = re.compile(r"(?P<name>.*?)\s*[(\[{]\s*(?P<unit>[^()\[\]{}]*?)\s*[)\]}]\s*")
_DIVIDED = re.compile(r"(?P<name>.*?)(?:\s*/\s*|\s+in\s+|,\s*|\s+|_)(?P<unit>[^\s/,_]+)\s*")
_SI = ("m", "N", "s")
# Other words for units.
_SPELLINGS = {
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("micron", "microns", "micrometer", "micrometers"), "µm"),
    **dict.fromkeys(("millimeter", "millimeters", "millimetres"), "mm"),
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("in.", "inch", "inches", "zoll"), "in"),
    **dict.fromkeys(("lb", "lbs", "pound", "pounds"), "lbf"),
    **dict.fromkeys(("gram", "grams", "gramm", "gr", "g"), "gf"),
    **dict.fromkeys(("kg", "kp"), "kgf"),
    **dict.fromkeys(("ounce", "ounces", "oz"), "ozf"),
    **dict.fromkeys(("dyne", "dynes"), "dyn"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **dict.fromkeys(("angstrom", "angstroms", "å"), "Å"),
}
# Units of curves alone, with their SI unit and what they are worth in it; scales show forces as masses.
_WORTH = {
    "gf": ("N", 9.80665e-3), "kgf": ("N", 9.80665), "lbf": ("N", 4.4482216152605), "ozf": ("N", 0.27801385095378),
    "dyn": ("N", 1e-5), "mgf": ("N", 9.80665e-6), "mg": ("N", 9.80665e-6), "in": ("m", 0.0254), "ft": ("m", 0.3048),
    "mil": ("m", 2.54e-5), "thou": ("m", 2.54e-5), "Å": ("m", 1e-10),
}  # fmt: skip
# Prefixes in full: "microN", "millinewtons", "micro-meter". All in capitals, MICRON is a length.
_LONG = re.compile(
    r"(?P<prefix>[Nn]ano|[Mm]icro|[Mm]illi|[Cc]enti|[Kk]ilo)[ -]?(?P<unit>N|m|s|(?i:newtons?|met(?:er|re)s?|seconds?))"
)
_PREFIXES = {"nano": "n", "micro": "µ", "milli": "m", "centi": "c", "kilo": "k"}
# Units of masses: they are forces in columns that are called so.
MASSES = frozenset({"g", "kg", "mg", "lb", "lbs", "oz"})
_MARK = re.compile(r"\s*(#|%|//|!)+\s*")
# Units of other quantities: a column that has one is neither depth, force nor time.
_OTHERS = frozenset({
    "-", "%", "1", "V", "mV", "µV", "A", "mA", "Pa", "kPa", "MPa", "GPa", "psi", "°C", "K", "Hz", "deg", "rad",
    "counts", "a.u.", "mm/s", "mm/min", "N/mm",
    "mm/mm", "J",
})  # fmt: skip


@dataclass(frozen=True)
class Header:
    """A header: all of it, its name, and its unit ("": none)."""

    text: str
    name: str
    unit: str = ""


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
    plain = text.strip()
    if long := _LONG.fullmatch(plain):
        plain = _PREFIXES[long["prefix"].lower()] + {"n": "N"}.get(long["unit"][0].lower(), long["unit"][0].lower())
    plain = _SPELLINGS.get(plain.casefold(), plain)
    own, factor = _WORTH.get(plain, ("", 0.0))
    return factor if own == kind else unit_factor(plain, kind)


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
