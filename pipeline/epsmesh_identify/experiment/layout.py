"""The layout of a table in a text: separator, decimal sign and number of columns."""

import csv
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

from epsmesh_identify.experiment.clock import is_clock, is_date

# Whitespace comes last: lines with another separator may have spaces, too.
_SEPARATORS = ("\t", ";", ",", "|", " ")
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

    separator: str = ","
    decimal: str = "."
    width: int = 0

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line, without quotation marks and spaces around them."""
        if self.separator == " ":
            return line.split()
        if '"' in line:
            line_of_fields = csv.reader([line], delimiter=self.separator, skipinitialspace=True)
            return [field.strip() for field in next(line_of_fields)]
        return [field.strip() for field in line.split(self.separator)]

    def is_number(self, text: str) -> bool:
        """Tell whether a field is a number."""
        return _NUMBERS[self.decimal].fullmatch(text) is not None

    def numbers(self, fields: Sequence[str]) -> float:
        """Return the share of fields with numbers or without a value, of a row that has one number and no text, or two.

        Texts such as names and clock times are in columns of their own.
        """
        numbers = sum(map(self.is_number, fields))
        missing = sum(field.lower() in MISSING for field in fields)
        is_row = numbers > 1 or (numbers > 0 and numbers + missing == len(fields) > 1)
        return (numbers + missing) / len(fields) if is_row else 0.0

    def is_row(self, line: str) -> bool:
        """Tell a row of numbers, dates and clock times; where a column has text, one of them for the most part."""
        fields = self.fields(line)
        if len(fields) != self.width or not (share := self.numbers(fields)):
            return False
        return share + sum(is_clock(field) or is_date(field) for field in fields) / self.width > 0.5


def find_layout(lines: Sequence[str]) -> Layout | None:
    """Return the layout with which most lines are rows of equal width; None if there is none.

    Every separator and decimal sign is tried on each of the sampled lines.
    """
    sample = [line for line in lines[:: max(1, len(lines) // _SAMPLE)] if line.strip()]
    is_quoted = any('"' in line for line in sample)  # then a comma may be in a number and between numbers
    best, found = 0.0, None
    for separator, decimal in product(_SEPARATORS, _NUMBERS):
        layout, shares = Layout(separator, decimal), defaultdict[int, float](float)
        for fields in map(layout.fields, sample) if separator != decimal or is_quoted else ():
            shares[len(fields)] += layout.numbers(fields)
        width, share = max(shares.items(), key=lambda one: one[1], default=(0, 0.0))
        if share > best:
            best, found = share, replace(layout, width=width)
    return found
