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
# Between headers of columns that spaces separate, with spaces in them.
_BETWEEN = re.compile(r"\s*[\t;,]\s*|\s{2,}")


def headers_of(before: Sequence[str], layout: Layout, values: FloatArray) -> tuple[tuple[Header, ...], str]:
    """Return the headers, from the lines before the rows: names, and units there or in a row of their own.

    Besides, return a note on a line of headers that has one more or fewer than there are columns of ``values``. Rows
    may end with a separator, or begin with a name or number that has no header; otherwise no header is used.
    """
    rows, width = values.shape
    names, units, note = [""] * width, [""] * width, ""
    for count in (width, width - 1, width + 1):
        above, below = _lines(before, layout, count)
        if not (above or below):
            continue
        found = above or [""] * count, below or _of_labview(before, layout, count)
        is_first = np.isnan(values[:, 0]).all() or np.array_equal(values[:, 0], np.arange(1, rows + 1))
        if count == width:
            names, units = found
        elif count < width and np.isnan(values[:, -1]).all():
            names, units = ([*texts, ""] for texts in found)
        elif count < width and is_first:
            names, units = (["", *texts] for texts in found)
            note = f"the first column has the names of rows: its header is not among the {count}"
        else:
            note = f"{width} columns have {count} headers, which are not used: name columns by number, and their units"
        break
    return tuple(map(_with_unit, names, units)), note


def is_short_of(before: Sequence[str], layout: Layout) -> int:
    """Return the number of headers of a line with at least half as many as there are columns, but fewer; 0 for none."""
    for fields in map(layout.fields, before):
        if 1 < len(fields) < layout.width <= 2 * len(fields) and not any(map(layout.is_number, fields)):
            return len(fields)
    return 0


def _lines(before: Sequence[str], layout: Layout, width: int) -> tuple[list[str], list[str]]:
    """Return the ``width`` names of the last line that has as many, and the units of a row below it; [] for none."""
    units: list[str] = []
    for line in reversed([line for line in before if line.strip()][-_NEAR:]):
        fields = _fields(line, layout, width)
        if fields and not units and _are_units(fields):
            units = [field.strip("()[]{} ") for field in fields]
        elif fields:
            return fields, units
    return [], units


def _of_labview(before: Sequence[str], layout: Layout, width: int) -> list[str]:
    """Return the units of the columns of LabVIEW's measurement files, which are in lines of labels; "" for none."""
    rows = {fields[0]: fields[1:] for line in before if (fields := layout.fields(line))}
    units = rows.get("Y_Unit_Label", [])
    along = "s" if any(units) and rows.get("X_Dimension", [""])[:1] == ["Time"] else ""
    return [along, *units, *[""] * width][:width]


def _with_unit(text: str, unit: str) -> Header:
    header = header_of(text)
    return header if header.unit or not unit else Header(f"{text} ({unit})", text, unit)


def _fields(line: str, layout: Layout, width: int) -> list[str]:
    """Return the ``width`` fields of a line of headers; [] if it has another number of them, or numbers."""
    bare = without_mark(line)
    for text in dict.fromkeys((bare, _PREFIX.sub("", bare, count=1))):
        for fields in _ways(text.strip(), layout) if layout.separator == " " else [layout.fields(text)]:
            kept = fields[:-1] if len(fields) == width + 1 and fields[-1].casefold() in _OF_NONE else fields
            if len(kept) == width and len(fields) > 1 and not any(map(layout.is_number, kept)):
                return kept
    return []


def _ways(text: str, layout: Layout) -> list[list[str]]:
    """Return the fields of a line above columns that spaces separate, in several ways: headers may have spaces, too."""
    if '"' in text:
        fields = next(csv.reader([text], delimiter=" ", skipinitialspace=True))
        return [[field for field in fields if field]]
    joined = re.sub(r"\s+([(\[{/])\s*", r"\1", text)  # "depth (mm)" is one header
    return [layout.fields(text), layout.fields(joined), _BETWEEN.split(text)]


def _are_units(fields: Sequence[str]) -> bool:
    """Tell a row of units."""
    bare = [field.strip("()[]{} ") for field in fields]
    return any(map(is_unit, bare)) and all(is_unit(unit) or unit in _PURE or len(unit) <= _LETTERS for unit in bare)
