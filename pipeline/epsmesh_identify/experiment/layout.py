"""The layout of a table in a text: separator, decimal sign and number of columns."""

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

# Whitespace comes last: lines with another separator may have spaces, too.
_SEPARATORS = ("\t", ";", ",", "|", " ")
_DECIMALS = (".", ",")
_NUMBERS = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
# What programs write where there is no value.
MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "inf", "-inf", "+inf"})
# Lines by which a layout is judged.
_SAMPLE = 200


@dataclass(frozen=True)
class Layout:
    """Separator (a space is any whitespace), decimal sign, and the number of columns."""

    separator: str
    decimal: str
    width: int

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line, without quotation marks and spaces around them."""
        return splitter(self.separator)(line)

    def is_number(self, text: str) -> bool:
        """Tell whether a field is a number."""
        return _NUMBERS[self.decimal].fullmatch(text) is not None

    def is_row(self, fields: Sequence[str]) -> bool:
        """Tell whether fields are a row of numbers; some may be missing."""
        numbers = sum(map(self.is_number, fields))
        return (
            len(fields) == self.width
            and numbers > 0
            and all(self.is_number(field) or field.lower() in MISSING for field in fields)
        )


def splitter(separator: str) -> Callable[[str], list[str]]:
    """Return the function that splits a line into its fields."""

    def split(line: str) -> list[str]:
        if separator == " ":
            return line.split()
        if '"' in line:
            return [field.strip() for field in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
        return [field.strip() for field in line.split(separator)]

    return split


def find_layout(lines: Sequence[str]) -> Layout | None:
    """Return the layout with which most lines are rows of equal width; None if there is none.

    Every separator and decimal sign is tried on each of the sampled lines. A column of text, such as a name or a clock
    time, is no number in any layout: without rows of numbers alone, those with the largest share of numbers count.
    """
    step = max(1, len(lines) // _SAMPLE)
    sample = [line for line in lines[::step] if line.strip()]
    is_quoted = any('"' in line for line in sample)  # then a comma may be in a number and between numbers
    best, found = (0, 0.0), None
    for separator in _SEPARATORS:
        rows = [row for row in map(splitter(separator), sample) if len(row) > 1]
        for decimal in _DECIMALS:
            if not rows or (separator == decimal and not is_quoted):
                continue
            score, width = _score(rows, decimal)
            if score > best:
                best, found = score, Layout(separator, decimal, width)
    return found


def _score(rows: Sequence[Sequence[str]], decimal: str) -> tuple[tuple[int, float], int]:
    """Return how many rows of equal width have numbers alone, and the sum of shares of numbers; and that width."""
    number = _NUMBERS[decimal]
    whole: Counter[int] = Counter()
    shares: Counter[int] = Counter()
    for row in rows:
        numbers = sum(number.fullmatch(field) is not None for field in row)
        missing = sum(field.lower() in MISSING for field in row)
        width = len(row)
        if numbers + missing == width and numbers:
            whole[width] += 1
        if numbers > 1:
            shares[width] += (numbers + missing) / width  # type: ignore[assignment]
    if not whole and not shares:
        return (0, 0.0), 0
    width = max({*whole, *shares}, key=lambda w: (whole[w], shares[w]))
    return (whole[width], float(shares[width])), width
