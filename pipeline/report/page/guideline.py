"""The guide as a section of the report: the answer for a usual accuracy, and the settings behind it."""

from dataclasses import dataclass

import xarray as xr

from pipeline.report.guide import guide
from pipeline.report.guide_settings import ERROR, OFF, RATIO, TIME, UNKNOWNS, USUAL, range_of, settings
from pipeline.report.guide_text import answer, question
from pipeline.report.guide_words import heads
from pipeline.report.table import DatasetError

# The accuracy that the report asks for; `epsmesh guide` answers for any.
ACCURACY = "5 %"


@dataclass(frozen=True)
class Section:
    """What is asked and the answer, in lines, and a row for each mesh setting: heading to text."""

    lines: tuple[str, ...]
    rows: tuple[dict[str, str], ...]


def guide_section(dataset: xr.Dataset) -> Section | None:
    """Return the guide of ``dataset``, or None if nothing can be judged."""
    try:
        found = guide(dataset, ACCURACY)
    except DatasetError:
        return None
    columns = [*heads(found), ERROR, UNKNOWNS, USUAL, TIME, range_of(found), RATIO, OFF]
    rows = [{name: row.get(name, "") for name in columns} for row in settings(found)]
    return Section((*question(found), *answer(found)), tuple(rows))
