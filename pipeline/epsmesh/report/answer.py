"""The guideline: which mesh settings keep F near F_exact over all scenes of a study, and at what cost.

The error of a setting is the worst over the scenes of |F/F_exact - 1|, to which the error bars of F and of F_exact are
added. A setting that lacks a case is not judged; scenes that no setting can be judged on are left out, and named. A
dataset without F_exact, such as one at large displacements, is judged by F_max, without error bars: F and F_max have
the same elements at the tool.
"""

import json
from collections import Counter
from collections.abc import Iterable
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.pages import render_text
from epsmesh.printable import counted
from epsmesh.quantities import symbol, write
from epsmesh.report import guide_tables
from epsmesh.report.by_scene import parts
from epsmesh.report.study import Labels
from epsmesh.report.times import doubts
from epsmesh.report.uncertainty import unknowns
from epsmesh.report.verdicts import EXACT, Cells, Verdict, by_outside, choose, is_full, keeps, most_accurate
from epsmesh.report.words import barred, choices, percent, time

_TEMPLATE = Path(__file__).parent / "templates" / "guide.txt.j2"
_MOST_NAMED = 4
# What a guide has as plain data, besides settings: those that are chosen, and the rest.
_CHOSEN = ("answer", "corrected", "best", "best_corrected", "carried", "best_carried", "lean")
_PLAIN = (
    "title", "accuracy", "budget", "reference", "timing", "doubts", "tissue", "axes", "scenes", "uncovered", "left_out",
    "unjudged", "no_law", "tools",
)  # fmt: skip


