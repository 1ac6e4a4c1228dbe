"""Clock times in columns of files, such as 12:21:07.250, 2025-10-30 12:21:07 or 10/30/2025 12:21:07 PM."""

import re

import numpy as np
import pandas as pd

from epsmesh.arrays import FloatArray

_DATE = (
    r"(?:(?P<year>\d{4})[-/](?P<month>\d{1,2})[-/](?P<day>\d{1,2})"
    r"|(?P<first>\d{1,2})(?P<sign>[./])(?P<second>\d{1,2})[./](?P<last>\d{4}))"
)
_ONLY_DATE = re.compile(_DATE)
_CLOCK = re.compile(
    rf"(?:{_DATE}[T ])?(?P<hours>\d{{1,2}}):(?P<minutes>\d{{2}}):(?P<seconds>\d{{2}}(?:[.,]\d+)?)"
    r"(?: ?(?P<half>[AaPp])[Mm])?(?: ?(?:Z|(?P<zone>[+-])(?P<ahead>\d{2}):?(?P<more>\d{2})))?"
)
_DAY = 86400.0


def is_clock(text: str) -> bool:
    """Tell a clock time, with or without a date."""
    return _CLOCK.fullmatch(text) is not None


def is_date(text: str) -> bool:
    """Tell a date without a clock time."""
    return _ONLY_DATE.fullmatch(text) is not None


def seconds(column: "pd.Series[str]") -> FloatArray:
    """Return clock times (n,) as seconds since the first midnight; NaN where a text is none.

    Days are those of the dates. Without dates they are counted at each midnight.
    """
    found = column.str.extract(_CLOCK)
    parts = found[["hours", "minutes", "seconds"]].apply(lambda part: part.str.replace(",", ".", regex=False))
    since = parts.astype(float).to_numpy() @ np.array([3600.0, 60.0, 1.0])
    half = found["half"].str.lower().to_numpy()
    since = since - _DAY / 2 * ((half == "a") | (half == "p")) * (since >= _DAY / 2) + _DAY / 2 * (half == "p")
    ahead = found[["ahead", "more"]].astype(float).fillna(0.0).to_numpy() @ np.array([3600.0, 60.0])
    since = since - np.where(found["zone"] == "-", -ahead, ahead)
    if found[["day", "first"]].notna().any(axis=None):
        return np.asarray(since + _DAY * _days(found))
    known = np.flatnonzero(~np.isnan(since))
    days = np.zeros(len(since))
    days[known[1:]] = np.cumsum(np.diff(since[known]) < -_DAY / 2)
    return np.asarray(since + _DAY * days)


def _days(found: pd.DataFrame) -> FloatArray:
    """Return the days (n,) of dates, from the first one on; NaN where there is none.

    10/11/2025 is in October or November: that order is taken which makes sense of all dates and, if both do, by which
    the record is the shorter.
    """
    if found["day"].notna().any():
        return _counted(found, "year", "month", "day")
    orders = [("last", "second", "first")]
    if (found["sign"] == "/").any():
        orders.append(("last", "first", "second"))
    ways = [_counted(found, *order) for order in orders]
    return min(ways, key=lambda days: (np.isnan(days).sum(), bool((np.diff(days) < 0).any()), np.ptp(days)))


def _counted(found: pd.DataFrame, year: str, month: str, day: str) -> FloatArray:
    """Return the days (n,) of dates from the first one on, NaN where there is none."""
    parts = {"year": found[year], "month": found[month], "day": found[day]}
    dates = pd.to_datetime(pd.DataFrame(parts).astype(float), errors="coerce")
    return np.asarray((dates - dates.dropna().min()) / pd.Timedelta(days=1), dtype=float)
