"""What the cases of a study say of its mesh settings, for an accuracy and a budget."""

from dataclasses import asdict, dataclass
from math import inf
from typing import Any

from pipeline.report.laws import Laws
from pipeline.report.table import Labels
from pipeline.report.verdict import Verdict, choose, keeps


@dataclass(frozen=True)
class Guideline:
    """The answer for ``accuracy`` (relative) and ``budget`` (s a case); infinite where not asked for.

    ``answer`` is the chosen setting, ``corrected`` the one with F_exact ≈ F / r, ``best`` and ``best_corrected`` the
    most accurate there are within the budget; ``carried`` and ``best_carried`` are those with the best law for other
    tools on the same tissue; None if there is none. ``lean`` has the fewest unknowns of those
    that keep the accuracy. ``left_out`` counts the scenes lost to every setting, by reason, and ``unjudged`` the cases
    that keep settings from being judged. ``tools`` describes those that laws were fitted to; ``no_law`` counts the
    scenes in which no law adds compliances, by reason; ``doubts`` say what makes times worth less.
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
    tools: tuple[str, ...] = ()
    no_law: tuple[tuple[str, int], ...] = ()
    doubts: tuple[str, ...] = ()

    def rows(self) -> list[dict[str, Any]]:
        """Return the table behind the answer, a row for each setting, in SI units; full order is ε = infinity."""
        return [_row(verdict, self) for verdict in self.verdicts]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, in SI units: dictionaries, lists, texts and numbers."""
        chosen = ("answer", "corrected", "best", "best_corrected", "carried", "best_carried", "lean")
        rows = dict(zip(map(id, self.verdicts), self.rows(), strict=True))
        return {
            "title": self.title, "accuracy": self.accuracy, "budget": self.budget, "scenes": self.scenes,
            "axes": dict(self.axes), **{name: rows.get(id(getattr(self, name))) for name in chosen},
            "outside": {
                name: {"answer": rows.get(id(plain)), "corrected": rows.get(id(law))}
                for name, (plain, law) in self.of_each_outside().items()
            },
            "settings": list(rows.values()), "left_out": dict(self.left_out), "lost": list(self.lost),
            "unjudged": dict(self.unjudged), "timing": self.timing, "doubts": list(self.doubts),
            "tools": list(self.tools), "no_law": dict(self.no_law),
        }  # fmt: skip

    def of_each_outside(self) -> dict[str, tuple[Verdict | None, Verdict | None]]:
        """Return, for each swept value of outside, the answer as F stands and the corrected one."""
        names = dict.fromkeys(v.labels["outside"] for v in self.verdicts if "outside" in v.labels)
        groups = {
            name: tuple(v for v in self.verdicts if v.labels["outside"] == name or v.labels.get("epsilon") == inf)
            for name in names
        }
        return {
            name: (choose(group, self.accuracy, self.budget), choose(group, self.accuracy, self.budget, "ratio"))
            for name, group in groups.items()
        }


# Parts of a verdict that are no number or text.
_APART = ("labels", "mesh", "spread", "correction", "laws", "laws_of_full")


def _row(verdict: Verdict, guideline: Guideline) -> dict[str, Any]:
    plain = {k: v for k, v in vars(verdict).items() if k not in _APART}
    spread = verdict.spread
    kept = keeps(verdict, guideline.verdicts, guideline.accuracy, "force") and verdict.seconds <= guideline.budget
    return {
        **verdict.labels, "mesh": verdict.mesh, **plain, "judged": verdict.is_judged, "keeps": bool(kept),
        "ratio_min": spread.least, "ratio_max": spread.most, "ratio_spread": spread.width,
        "ratio_spread_relative": spread.relative, "ratio_spread_over": dict(spread.over),
        "correction": asdict(verdict.correction), "laws": _laws(verdict.laws),
        "laws_of_full": _laws(verdict.laws_of_full),
    }  # fmt: skip


def _laws(laws: Laws) -> dict[str, Any]:
    best = laws.best
    rows = {
        law.name: {**{k: v for k, v in asdict(law).items() if k != "name"}, "carried": dict(law.carried)}
        for law in laws.laws
    }
    return {**rows, "bar": laws.bar, "best": best.name if best else None}
