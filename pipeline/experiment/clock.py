"""Clock times in columns of files, such as 12:21:07.250 or 2025-10-30 12:21:07."""

import re

import numpy as np
import pandas as pd

from pipeline.arrays import FloatArray

_CLOCK = re.compile(r"(?:\d{4}-\d{2}-\d{2}[T ]|\d{1,2}[./]\d{1,2}[./]\d{4} )?(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)")
_DAY = 86400.0


def is_clock(text: str) -> bool:
    """Tell a clock time, with or without a date."""
    return _CLOCK.fullmatch(text) is not None


def seconds(column: "pd.Series[str]") -> FloatArray:
    """Return clock times (n,) as seconds since the first midnight; NaN where a text is none. Days count on."""
    found = column.str.extract(_CLOCK.pattern)
    parts = found.apply(lambda part: part.str.replace(",", ".", regex=False)).astype(float).to_numpy()
    since = parts @ np.array([3600.0, 60.0, 1.0])
    known = np.flatnonzero(~np.isnan(since))
    days = np.zeros(len(since))
    days[known[1:]] = np.cumsum(np.diff(since[known]) < -_DAY / 2)
    return np.asarray(since + _DAY * days)
