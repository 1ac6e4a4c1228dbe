"""The lines above a table that have its headers and units."""

import csv
import re
from collections.abc import Sequence

from pipeline.experiment.header import Header, header_of, is_unit, without_mark
from pipeline.experiment.layout import Layout

# Lines above the rows in which headers are looked for, from the last one up.
_NEAR = 30
# Fields of a row of units for columns without one; other units have few letters.
_PURE, _LETTERS = frozenset({"%", "1", "-", ""}), 6
# What is before headers in files of force microscopes: "units: m N".
_PREFIX = re.compile(r"\s*\w+:\s+")
_OTHERS = ("\t", ";", ",", "  ")


def headers_of(before: Sequence[str], layout: Layout) -> tuple[Header, ...]:
    """Return the headers, from the lines before the rows: names, and units there or in a row of their own."""
    near = [line for line in before if line.strip()][-_NEAR:]
    units: list[str] = []
    for line in reversed(near):
        fields = _fields(line, layout)
        if fields is None:
            continue
        if not units and _are_units(fields):
            units = [field.strip("()[]{} ") for field in fields]
            continue
        return tuple(_with_unit(field, units[number] if units else "") for number, field in enumerate(fields))
    return tuple(_with_unit("", unit) for unit in units or [""] * layout.width)


def _with_unit(text: str, unit: str) -> Header:
    header = header_of(text)
    return header if header.unit or not unit else Header(f"{text} ({unit})", text, unit)


def _fields(line: str, layout: Layout) -> list[str] | None:
    """Return the fields of a line of headers; None if it has another number of columns, or numbers."""
    bare = without_mark(line)
    texts = dict.fromkeys((bare, _PREFIX.sub("", bare, count=1)))
    for text in texts:
        for fields in _ways(text, layout):
            if len(fields) == layout.width - 1:  # rows may end with a separator, and the headers not
                fields.append("")
            if len(fields) == layout.width and not any(map(layout.is_number, fields)):
                return fields
    return None


def _ways(text: str, layout: Layout) -> list[list[str]]:
    """Return the fields of a line, of one in columns in several ways: spaces are also within headers."""
    if layout.separator != " " or not text.strip():
        return [fields for fields in [layout.fields(text)] if len(fields) == layout.width or layout.width > 2]
    if '"' in text:
        fields = next(csv.reader([text.strip()], delimiter=" ", skipinitialspace=True))
        return [[field for field in fields if field]]
    joined = re.sub(r"\s+([(\[{/])\s*", r"\1", text)  # "depth (mm)" is one header
    others = [[field.strip() for field in text.strip().split(other) if field.strip()] for other in _OTHERS]
    return [fields for fields in (text.split(), joined.split(), *others) if len(fields) == layout.width]


def _are_units(fields: Sequence[str]) -> bool:
    """Tell a row of units."""
    bare = [field.strip("()[]{} ") for field in fields]
    return any(map(is_unit, bare)) and all(is_unit(unit) or unit in _PURE or len(unit) <= _LETTERS for unit in bare)
