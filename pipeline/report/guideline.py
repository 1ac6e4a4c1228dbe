"""What the cases of a study say of its mesh settings, for an accuracy and a budget."""

from dataclasses import asdict, dataclass
from math import inf
from typing import Any

from pipeline.report.laws import Laws
from pipeline.report.table import Labels
from pipeline.report.verdict import Verdict, choose, keeps

# Settings that are chosen from the verdicts.
_CHOSEN = ("answer", "corrected", "best", "best_corrected", "carried", "best_carried", "lean")
# Parts of a verdict that are no number or text.
_APART = ("labels", "mesh", "spread", "correction", "laws", "laws_of_full")


@dataclass(frozen=True)
class Guideline:
    """The answer for ``accuracy`` (relative) and ``budget`` (s a case); infinite where not asked for.

    ``answer`` is the chosen setting, ``corrected`` the one with F_exact ≈ F / r, ``carried`` the one with the best law
    for other tools on the same tissue; ``best``, ``best_corrected`` and ``best_carried`` are the most accurate within
    the budget; None if there is none. ``lean`` has the fewest unknowns of those that keep the accuracy. ``left_out``
    counts the cases of the scenes ``lost`` to every setting, by reason, ``unjudged`` those that keep settings from
    being judged, ``no_law`` the scenes in which no law adds compliances. ``tools`` are those that laws were fitted to.
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
    carried: Verdict | None
    best_carried: Verdict | None
    lean: Verdict | None
    left_out: tuple[tuple[str, int], ...]
    unjudged: tuple[tuple[str, int], ...]
    lost: tuple[Labels, ...]
    has_full: bool
    timing: str
    tools: tuple[str, ...]
    no_law: tuple[tuple[str, int], ...]
    doubts: tuple[str, ...]

    def rows(self) -> list[dict[str, Any]]:
        """Return the table behind the answer, a row for each setting, in SI units; full order is ε = infinity."""
        return [_row(verdict, self) for verdict in self.verdicts]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, in SI units: dictionaries, lists, texts and numbers."""
        rows = dict(zip(map(id, self.verdicts), self.rows(), strict=True))
        plain = {k: v for k, v in vars(self).items() if k not in (*_CHOSEN, "verdicts", "has_full")}
        return plain | {
            **{name: rows.get(id(getattr(self, name))) for name in _CHOSEN},
            "axes": dict(self.axes),
            "settings": list(rows.values()),
            "outside": {
                name: {"answer": rows.get(id(plain)), "corrected": rows.get(id(law))}
                for name, (plain, law) in self.of_each_outside().items()
            },
            **{name: dict(getattr(self, name)) for name in ("left_out", "unjudged", "no_law")},
            **{name: list(getattr(self, name)) for name in ("lost", "doubts", "tools")},
        }

    def of_each_outside(self) -> dict[str, tuple[Verdict | None, Verdict | None]]:
        """Return, for each swept value of outside, the answer as F is and the corrected one."""
        found = {}
        for name in dict.fromkeys(v.labels["outside"] for v in self.verdicts if "outside" in v.labels):
            group = tuple(v for v in self.verdicts if v.labels["outside"] == name or v.labels.get("epsilon") == inf)
            asked = group, self.accuracy, self.budget
            found[name] = choose(*asked), choose(*asked, "ratio")
        return found


def _row(verdict: Verdict, guideline: Guideline) -> dict[str, Any]:
    """Return a verdict as plain data."""
    plain = {k: v for k, v in vars(verdict).items() if k not in _APART}
    spread = verdict.spread
    kept = keeps(verdict, guideline.verdicts, guideline.accuracy, "force") and verdict.seconds <= guideline.budget
    return verdict.labels | {
        "mesh": verdict.mesh,
        **plain,
        "judged": verdict.is_judged,
        "keeps": bool(kept),
        "ratio_min": spread.least,
        "ratio_max": spread.most,
        "ratio_spread": spread.width,
        "ratio_spread_relative": spread.relative,
        "ratio_spread_over": dict(spread.over),
        "correction": asdict(verdict.correction),
        "laws": _laws(verdict.laws),
        "laws_of_full": _laws(verdict.laws_of_full),
    }


def _laws(laws: Laws) -> dict[str, Any]:
    rows = {law.name: {k: v for k, v in asdict(law).items() if k != "name"} for law in laws.laws}
    carried = {law.name: {"carried": dict(law.carried)} for law in laws.laws}
    named = {name: row | carried[name] for name, row in rows.items()}
    return {**named, "bar": laws.bar, "best": laws.best.name if laws.best else None}
