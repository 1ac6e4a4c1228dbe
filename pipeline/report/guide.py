"""The guideline: which mesh settings keep F near F_exact over all scenes of a study, and at what cost.

The error of a setting is the worst over the scenes of |F/F_exact - 1|, to which the error bars of F and of F_exact are
added. A setting that lacks a case is not judged; scenes that no setting can be judged on are left out, and named.
"""

import json
from collections import Counter
from math import inf, isfinite

import numpy as np
import xarray as xr

from pipeline.printable import counted
from pipeline.report import guide_text
from pipeline.report.guideline import Guideline
from pipeline.report.sinking import tools
from pipeline.report.table import DatasetError, arrange
from pipeline.report.times import doubts
from pipeline.report.verdict import choose, judge, keeps, most_accurate
from pipeline.units import parse_quantity

# The accuracy that the report asks for; `epsmesh guide` answers for any.
USUAL_ACCURACY = "5 %"


class Guide(Guideline):
    """A guideline in words, which prints as the text for people."""

    question = property(guide_text.question)
    setting = property(guide_text.setting)
    details = property(guide_text.details)
    others = property(guide_text.others)
    settings = property(guide_text.settings)
    __str__ = __repr__ = guide_text.text


def guide_if_any(dataset: xr.Dataset) -> Guide | None:
    """Return the guide for a usual accuracy, or None if nothing can be judged."""
    try:
        return guide(dataset, USUAL_ACCURACY)
    except DatasetError:
        return None


def guide(dataset: xr.Dataset, accuracy: str | float | None = None, budget: str | float | None = None) -> Guide:
    """Answer from ``dataset``; ``accuracy`` as "5 %" or a share, ``budget`` as "10 ms" or seconds.

    Raises:
        DatasetError: if nothing can be judged.
        ValueError: if neither is given, or one makes no sense.
    """
    if accuracy is None and budget is None:
        raise ValueError("give an accuracy such as '5 %', a budget such as '10 ms', or both")
    wanted = quantity("accuracy", accuracy, "") if accuracy is not None else inf
    seconds = quantity("budget", budget, "s") if budget is not None else inf
    table = arrange(dataset)
    if table.lost.all():
        reasons = "; ".join(f"{count} {why}" for why, count in Counter(table.why.ravel()).most_common())
        raise DatasetError(f"no case can be judged: {reasons}")
    verdicts = tuple(judge(table, row) for row in range(len(table.settings)))
    keeping = [v for v in verdicts if keeps(v, verdicts, wanted, "force") and v.seconds <= seconds]
    return Guide(
        title=str(dataset.attrs.get("title", "")),
        accuracy=wanted,
        budget=seconds,
        scenes=int((~table.lost).sum()),
        axes=tuple((name, len(np.unique(labels))) for name, labels in table.axes.items()),
        verdicts=verdicts,
        answer=choose(verdicts, wanted, seconds),
        corrected=choose(verdicts, wanted, seconds, "ratio"),
        best=most_accurate(verdicts, seconds),
        best_corrected=most_accurate(verdicts, seconds, "ratio"),
        carried=choose(verdicts, wanted, seconds, "tools"),
        best_carried=most_accurate(verdicts, seconds, "tools"),
        lean=min(keeping, key=lambda v: v.dofs, default=None) if isfinite(wanted) else None,
        left_out=_counts(table.why[:, table.lost]),
        unjudged=_counts(table.why[:, ~table.lost]),
        lost=tuple(scene for scene, lost in zip(table.scenes, table.lost, strict=True) if lost),
        has_full=bool(np.isfinite(table.share).any()),
        timing=_timing(dataset),
        tools=tools(case for case, one in zip(table.cases, table.sinking, strict=True) if case and not one.why_not),
        no_law=_counts(np.array([one.why_not for one in table.sinking])),
        doubts=tuple(doubts(dataset)),
    )


def quantity(name: str, value: str | float, unit: str) -> float:
    """Read an accuracy or a budget: text with a unit, or an SI number.

    Raises:
        ValueError: with what is allowed.
    """
    try:
        number = parse_quantity(value, unit) if isinstance(value, str) else float(value)
    except ValueError as wrong:
        raise ValueError(f"{name} = {value!r}: must be {wrong}") from None
    if not 0 < number < (1 if unit == "" else inf):
        allowed = 'more than "0 %" and less than "100 %"' if unit == "" else 'more than "0 s"'
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return number


def _counts(why: np.ndarray) -> tuple[tuple[str, int], ...]:
    return tuple(Counter(str(text) for text in why.ravel() if text != "").most_common())


def _timing(dataset: xr.Dataset) -> str:
    """Say what the times are worth: where they were taken, and whether every case ran afresh and alone."""
    ranks = str(dataset.attrs.get("ranks", 1))  # "1, 2" where groups of ranks differed
    where = f"{counted(int(ranks), 'rank') if ranks.isdigit() else f'{ranks} ranks'}"
    where += f" of {dataset.attrs.get('host', 'an unnamed machine')}"
    struck = json.loads(str(dataset.attrs.get("reductions", "[]")))
    if any(one["name"] == "axisymmetric" for one in struck):
        where += ", round scenes on their meridian, with elements of its own"
    return f"{where}, {'every case afresh and alone' if dataset.attrs.get('timing') else 'no timing study'}"
