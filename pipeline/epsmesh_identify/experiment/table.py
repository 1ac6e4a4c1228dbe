"""The table of numbers in a text: its headers with their units, its values, and the lines they are from."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from io import StringIO

import numpy as np
import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.units import unit_factor
from epsmesh_identify.experiment.clock import is_clock, is_date, seconds
from epsmesh_identify.experiment.header import Header, is_comment
from epsmesh_identify.experiment.headings import headers_of, is_short_of
from epsmesh_identify.experiment.layout import MISSING, Layout, find_layout
from epsmesh_identify.experiment.reading import ExperimentError

# Lines of other widths among the rows, beyond which a file is more than one table.
_MOST_ODD = 0.05
# Letters of a text among numbers that a message repeats.
_QUOTED = 40
# A spring constant among the header lines of force microscopes, in N/m where no unit is given.
_SPRING = re.compile(
    r"spring[ _-]?(const(ant)?)?\W{0,6}(?P<value>\d[\d.]*(e[+-]?\d+)?)\W{0,3}(?P<unit>[pnµum]?N/[nµum]?m)?",
    re.IGNORECASE,
)
_OF_SPRING = "it is `machine_stiffness` if the depth is the way of the piezo, not of the tip"
# Rows one after the other that are a table.
_ROWS = 4
# The separator of fields that ASCII has: no text has it.
_UNIT = "\x1f"


@dataclass(frozen=True)
class Table:
    """Values (rows × columns; NaN where missing) and the numbers of their lines, from 1.

    ``strange`` has, by column, the first line and text of a value that is no number. ``notes`` say what was found.
    ``spring`` is the spring constant in the lines above. ``unused`` says why headers there are those of no columns.
    """

    file: str
    headers: tuple[Header, ...]
    values: FloatArray
    lines: IntArray
    strange: dict[int, tuple[int, str]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    layout: Layout = field(default_factory=Layout)
    spring: str = ""
    unused: str = ""


def table_of(lines: Sequence[str], file: str) -> Table:
    """Return the table in the ``lines`` of a file; ``file`` is for messages.

    Raises:
        ExperimentError: if there is none, or more than one.
    """
    layout = find_layout(lines)
    if layout is None:
        raise ExperimentError(file, "has no table of numbers: no two lines have the same number of numeric columns")
    begin = _begin(lines, layout)
    if begin is None:
        raise ExperimentError(file, "has no row of numbers")
    full = [number for number in range(begin, len(lines)) if lines[number].strip()]
    kept = [number for number in full if _width(lines[number], layout) == layout.width]
    odd = sorted(set(full).difference(kept))
    strange: dict[int, tuple[int, str]] = {}
    values, clocks = _values([lines[number] for number in kept], layout, np.array(kept) + 1, strange)
    headers, of_headers = headers_of(lines[:begin], layout, values)
    has_names = any(header.text for header in headers)
    if not has_names and not of_headers and layout.separator == "," and (count := is_short_of(lines[:begin], layout)):
        why = f"has {layout.width} columns, and a header of {count}: decimal commas are not distinguishable from "
        raise ExperimentError(file, f"{why}commas between columns; save it with semicolons", line=begin + 1)
    wrong = [number for number in odd if not is_comment(lines[number])]
    if len(wrong) > max(1, _MOST_ODD * len(kept)):
        width = len(layout.fields(lines[wrong[0]]))
        raise ExperimentError(file, f"has {width} columns, others have {layout.width}", line=wrong[0] + 1)
    notes = [f"{_of_lines(odd)} no row of {layout.width} columns: left out"] if odd else []
    if spring := _spring_of(lines[:begin]):
        notes.append(f"the header has a spring constant of {spring}: {_OF_SPRING}")
    notes += [of_headers] if of_headers else []
    return Table(
        file,
        tuple(replace(one, unit="s") if number in clocks else one for number, one in enumerate(headers)),
        values,
        np.array(kept) + 1,
        strange,
        tuple(notes),
        layout,
        spring,
        "" if has_names else of_headers,
    )


def _spring_of(before: Sequence[str]) -> str:
    """Return the spring constant that the lines above a table have, as a study writes it; "" for none."""
    found = next(filter(None, map(_SPRING.search, before)), None)
    unit = (found and found["unit"]) or "N/m"
    try:
        return f"{found['value']} {unit}" if found and unit_factor(unit, "N/m") > 0 < float(found["value"]) else ""
    except ValueError:
        return ""


def _begin(lines: Sequence[str], layout: Layout) -> int | None:
    """Return the first line of the rows: a summary above them has fewer in a row. None if there is no row."""
    full = [number for number, line in enumerate(lines) if line.strip()]
    rows: list[int] = []  # one after the other, up to the line
    first = None
    for number in full:
        rows = [*rows, number] if layout.is_row(lines[number]) else []
        first = rows[0] if rows and first is None else first
        if len(rows) == _ROWS:
            return rows[0]
    return first


def _width(line: str, layout: Layout) -> int:
    """Return the number of fields of a line; 0 of a comment."""
    is_plain = '"' not in line and layout.separator != " "
    width = line.count(layout.separator) + 1 if is_plain else len(layout.fields(line))
    return 0 if is_comment(line) else width


def _of_lines(odd: Sequence[int]) -> str:
    if len(odd) == 1:
        return f"line {odd[0] + 1} is"
    return f"{len(odd)} lines, such as line {odd[0] + 1}, are"


def _values(
    rows: Sequence[str], layout: Layout, lines: IntArray, strange: dict[int, tuple[int, str]]
) -> tuple[FloatArray, set[int]]:
    """Return the numbers of rows, and the columns that have clock times; ``strange`` gets texts that are neither."""
    separator = r"\s+" if layout.separator == " " else layout.separator
    if any('"' in row for row in rows):
        rows, separator = [_UNIT.join(layout.fields(row)) for row in rows], _UNIT
    frame = pd.read_csv(
        StringIO("\n".join(rows)),
        sep=separator,
        quoting=csv.QUOTE_NONE,
        decimal=layout.decimal,
        header=None,
        names=list(range(layout.width)),
        index_col=False,
        skipinitialspace=True,
        skip_blank_lines=False,
        low_memory=False,
    )
    is_text = [not is_numeric_dtype(frame[number]) or is_bool_dtype(frame[number]) for number in frame]
    texts = {number: frame[number].map(str).str.strip() for number in np.flatnonzero(is_text).tolist()}
    clocks = {number for number, text in texts.items() if is_clock(text.iloc[0])}
    dates = [text + " " for text in texts.values() if is_date(text.iloc[0])]
    for number, text in texts.items():
        if number not in clocks:
            frame[number] = _numbers(number, frame[number], text, layout, lines, strange)
        elif len(dates) == 1 and is_clock(dates[0].iloc[0] + text.iloc[0]):
            frame[number] = seconds(dates[0] + text)
        else:
            frame[number] = seconds(text)
    found = frame.to_numpy(float)
    return np.where(np.isfinite(found), found, np.nan), clocks


def _numbers(
    number: int,
    column: "pd.Series[str]",
    text: "pd.Series[str]",
    layout: Layout,
    lines: IntArray,
    strange: dict[int, tuple[int, str]],
) -> "pd.Series[float]":
    """Return the numbers of a column with texts, of which ``strange`` gets the first that does not mean missing."""
    is_comma = layout.decimal == ","  # then a point is for thousands, or another decimal sign
    numbers = pd.to_numeric(text.str.replace(",", ".", regex=False) if is_comma else text, errors="coerce")
    wrong = numbers.isna() & ~text.str.lower().isin(MISSING) | (text.str.contains(".", regex=False) & is_comma)
    wrong &= column.notna()
    if wrong.any():
        first = int(np.argmax(wrong.to_numpy()))
        strange[number] = (int(lines[first]), str(text.iloc[first])[:_QUOTED])
    return numbers
