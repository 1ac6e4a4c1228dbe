"""Clock times in columns of files, such as 12:21:07.250, 2025-10-30 12:21:07 or 10/30/2025 12:21:07 PM."""

import re

import numpy as np
import pandas as pd

from epsmesh.arrays import FloatArray

_DATE = re.compile(r"\d{4}[-/]\d{1,2}[-/]\d{1,2}|\d{1,2}[./]\d{1,2}[./]\d{4}")
_CLOCK = re.compile(
    rf"(?:(?P<date>{_DATE.pattern})[T ])?(?P<clock>\d{{1,2}}:\d{{2}}:\d{{2}}(?:[.,]\d+)?)"
    r"(?: ?(?P<half>[AaPp][Mm]))?(?: ?(?P<zone>Z|[+-]\d{2}:?\d{2}))?"
)
_DAY = 86400.0


def is_clock(text: str) -> bool:
    """Tell a clock time, with or without a date."""
    return _CLOCK.fullmatch(text) is not None


def is_date(text: str) -> bool:
    """Tell a date without a clock time."""
    return _DATE.fullmatch(text) is not None


def seconds(column: "pd.Series[str]") -> FloatArray:
    """Return clock times (n,) as seconds since the first midnight; NaN where a text is none.

    Days are those of the dates. Without dates they are counted at each midnight.
    """
    found = column.str.extract(_CLOCK)
    since = pd.to_timedelta(found["clock"].str.replace(",", "."), errors="coerce").dt.total_seconds().to_numpy()
    half = found["half"].str.lower().to_numpy()
    since = np.where(pd.isna(half), since, since % (_DAY / 2) + _DAY / 2 * (half == "pm"))
    zone = found["zone"].fillna("Z").replace("Z", "+0000")
    ahead = pd.to_timedelta(zone.str[1:3] + ":" + zone.str[-2:] + ":00").dt.total_seconds()
    since = since - np.where(zone.str.startswith("-"), -ahead, ahead)
    if found["date"].notna().any():
        return np.asarray(since + _DAY * _days(found["date"]))
    known = np.flatnonzero(~np.isnan(since))
    days = np.zeros(len(since))
    days[known[1:]] = np.cumsum(np.diff(since[known]) < -_DAY / 2)
    return np.asarray(since + _DAY * days)


def _days(dates: "pd.Series[str]") -> FloatArray:
    """Return the days (n,) of dates, from the first one on; NaN where there is none.

    10/11/2025 is in October or November: that order is taken which makes sense of all dates, in which days do not fall
    and, if both do, by which the record is the shorter.
    """
    dates = dates.str.replace("/", "-")
    forms = ("%Y-%m-%d", "%d.%m.%Y", "%d-%m-%Y", "%m-%d-%Y")
    ways = [pd.to_datetime(dates, format=form, errors="coerce") for form in forms]
    days = [np.asarray((way - way.min()) / pd.Timedelta(days=1), dtype=float) for way in ways]
    return min(days, key=lambda way: (np.isnan(way).sum(), bool((np.diff(way) < 0).any()), np.nanmax(way, initial=0)))
