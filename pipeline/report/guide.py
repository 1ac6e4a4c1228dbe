"""The guideline: which mesh settings keep F near F_exact over all scenes of a study, and at what cost.

The error of a setting is the worst over the scenes of |F/F_exact - 1|, to which the error bars of F and of F_exact are
added. Nothing is claimed of a case that was not computed: a setting that lacks one is not judged, and scenes that no
setting can be judged on are left out of every claim, and named.
"""

import json
from collections import Counter
from math import inf, isfinite
from typing import Any

import numpy as np
import xarray as xr

from pipeline.report import guide_text
from pipeline.report.guideline import Guideline
from pipeline.report.sinking import tools
from pipeline.report.table import DatasetError, arrange
from pipeline.report.times import doubts
from pipeline.report.verdict import choose, judge, keeps, most_accurate
from pipeline.units import parse_quantity


class Guide(Guideline):
    """A guideline that prints as the text for people."""

    def __str__(self) -> str:
        return guide_text.text(self)

    __repr__ = __str__


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
        raise DatasetError(f"no case can be judged: {_listed(Counter(table.why.ravel()))}")
    verdicts = tuple(judge(table, row) for row in range(len(table.settings)))
    keeping = [v for v in verdicts if keeps(v, verdicts, wanted, "force") and v.seconds <= seconds]
    return Guide(
        str(dataset.attrs.get("title", "")), wanted, seconds, int((~table.lost).sum()),
        tuple((name, len(np.unique(labels))) for name, labels in table.axes.items()),
        verdicts, choose(verdicts, wanted, seconds), choose(verdicts, wanted, seconds, "ratio"),
        most_accurate(verdicts, seconds), most_accurate(verdicts, seconds, "ratio"),
        choose(verdicts, wanted, seconds, "tools"), most_accurate(verdicts, seconds, "tools"),
        min(keeping, key=lambda v: v.dofs, default=None) if isfinite(wanted) else None,
        _counts(table.why[:, table.lost]), _counts(table.why[:, ~table.lost]),
        tuple(scene for scene, lost in zip(table.scenes, table.lost, strict=True) if lost),
        bool(np.isfinite(table.share).any()), _timing(dataset),
        tools(case for case, one in zip(table.cases, table.sinking, strict=True) if case and not one.why_not),
        _counts(np.array([one.why_not for one in table.sinking])), tuple(doubts(dataset)),
    )  # fmt: skip


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


def _listed(counts: Counter[Any]) -> str:
    return "; ".join(f"{count} {text}" for text, count in counts.most_common())


def _has_meridians(dataset: xr.Dataset) -> bool:
    struck = json.loads(str(dataset.attrs.get("reductions", "[]")))
    return any(one["name"] == "axisymmetric" for one in struck)


def _timing(dataset: xr.Dataset) -> str:
    """Say what the times are worth: where they were taken, and whether every case ran afresh and alone."""
    ranks = str(dataset.attrs.get("ranks", 1))  # "1, 2" where groups of ranks differed
    where = f"{ranks} rank{'s' * (ranks != '1')} of {dataset.attrs.get('host', 'an unnamed machine')}"
    where += ", round scenes on their meridian, with elements of its own" if _has_meridians(dataset) else ""
    return f"{where}, {'every case afresh and alone' if dataset.attrs.get('timing') else 'no timing study'}"