class Guide:
    """The answer for ``accuracy`` (relative) and ``budget`` (s a case), infinite where not asked for.

    ``answer`` is the chosen setting, ``corrected`` the one with F_exact ≈ F / r, ``carried`` the one with the best law
    for other tools on the same tissue; ``best``, ``best_corrected`` and ``best_carried`` are the most accurate within
    the budget; None if there is none. ``lean`` has the fewest unknowns of those that keep the accuracy. ``left_out``
    counts the cases of the scenes ``uncovered`` by every setting, by reason, ``unjudged`` those that keep settings from
    being judged, ``no_law`` the scenes in which no law adds compliances. ``tools`` are those that laws were fitted to.
    ``reference`` names what F is compared with; ``parts`` are the answers by depth and law. ``tissue`` says what is not
    known of the material, if it was identified. A guide prints as its :meth:`text`.
    """

    def __init__(self, dataset: xr.Dataset, cells: Cells, accuracy: float, budget: float):
        covered, known = cells.covered, {*cells.covered.index}
        self.title, self.coordinates = str(dataset.attrs.get("title", "")), dataset.coords
        self.accuracy, self.budget, self.reference = accuracy, budget, cells.reference
        self.timing, self.doubts, self.tissue = _timing(dataset), doubts(dataset), unknowns(dataset)
        self.axes = {name: len(np.unique(codes)) for name, codes in cells.codes.items()}
        self.scenes, self.has_full = len(known), cells.has_full
        self.uncovered = [scene for number, scene in enumerate(cells.scenes) if number not in known]
        self.left_out = _counts(cells.frame["why"][~cells.frame.index.isin(covered.index)])
        self.unjudged, self.no_law = _counts(covered["why"]), _counts(cells.sinking["why_not"])
        self.tools = list(cells.described)
        self.verdicts = verdicts = cells.verdicts()
        self.answer, self.best = choose(verdicts, accuracy, budget), most_accurate(verdicts, budget)
        self.corrected = choose(verdicts, accuracy, budget, "ratio")
        self.best_corrected = most_accurate(verdicts, budget, "ratio")
        self.carried = choose(verdicts, accuracy, budget, "tools")
        self.best_carried = most_accurate(verdicts, budget, "tools")
        self.parts = parts(cells, accuracy, budget)
        keeping = [verdict for verdict in verdicts if self.keeps(verdict)]
        self.lean = min(keeping, key=lambda v: v.dofs, default=None) if isfinite(accuracy) else None

    def keeps(self, verdict: Verdict) -> bool:
        """Tell whether a setting keeps the accuracy within the budget."""
        return keeps(verdict, self.verdicts, self.accuracy, "force") and verdict.seconds <= self.budget

    def of_each_outside(self) -> dict[str, tuple[Verdict | None, Verdict | None]]:
        """Return, for each swept value of outside, the answer as F is and the corrected one."""
        asked = self.accuracy, self.budget
        groups = by_outside(self.verdicts)
        return {name: (choose(group, *asked), choose(group, *asked, "ratio")) for name, group in groups.items()}

    def rows(self) -> list[dict[str, Any]]:
        """Return the table behind the answer, a row for each setting, in SI units; full order is ε = infinity."""
        return [guide_tables.row(verdict, is_kept=self.keeps(verdict)) for verdict in self.verdicts]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data, in SI units: dictionaries, lists, texts and numbers."""
        rows = dict(zip(map(id, self.verdicts), self.rows(), strict=True))
        return {
            **{name: getattr(self, name) for name in _PLAIN},
            **{name: rows.get(id(getattr(self, name))) for name in _CHOSEN},
            "settings": list(rows.values()),
            "outside": {
                name: {"answer": rows.get(id(plain)), "corrected": rows.get(id(law))}
                for name, (plain, law) in self.of_each_outside().items()
            },
            "by_scene": [part.as_data() for part in self.parts],
        }

    def text(self, *, verbose: bool = False) -> str:
        """Return title, answer, worst case, cost, mesh, ε by depth and law; ``verbose`` adds corrections and others."""
        return render_text(_TEMPLATE, guide=self, tables=guide_tables, verbose=verbose)

    __str__ = __repr__ = text

    @property
    def sentence(self) -> str:
        """The answer in one sentence; where no setting suffices, the best one and why it does not."""
        chosen = self.answer
        if chosen is None:
            return self._no_answer()
        is_for_accuracy = isfinite(self.accuracy)
        if is_for_accuracy and self._is_itself(chosen):
            return self._only_full()
        smallest = "the smallest ε" if "epsilon" in chosen.labels else "the cheapest setting"
        best = f"the most accurate setting within {time(self.budget)} a case"
        what = f"{smallest} that suffices" if is_for_accuracy else best
        allowed = " and ".join([percent(self.accuracy), *([time(self.budget)] if isfinite(self.budget) else [])])
        judged = "puncture and cutting are" if self.is_of_paths else "F is"
        return (
            f"{self._named(chosen)} is {what}: {judged} within {percent(chosen.error)} of {self.compared}"
            f"{_all(self.scenes)}, {self._bars}{f' ({allowed} allowed)' if is_for_accuracy else ''}."
            f"{self._untried(chosen) if is_for_accuracy else ''}"
        )

    @property
    def details(self) -> list[tuple[str, str]]:
        """The worst case of the chosen setting, its cost and its elements: names and words."""
        verdict = self.answer or self.best
        verdict = self._best_cut if verdict and self._is_itself(verdict) else verdict
        if verdict is None:
            return []
        where = f", at {choices(self.coordinates, verdict.limit)}" if verdict.limit else ""
        own = verdict.exact / verdict.force  # from a share of F_exact to one of F
        known = self.reference == EXACT
        bars = (own * bar if known else nan for bar in (verdict.force_bar, verdict.exact_bar))
        unit = "mm" if "depth" in str((verdict.limit or {}).get("quantity", "")) else "mN"
        values = (1e3 * value for value in (verdict.force, verdict.exact))
        force, exact = (barred(value, abs(value) * bar, unit) for value, bar in zip(values, bars, strict=True))
        is_of_paths = self.is_of_paths
        found = f"{force}, {self.compared} {exact}" if is_of_paths else f"F = {force}, {self.reference} = {exact}"
        return [
            ("Worst case", f"{found}{where}"),
            ("Cost", f"{guide_tables.cost(verdict)}, on {self.timing}{' (times are doubtful)' if self.doubts else ''}"),
            ("Mesh", self._elements(verdict.mesh)),
        ]

    @property
    def scope(self) -> str:
        """How many scenes the answer is for, and what differs between them."""
        axes = " × ".join(f"{length} {symbol(name)}" for name, length in self.axes.items() if length > 1)
        return f"{counted(self.scenes, 'scene')}{f' ({axes})' if axes and not self.uncovered else ''}"

    @property
    def gaps(self) -> list[str]:
        """Which scenes the answer does not cover, and how many settings lack a force, a sentence each."""
        found = []
        if self.uncovered:
            names = [choices(self.coordinates, scene) for scene in self.uncovered[:_MOST_NAMED]]
            names += ["…"] if len(self.uncovered) > _MOST_NAMED else []
            found.append(f"Not covered: {counted(len(self.uncovered), 'scene')} without results ({'; '.join(names)}).")
        if self.unjudged:
            count = sum(not v.is_judged for v in self.verdicts)
            found.append(f"Incomplete: {counted(count, 'mesh setting')} without a result for every scene.")
        return found

    @property
    def others(self) -> list[str]:
        """The setting with the fewest unknowns, and those that suffice once F is corrected."""
        chosen, lean, lines = self.answer, self.lean, []
        if chosen and lean and lean is not chosen and lean.dofs < chosen.dofs:
            lines.append(f"Fewest unknowns: {self._named(lean)} ({guide_tables.cost(lean)}).")
        corrected, none = self.corrected or self.best_corrected, "no setting suffices with it"
        if corrected is None:
            why = "needs more than one scene" if self.scenes == 1 else f"does not help: {none}"
            lines.append(f"Correction {self.reference} ≈ F / r: {why}.")
        else:
            law, best = corrected.correction, "" if self.corrected else f"{none}; best: "
            off = f"within {percent(law.error)} in scenes that r was not fitted to"
            found = f"{best}{self._named(corrected)}, r = {law.r:.4g}"
            lines.append(f"Correction {self.reference} ≈ F / r: {found}, {off}.")
        carried = self.carried or self.best_carried
        if carried is None or (of_tools := carried.laws.best) is None:
            why = "; ".join(f"{counted(count, 'scene')}: {reason}" for reason, count in self.no_law.items())
            return [*lines, f"Correction for other tools: needs a study of several tools{f' ({why})' if why else ''}."]
        best = "" if self.carried else f"{none}; best: "
        found = f"{best}{self._named(carried)}, {of_tools.formula}, {of_tools.constants}"
        off = f"within {percent(of_tools.error)} for tools that it was not fitted to"
        fitted = f"Fitted to: {'; '.join(self.tools)}."
        return [*lines, f"Correction for other tools on the same tissue: {found}, {off}. {fitted}"]

    @property
    def is_of_paths(self) -> bool:
        """Whether paths of insertions are judged: by force and depth of the puncture, and by the last force."""
        return "quantity" in self.axes

    @property
    def asked(self) -> str:
        """What is to be within which accuracy of what."""
        what = "puncture and cutting" if self.is_of_paths else "F"
        return f"{what} within {percent(self.accuracy)} of {self.compared}"

    @property
    def compared(self) -> str:
        """What F, or what a path is judged by, is compared with."""
        return "the full order" if self.is_of_paths else self.reference

    @property
    def _bars(self) -> str:
        """What is done with error bars: F and F_max have the same elements at the tool, with the same error."""
        return "error bars included" if self.reference == EXACT else "without the elements' error, which F_max shares"

    def _untried(self, chosen: Verdict) -> str:
        """Say that the answer is the smallest ε of the study: a smaller one may suffice as well."""
        tried = {v.labels["epsilon"] for v in self.verdicts if "epsilon" in v.labels}
        return " No smaller ε was tried." if len(tried) > 1 and chosen.labels["epsilon"] == min(tried) else ""

    def _is_itself(self, verdict: Verdict) -> bool:
        """Tell whether a setting is the one that F is compared with."""
        return is_full(verdict) and self.reference != EXACT

    @property
    def _best_cut(self) -> Verdict | None:
        """The most accurate setting with an ε."""
        return most_accurate((v for v in self.verdicts if not is_full(v)), self.budget)

    def _only_full(self) -> str:
        """Say that no ε suffices beside the full order, and which is the best."""
        none, best = f"No ε keeps {self.asked}{_all(self.scenes)}, {self._bars}.", self._best_cut
        return f"{none} Best: {self._named(best)}, within {percent(best.error)}." if best else none

    def _no_answer(self) -> str:
        limits, best = list[str](), self.best
        if isfinite(self.accuracy):
            limits.append(f"keeps {self.asked}{_all(self.scenes)}")
        if isfinite(self.budget):
            limits.append(f"takes at most {time(self.budget)} a case")
        none = f"No mesh setting {' and '.join(limits)}"
        if best is None:
            quickest = min((v for v in self.verdicts if v.is_judged), key=lambda v: v.seconds, default=None)
            if quickest is None:
                return f"{none}: none has a force for every scene."
            return f"{none}. The quickest, {self._named(quickest)}, takes {time(quickest.seconds)}."
        if best.error <= self.accuracy:
            return f"{none}. {self._named(best)} is within {percent(best.error)}, but by chance: a larger ε is not."
        found = f"{none}. Best: {self._named(best)}, within {percent(best.error)}"
        if self.reference != EXACT:
            return f"{found}, {self._bars}."
        total = " + ".join(
            f"{percent(part)} {name}"
            for name, part in (
                ("distance of F from F_exact", best.distance),
                ("error bar of F", best.force_bar),
                ("error bar of F_exact", best.exact_bar),
            )
        )
        alone = f" The error bar of F alone is within {percent(self.accuracy)}."
        return f"{found} ({total}).{alone if best.force_bar <= self.accuracy else ''}"

    def _elements(self, mesh: Labels) -> str:
        """Return the sizes and kind of the elements in words."""
        if "accuracy" in mesh:
            return f"chosen by the program for an accuracy of {percent(mesh['accuracy'])}"
        if "fine" not in mesh:
            return choices(self.coordinates, mesh)
        full = mesh.get("epsilon", inf) == inf
        edge = "a tenth of its half width" if mesh["rim"] is None else write("rim", mesh["rim"])
        parts = [f"elements of {write('fine', mesh['fine'])} {'everywhere' if full else 'within ε'}"]
        parts += [] if full else [f"{write('coarse', mesh['coarse'])} far away"]
        parts += [f"{edge} at the probe's edge", f"growth {mesh['growth']:g}", f"degree {mesh['degree']}"]
        return ", ".join([*parts, f"element {mesh['element']}"])

    def _named(self, verdict: Verdict) -> str:
        """Name a setting, ε first."""
        labels = {name: verdict.labels[name] for name in sorted(verdict.labels, key="epsilon".__ne__)}
        return choices(self.coordinates, labels) or "the one setting"


def _counts(why: Iterable[str]) -> dict[str, int]:
    """Return how often each reason is given, the most frequent first."""
    return dict(Counter(text for text in why if text).most_common())


def _timing(dataset: xr.Dataset) -> str:
    """Say what the times are worth: where they were taken, and whether every case ran afresh and alone."""
    ranks = str(dataset.attrs.get("ranks", 1))  # "1, 2" where groups of ranks differed
    where = f"{counted(int(ranks), 'rank') if ranks.isdigit() else f'{ranks} ranks'}"
    where += f" of {dataset.attrs.get('host', 'an unnamed machine')}"
    skipped = json.loads(str(dataset.attrs.get("reductions", "[]")))
    if any(one["name"] == "axisymmetric" for one in skipped):
        where += ", round scenes on their meridian, with elements of its own"
    return f"{where}, {'every case afresh and alone' if dataset.attrs.get('timing') else 'no timing study'}"


def _all(count: int) -> str:
    return {1: "", 2: " in both scenes"}.get(count, f" in all {count} scenes")
