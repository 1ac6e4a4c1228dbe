"""The guide as a section of the report: the answer for a usual accuracy, and the settings behind it."""

from dataclasses import dataclass

import xarray as xr

from pipeline.report.guide import guide
from pipeline.report.guide_settings import ERROR, OFF, RATIO, TIME, UNKNOWNS, USUAL, range_of, settings
from pipeline.report.guide_text import details, others, question, setting
from pipeline.report.guide_words import heads
from pipeline.report.table import DatasetError

# The accuracy that the report asks for; `epsmesh guide` answers for any.
ACCURACY = "5 %"
# What the report calls the details of an answer, in its order.
_NAMES = {"worst error": "how sure: worst error", "cost": "cost", "times": "times", "elements": "mesh",
          "limited": "limited by"}  # fmt: skip


@dataclass(frozen=True)
class Section:
    """The answer: the setting, what was asked for, names and words of what it is worth, the law of correction in lines.

    Below it stand all mesh settings, ``rows`` of heading to text.
    """

    setting: str
    question: str
    details: tuple[tuple[str, str], ...]
    others: tuple[str, ...]
    rows: tuple[dict[str, str], ...]


def guide_section(dataset: xr.Dataset) -> Section | None:
    """Return the guide of ``dataset``, or None if nothing can be judged."""
    try:
        found = guide(dataset, ACCURACY)
    except DatasetError:
        return None
    columns = [*heads(found), ERROR, UNKNOWNS, USUAL, TIME, range_of(found), RATIO, OFF]
    rows = [{name: row.get(name, "") for name in columns} for row in settings(found)]
    named = [(name, [words for other, words in details(found) if other == name]) for name in _NAMES]
    told = tuple((_NAMES[name], "; ".join(words)) for name, words in named if words)
    return Section(setting(found), " ".join(question(found)), told, tuple(others(found)), tuple(rows))
