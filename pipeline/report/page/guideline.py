"""The guide as a section of the report: the answer for a usual accuracy, and the settings behind it."""

from dataclasses import dataclass

import xarray as xr

from pipeline.report.guide import guide
from pipeline.report.guide_text import answer
from pipeline.report.guide_words import cells_of, heads, in_order, number, percent, time
from pipeline.report.table import DatasetError
from pipeline.report.verdict import Verdict

# The accuracy that the report asks for; `epsmesh guide` answers for any.
ACCURACY = "5 %"


@dataclass(frozen=True)
class Section:
    """The answer in lines, and a row for each mesh setting: heading to text."""

    lines: tuple[str, ...]
    rows: tuple[dict[str, str], ...]


def guide_section(dataset: xr.Dataset) -> Section | None:
    """Return the guide of ``dataset``, or None if nothing can be judged."""
    try:
        found = guide(dataset, ACCURACY)
    except DatasetError:
        return None
    rows = [dict(zip(heads(found), cells_of(v), strict=True)) | _row(v, found.scenes) for v in in_order(found)]
    return Section(tuple(answer(found)), tuple(rows))


def _row(verdict: Verdict, scenes: int) -> dict[str, str]:
    law, spread = verdict.correction, verdict.spread
    if not verdict.is_judged:
        return {"worst error": f"not judged: {verdict.missing} of {scenes} scenes not computed"}
    return {
        "worst error": percent(verdict.error), "unknowns": f"{verdict.dofs:,.0f}", "time": time(verdict.usual),
        "F/F_max": f"{number(spread.least)} … {number(spread.most)}" if spread.most == spread.most else "",
        "r": number(law.r), "F/r is off by": percent(law.error),
    }  # fmt: skip
