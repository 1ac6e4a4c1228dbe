"""What the cases of a study say of its mesh settings, for an accuracy and a budget."""

import json
from collections import Counter
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from epsmesh.printable import counted
from epsmesh.report.by_scene import Part, parts
from epsmesh.report.laws import Laws
from epsmesh.report.sinking import tools
from epsmesh.report.table import Table
from epsmesh.report.times import doubts
from epsmesh.report.uncertainty import unknowns
from epsmesh.report.verdict import Verdict, choose, judge, keeps, most_accurate

# Settings that are chosen from the verdicts.
_CHOSEN = ("answer", "corrected", "best", "best_corrected", "carried", "best_carried", "lean")
_NOT_PLAIN = {*_CHOSEN, "verdicts", "has_full", "coordinates", "parts"}
# Parts of a verdict that are no number or text.
_APART = ("labels", "mesh", "spread", "correction", "laws", "laws_of_full")


class Guideline:
    """The answer for ``accuracy`` (relative) and ``budget`` (s a case), infinite where not asked for.

    ``answer`` is the chosen setting, ``corrected`` the one with F_exact ≈ F / r, ``carried`` the one with the best law
    for other tools on the same tissue; ``best``, ``best_corrected`` and ``best_carried`` are the most accurate within
    the budget; None if there is none. ``lean`` has the fewest unknowns of those that keep the accuracy. ``left_out``
    counts the cases of the scenes ``uncovered`` by every setting, by reason, ``unjudged`` those that keep settings from
    being judged, ``no_law`` the scenes in which no law adds compliances. ``tools`` are those that laws were fitted to.
    ``reference`` names what F is compared with; ``parts`` are the answers by depth and law. ``tissue`` says what is not
    known of the material, if it was identified.
    """

    def __init__(self, dataset: xr.Dataset, table: Table, accuracy: float, budget: float):
        self.title, self.coordinates = str(dataset.attrs.get("title", "")), dataset.coords
        self.accuracy, self.budget, self.reference = accuracy, budget, table.reference
        self.timing, self.doubts, self.tissue = _timing(dataset), doubts(dataset), unknowns(dataset)
        self.axes = {name: len(np.unique(labels)) for name, labels in table.axes.items()}
        self.scenes = int((~table.uncovered).sum())
        self.uncovered = [scene for scene, uncovered in zip(table.scenes, table.uncovered, strict=True) if uncovered]
        self.left_out, self.unjudged = _counts(table.why[:, table.uncovered]), _counts(table.why[:, ~table.uncovered])
        self.has_full = bool(np.isfinite(table.share).any())
        reasons = table.sinking["why_not"]
        self.no_law = _counts(reasons)
        self.tools = tools(case for case, why in zip(table.cases, reasons, strict=True) if case and not why)
        self.verdicts = verdicts = tuple(judge(table, row) for row in range(len(table.settings)))
        self.answer, self.best = choose(verdicts, accuracy, budget), most_accurate(verdicts, budget)
        self.corrected = choose(verdicts, accuracy, budget, "ratio")
        self.best_corrected = most_accurate(verdicts, budget, "ratio")
        self.carried = choose(verdicts, accuracy, budget, "tools")
        self.best_carried = most_accurate(verdicts, budget, "tools")
        keeping = [verdict for verdict in verdicts if self.keeps(verdict)]
        self.parts = parts(table, accuracy, budget)
        self.lean = min(keeping, key=lambda v: v.dofs, default=None) if isfinite(accuracy) else None

    def keeps(self, verdict: Verdict) -> bool:
        """Tell whether a setting keeps the accuracy within the budget."""
        return keeps(verdict, self.verdicts, self.accuracy, "force") and verdict.seconds <= self.budget

    def rows(self) -> list[dict[str, Any]]:
        """Return the table behind the answer, a row for each setting, in SI units; full order is ε = infinity."""
        return [self._row(verdict) for verdict in self.verdicts]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, in SI units: dictionaries, lists, texts and numbers."""
        rows = dict(zip(map(id, self.verdicts), self.rows(), strict=True))
        return {
            **{name: value for name, value in vars(self).items() if name not in _NOT_PLAIN},
            **{name: rows.get(id(getattr(self, name))) for name in _CHOSEN},
            "settings": list(rows.values()),
            "outside": {
                name: {"answer": rows.get(id(plain)), "corrected": rows.get(id(law))}
                for name, (plain, law) in self.of_each_outside().items()
            },
            "by_scene": [_part(part) for part in self.parts],
        }

    def of_each_outside(self) -> dict[str, tuple[Verdict | None, Verdict | None]]:
        """Return, for each swept value of outside, the answer as F is and the corrected one."""
        found = {}
        for name in dict.fromkeys(v.labels["outside"] for v in self.verdicts if "outside" in v.labels):
            group = tuple(v for v in self.verdicts if v.labels["outside"] == name or v.labels.get("epsilon") == inf)
            asked = group, self.accuracy, self.budget
            found[name] = choose(*asked), choose(*asked, "ratio")
        return found

    def _row(self, verdict: Verdict) -> dict[str, Any]:
        """Return a verdict as plain data."""
        spread = verdict.spread
        return verdict.labels | {
            "mesh": verdict.mesh,
            **{k: v for k, v in vars(verdict).items() if k not in _APART},
            "judged": verdict.is_judged,
            "keeps": bool(self.keeps(verdict)),
            "ratio_min": spread.least,
            "ratio_max": spread.most,
            "ratio_spread": spread.width,
            "ratio_spread_relative": spread.relative,
            "ratio_spread_over": dict(spread.over),
            "correction": asdict(verdict.correction),
            "laws": _laws(verdict.laws),
            "laws_of_full": _laws(verdict.laws_of_full),
        }


def _part(part: Part) -> dict[str, Any]:
    """Return the answers of a part as plain data: ε (m) by outside, infinite where only the full order suffices."""
    widest = {one.outside or "epsilon": one.widest for one in part.answers}
    return {
        **part.where,
        "epsilon": {one.outside or "epsilon": one.epsilon for one in part.answers},
        "widest": {
            name: {"epsilon": v.mesh["epsilon"], "ratio_min": v.spread.least, "ratio_max": v.spread.most}
            for name, v in widest.items()
            if v
        },
    }


def _laws(laws: Laws) -> dict[str, Any]:
    """Return laws as plain data, by their names."""
    rows = {law.name: asdict(law) | {"carried": dict(law.carried)} for law in laws.laws}
    for row in rows.values():
        del row["name"]
    return {**rows, "bar": laws.bar, "best": laws.best.name if laws.best else None}


def _counts(why: npt.ArrayLike) -> dict[str, int]:
    """Return how often each reason is given, the most frequent first."""
    return dict(Counter(str(text) for text in np.ravel(why) if text != "").most_common())


def _timing(dataset: xr.Dataset) -> str:
    """Say what the times are worth: where they were taken, and whether every case ran afresh and alone."""
    ranks = str(dataset.attrs.get("ranks", 1))  # "1, 2" where groups of ranks differed
    where = f"{counted(int(ranks), 'rank') if ranks.isdigit() else f'{ranks} ranks'}"
    where += f" of {dataset.attrs.get('host', 'an unnamed machine')}"
    skipped = json.loads(str(dataset.attrs.get("reductions", "[]")))
    if any(one["name"] == "axisymmetric" for one in skipped):
        where += ", round scenes on their meridian, with elements of its own"
    return f"{where}, {'every case afresh and alone' if dataset.attrs.get('timing') else 'no timing study'}"
