"""The table of the constants of error bars: code uses each of them, and each says what it was fitted to."""

import math
import re
from datetime import date
from pathlib import Path

import pytest

from benchmarks.refit import rows
from epsmesh import fitted

ROOT = Path(__file__).parent.parent
ROWS = rows()


def _used(folder):
    """Return the names that sources in a folder read off the table."""
    texts = [path.read_text(encoding="utf-8") for path in folder.rglob("*.py")]
    return {name for text in texts if "fitted" in text for name in re.findall(r"\bfitted\.([A-Z_]+)", text)}


def _numbers(value):
    if isinstance(value, dict):
        value = tuple(value.values())
    return [number for one in value for number in _numbers(one)] if isinstance(value, tuple) else [value]


def test_each_row_is_used_and_each_constant_is_a_row():
    assert _used(ROOT / "pipeline") == ROWS.keys()
    assert {name for name in vars(fitted) if name.isupper() and not name.startswith("_")} == ROWS.keys()


@pytest.mark.parametrize("name", ROWS)
def test_a_row_has_a_unit_a_source_that_exists_and_the_date_of_its_last_change(name):
    value, fit = ROWS[name]
    assert fit.unit and "|" not in fit.unit
    assert fit.source.startswith("theory: ") or (ROOT / fit.source).is_file(), fit.source
    assert date(2026, 11, 21) <= date.fromisoformat(fit.date)
    assert all(math.isfinite(number) for number in _numbers(value))
