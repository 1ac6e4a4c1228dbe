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
from epsmesh_identify.experiment.headings import has_headers, headers_of
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
    layout: Layout = field(default_factory=lambda: Layout(",", ".", 0))
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
    kept, odd = _rows(lines, begin, layout)
    _check_decimals(lines[:begin], layout, file, begin)
    wrong = [number for number in odd if not is_comment(lines[number])]
    if len(wrong) > max(1, _MOST_ODD * len(kept)):
        width = len(layout.fields(lines[wrong[0]]))
        raise ExperimentError(file, f"has {width} columns, others have {layout.width}", line=wrong[0] + 1)
    notes = [f"{_of_lines(odd)} no row of {layout.width} columns: left out"] if odd else []
    if spring := spring_of(lines[:begin]):
        notes.append(f"the header has a spring constant of {spring}: {_OF_SPRING}")
    numbers = np.array(kept) + 1
    values, strange, clocks = _values([lines[n] for n in kept], layout, numbers)
    headers, of_headers = headers_of(lines[:begin], layout, values)
    notes += [of_headers] if of_headers else []
    headers = tuple(replace(one, unit="s") if n in clocks else one for n, one in enumerate(headers))
    unused = "" if any(header.text for header in headers) else of_headers
    return Table(file, headers, values, numbers, strange, tuple(notes), layout, spring, unused)


def spring_of(before: Sequence[str]) -> str:
    """Return the spring constant that the lines above a table have, as a study writes it; "" for none."""
    for line in before:
        if found := _SPRING.search(line):
            unit = found["unit"] or "N/m"
            try:
                return f"{found['value']} {unit}" if unit_factor(unit, "N/m") > 0 < float(found["value"]) else ""
            except ValueError:
                return ""
    return ""


def _begin(lines: Sequence[str], layout: Layout) -> int | None:
    """Return the first line of the rows: a summary above them has fewer in a row. None if there is no row."""
    first, run = None, 0
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        run = run + 1 if _is_data(layout, line) else 0
        if run == 1:
            start = number
            first = number if first is None else first
        if run == _ROWS:
            return start
    return first


def _is_data(layout: Layout, line: str) -> bool:
    """Tell a row of numbers, dates and clock times; where a column has text, one of them for the most part."""
    fields = layout.fields(line)
    if len(fields) != layout.width:
        return False
    numbers = sum(map(layout.is_number, fields))
    times = sum(is_clock(field) or is_date(field) for field in fields)
    return layout.is_row(fields) or (numbers > 1 and numbers + times > layout.width / 2)


def _rows(lines: Sequence[str], begin: int, layout: Layout) -> tuple[list[int], list[int]]:
    """Return which lines from ``begin`` on have the right number of columns, and which others have text."""
    kept: list[int] = []
    odd: list[int] = []
    for number in range(begin, len(lines)):
        line = lines[number]
        if not line.strip():
            continue
        is_plain = '"' not in line and layout.separator != " "
        width = line.count(layout.separator) + 1 if is_plain else len(layout.fields(line))
        (kept if width == layout.width and not is_comment(line) else odd).append(number)
    return kept, odd


def _of_lines(odd: Sequence[int]) -> str:
    if len(odd) == 1:
        return f"line {odd[0] + 1} is"
    return f"{len(odd)} lines, such as line {odd[0] + 1}, are"


def _values(
    rows: Sequence[str], layout: Layout, lines: IntArray
) -> tuple[FloatArray, dict[int, tuple[int, str]], set[int]]:
    """Return the numbers of rows, the first text that is none of each column, and the columns that have clock times."""
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
    found = np.empty(frame.shape)
    strange: dict[int, tuple[int, str]] = {}
    clocks: set[int] = set()
    dates = [text for text in (frame[number].map(str).str.strip() for number in frame) if is_date(text.iloc[0])]
    for number in range(layout.width):
        column = frame[number]
        if not is_numeric_dtype(column) or is_bool_dtype(column):
            text = column.map(str).str.strip()
            if is_clock(text.iloc[0]):
                is_apart = len(dates) == 1 and is_clock(f"{dates[0].iloc[0]} {text.iloc[0]}")
                found[:, number] = seconds(dates[0] + " " + text if is_apart else text)
                clocks.add(number)
                continue
            plain = text.str.replace(",", ".", regex=False) if layout.decimal == "," else text
            numbers = pd.to_numeric(plain, errors="coerce")
            wrong = numbers.isna() & column.notna() & ~text.str.lower().isin(MISSING)
            if layout.decimal == ",":  # a point is for thousands, or another decimal sign
                wrong |= text.str.contains(".", regex=False) & column.notna()
            if wrong.any():
                first = int(np.argmax(wrong.to_numpy()))
                strange[number] = (int(lines[first]), str(text.iloc[first])[:_QUOTED])
            column = numbers
        found[:, number] = column.to_numpy(float)
    found[~np.isfinite(found)] = np.nan
    return found, strange, clocks


def _check_decimals(before: Sequence[str], layout: Layout, file: str, begin: int) -> None:
    """Report numbers with decimal commas between which there are commas, too."""
    if layout.separator != "," or has_headers(before, layout):
        return
    for line in before:
        fields = layout.fields(line)
        is_header = len(fields) > 1 and not any(map(layout.is_number, fields))
        if is_header and len(fields) < layout.width <= 2 * len(fields):
            raise ExperimentError(
                file,
                f"has {layout.width} columns, and a header of {len(fields)}: decimal commas are not distinguishable "
                "from commas between columns; save it with semicolons",
                line=begin + 1,
            )
