"""The guideline: which mesh settings keep F near F_exact over all scenes of a study, and at what cost.

The error of a setting is the worst over the scenes of |F/F_exact - 1|, to which the error bars of F and of F_exact are
added. Nothing is claimed of a case that was not computed: a setting that lacks one is not judged, and scenes that no
setting can be judged on are left out of every claim, and named.
"""

from collections import Counter
from dataclasses import asdict, dataclass
from math import inf, isfinite
from typing import Any

import numpy as np
import xarray as xr

from pipeline.report.table import DatasetError, Labels, arrange
from pipeline.report.verdict import Verdict, choose, judge, keeps, most_accurate
from pipeline.units import parse_quantity


@dataclass(frozen=True)
class Guide:
    """The answer for ``accuracy`` (relative) and ``budget`` (s a case); infinite where not asked for.

    ``answer`` is the chosen setting, ``corrected`` the one with F_exact ≈ F / r, ``best`` and ``best_corrected`` the
    most accurate there are within the budget; None if there is none. ``lean`` has the fewest unknowns of those
    that keep the accuracy. ``left_out`` counts the scenes lost to every setting, by reason, and ``unjudged`` the cases
    that keep settings from being judged.
    """

    title: str
    accuracy: float
    budget: float
    scenes: int
    axes: tuple[tuple[str, int], ...]
    verdicts: tuple[Verdict, ...]
    answer: Verdict | None
    corrected: Verdict | None
    best: Verdict | None
    best_corrected: Verdict | None
    lean: Verdict | None
    left_out: tuple[tuple[str, int], ...]
    unjudged: tuple[tuple[str, int], ...]
    lost: tuple[Labels, ...]
    has_full: bool
    timing: str

    def rows(self) -> list[dict[str, Any]]:
        """Return the table behind the answer, a row for each setting, in SI units; full order is ε = infinity."""
        return [_row(verdict, self) for verdict in self.verdicts]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, in SI units: dictionaries, lists, texts and numbers."""
        chosen = ("answer", "corrected", "best", "best_corrected", "lean")
        rows = dict(zip(map(id, self.verdicts), self.rows(), strict=True))
        return {
            "title": self.title, "accuracy": self.accuracy, "budget": self.budget, "scenes": self.scenes,
            "axes": dict(self.axes), **{name: rows.get(id(getattr(self, name))) for name in chosen},
            "outside": {
                name: {"answer": rows.get(id(plain)), "corrected": rows.get(id(law))}
                for name, (plain, law) in self.of_each_outside().items()
            },
            "settings": list(rows.values()), "left_out": dict(self.left_out), "lost": list(self.lost),
            "unjudged": dict(self.unjudged), "timing": self.timing,
        }  # fmt: skip

    def of_each_outside(self) -> dict[str, tuple[Verdict | None, Verdict | None]]:
        """Return, for each swept value of outside, the answer as F stands and the corrected one."""
        names = dict.fromkeys(v.labels["outside"] for v in self.verdicts if "outside" in v.labels)
        groups = {
            name: tuple(v for v in self.verdicts if v.labels["outside"] == name or v.labels.get("epsilon") == inf)
            for name in names
        }
        return {
            name: (choose(group, self.accuracy, self.budget), choose(group, self.accuracy, self.budget, corrected=True))
            for name, group in groups.items()
        }

    def __str__(self) -> str:
        from pipeline.report.guide_text import text  # noqa: PLC0415 (it imports this module)

        return text(self)

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
    keeping = [v for v in verdicts if keeps(v, verdicts, wanted, corrected=False) and v.seconds <= seconds]
    return Guide(
        str(dataset.attrs.get("title", "")), wanted, seconds, int((~table.lost).sum()),
        tuple((name, len(np.unique(labels))) for name, labels in table.axes.items()),
        verdicts, choose(verdicts, wanted, seconds), choose(verdicts, wanted, seconds, corrected=True),
        most_accurate(verdicts, seconds), most_accurate(verdicts, seconds, corrected=True),
        min(keeping, key=lambda v: v.dofs, default=None) if isfinite(wanted) else None,
        _counts(table.why[:, table.lost]), _counts(table.why[:, ~table.lost]),
        tuple(scene for scene, lost in zip(table.scenes, table.lost, strict=True) if lost),
        bool(np.isfinite(table.share).any()), _timing(dataset),
    )  # fmt: skip


def quantity(name: str, value: str | float, unit: str) -> float:
    """Read an accuracy or a budget: text with a unit, or an SI number.

    Raises:
        ValueError: with what is allowed.
    """
    example = {"": "5 %", "s": "10 ms"}[unit]
    try:
        number = parse_quantity(value, unit) if isinstance(value, str) else float(value)
    except ValueError:
        raise ValueError(f'{name} = {value!r}: must be a number with a unit as text, such as "{example}"') from None
    if not 0 < number < (1 if unit == "" else inf):
        allowed = 'more than "0 %" and less than "100 %"' if unit == "" else 'more than "0 s"'
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return number


def _row(verdict: Verdict, guide: Guide) -> dict[str, Any]:
    plain = {k: v for k, v in verdict.__dict__.items() if k not in ("labels", "mesh", "spread", "correction")}
    spread = verdict.spread
    return {
        **verdict.labels, "mesh": verdict.mesh, **plain, "judged": verdict.is_judged,
        "keeps": bool(verdict.is_judged and verdict.error <= guide.accuracy and verdict.seconds <= guide.budget),
        "ratio_min": spread.least, "ratio_max": spread.most, "ratio_spread": spread.width,
        "ratio_spread_relative": spread.relative, "ratio_spread_over": dict(spread.over),
        "correction": asdict(verdict.correction),
    }  # fmt: skip


def _counts(why: np.ndarray) -> tuple[tuple[str, int], ...]:
    return tuple(Counter(str(text) for text in why.ravel() if text != "").most_common())


def _listed(counts: Counter[Any]) -> str:
    return "; ".join(f"{count} {text}" for text, count in counts.most_common())


def _timing(dataset: xr.Dataset) -> str:
    """Say what the times are worth: where they were taken, and whether every case ran afresh and alone."""
    ranks = str(dataset.attrs.get("ranks", 1))  # "1, 2" where groups of ranks differed
    where = f"{ranks} rank{'s' * (ranks != '1')} of {dataset.attrs.get('host', 'an unnamed machine')}"
    return f"{where}, {'every case afresh and alone' if dataset.attrs.get('timing') else 'no timing study'}"
