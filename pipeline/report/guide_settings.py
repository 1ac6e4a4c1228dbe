"""The mesh settings of a guide as a table in words: one for the command line and for the report, number for number."""

from pipeline.report.guide_words import cells_of, heads, in_order, number, percent, ratio, time
from pipeline.report.guideline import Guideline
from pipeline.report.verdict import Verdict

# What is judged of a setting, by the heading of its column.
ERROR, USUAL, TIME, UNKNOWNS = "worst error", "usual", "time", "unknowns"
RATIO, RESIDUAL, LEFT_OUT, UNSEEN, OFF = "r", "residual", "left out", "unseen", "F/r is off by"


def settings(guide: Guideline) -> list[dict[str, str]]:
    """Return a row for each setting, heading to text: what they differ in, and what is judged.

    ``time`` is the largest over the scenes, ``usual`` the median. Of a setting that is not judged only the error is
    there, which says why.
    """
    return [dict(zip(heads(guide), cells_of(v), strict=True)) | _judged(v, guide) for v in in_order(guide)]


def range_of(guide: Guideline) -> str:
    """Return the heading of the column with the range of F/F_max, or of F/F_exact where there is no full order."""
    return "F/F_max" if guide.has_full else "F/F_exact"


def _judged(verdict: Verdict, guide: Guideline) -> dict[str, str]:
    if not verdict.is_judged:
        return {ERROR: f"not judged: {verdict.missing} of {guide.scenes} scenes not computed"}
    law, spread = verdict.correction, verdict.spread
    return {
        ERROR: percent(verdict.error), USUAL: time(verdict.usual), TIME: time(verdict.seconds),
        UNKNOWNS: f"{verdict.dofs:,.0f}",
        range_of(guide): f"{number(spread.least)} … {number(spread.most)}" if spread.most == spread.most else "",
        RATIO: ratio(law.r), RESIDUAL: percent(law.residual), LEFT_OUT: percent(law.left_out),
        UNSEEN: percent(law.unseen), OFF: percent(law.error),
    }  # fmt: skip
