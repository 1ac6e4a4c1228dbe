"""The lines above a table that have its headers and units."""

import csv
import re
from collections.abc import Sequence

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.experiment.header import Header, header_of, is_unit, without_mark
from epsmesh_identify.experiment.layout import Layout

# Lines above the rows in which headers are looked for, from the last one up.
_NEAR = 30
# Fields of a row of units for columns without one; other units have few letters.
_PURE, _LETTERS = frozenset({"%", "1", "-", ""}), 6
# What is before headers in files of force microscopes: "units: m N".
_PREFIX = re.compile(r"\s*\w+:\s+")
# Headers after the last column, of which rows have nothing.
_OF_NONE = frozenset({"", "comment", "comments", "note", "notes", "remark", "remarks"})
_OTHERS = ("\t", ";", ",", "  ")


def headers_of(before: Sequence[str], layout: Layout, values: FloatArray) -> tuple[tuple[Header, ...], str]:
    """Return the headers, from the lines before the rows: names, and units there or in a row of their own.

    Besides, return a note on a line of headers that has one more or fewer than there are columns of ``values``.
    """
    width = layout.width
    for count in (width, width - 1, width + 1):
        names, units = _lines(before, layout, count)
        if not (names or units):
            continue
        if count == width:
            return _named(names or [""] * width, units or _of_labview(before, layout)), ""
        return _placed(names or [""] * count, units, values)
    return _named([""] * width), ""


def has_headers(before: Sequence[str], layout: Layout) -> bool:
    """Tell whether a line before the rows has as many headers as there are columns, or one fewer."""
    return any(any(_lines(before, layout, width)) for width in (layout.width, layout.width - 1))


def _lines(before: Sequence[str], layout: Layout, width: int) -> tuple[list[str], list[str]]:
    """Return the ``width`` names of the last line that has as many, and the units of a row below it; [] for none."""
    units: list[str] = []
    for line in reversed([line for line in before if line.strip()][-_NEAR:]):
        fields = _fields(line, layout, width)
        if fields is None:
            continue
        if not units and _are_units(fields):
            units = [field.strip("()[]{} ") for field in fields]
            continue
        return fields, units
    return [], units


def _of_labview(before: Sequence[str], layout: Layout) -> list[str]:
    """Return the units of the columns of LabVIEW's measurement files, which are in lines of labels; [] for none."""
    rows = {fields[0]: fields[1:] for line in before if (fields := layout.fields(line))}
    units, along = rows.get("Y_Unit_Label", []), rows.get("X_Dimension", [""])
    found = ["s" if along[:1] == ["Time"] else "", *units, *[""] * layout.width]
    return found[: layout.width] if any(units) else []


def _named(fields: Sequence[str], units: Sequence[str] = ()) -> tuple[Header, ...]:
    return tuple(_with_unit(field, units[number] if any(units) else "") for number, field in enumerate(fields))


def _placed(names: list[str], units: list[str], values: FloatArray) -> tuple[tuple[Header, ...], str]:
    """Return the headers of columns whose line of headers has one more, or one fewer, and a note on it.

    Rows may end with a separator, or begin with a name or number that has no header. Otherwise no header is sure.
    """
    rows, width = values.shape
    if len(names) < width:
        if np.isnan(values[:, -1]).all():
            return _named([*names, ""], [*units, ""]), ""
        first = values[:, 0]
        if np.isnan(first).all() or np.array_equal(first, np.arange(1, rows + 1)):
            note = f"the first column has the names of rows: its header is not among the {len(names)}"
            return _named(["", *names], ["", *units]), note
    note = f"{width} columns have {len(names)} headers, which are not used: name columns by number, and their units"
    return _named([""] * width), note


def _with_unit(text: str, unit: str) -> Header:
    header = header_of(text)
    return header if header.unit or not unit else Header(f"{text} ({unit})", text, unit)


def _fields(line: str, layout: Layout, width: int) -> list[str] | None:
    """Return the ``width`` fields of a line of headers; None if it has another number of them, or numbers."""
    bare = without_mark(line)
    texts = dict.fromkeys((bare, _PREFIX.sub("", bare, count=1)))
    for text in texts:
        for fields in (*_ways(text, layout, width), *_ways(text, layout, width + 1)):
            if len(fields) == width + 1 and fields[-1].casefold() in _OF_NONE:
                fields.pop()
            if len(fields) == width and not any(map(layout.is_number, fields)):
                return fields
    return None


def _ways(text: str, layout: Layout, width: int) -> list[list[str]]:
    """Return the fields of a line, of one in columns in several ways: spaces are also within headers."""
    if layout.separator != " " or not text.strip():
        return [fields for fields in [layout.fields(text)] if len(fields) == width and width > 1]
    if '"' in text:
        fields = next(csv.reader([text.strip()], delimiter=" ", skipinitialspace=True))
        return [[field for field in fields if field]]
    joined = re.sub(r"\s+([(\[{/])\s*", r"\1", text)  # "depth (mm)" is one header
    others = [[field.strip() for field in text.strip().split(other) if field.strip()] for other in _OTHERS]
    return [fields for fields in (text.split(), joined.split(), *others) if len(fields) == width]


def _are_units(fields: Sequence[str]) -> bool:
    """Tell a row of units."""
    bare = [field.strip("()[]{} ") for field in fields]
    return any(map(is_unit, bare)) and all(is_unit(unit) or unit in _PURE or len(unit) <= _LETTERS for unit in bare)
