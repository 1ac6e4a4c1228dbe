"""The guideline: which mesh settings keep F near F_exact over all scenes of a study, and at what cost.

The error of a setting is the worst over the scenes of |F/F_exact - 1|, to which the error bars of F and of F_exact are
added. A setting that lacks a case is not judged; scenes that no setting can be judged on are left out, and named. A
dataset without F_exact, such as one at large displacements, is judged by F_max, without error bars: F and F_max have
the same elements at the tool.
"""

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from epsmesh.pages import render_text
from epsmesh.printable import counted
from epsmesh.quantities import symbol, write
from epsmesh.report.by_scene import OfOutside, Part, parts
from epsmesh.report.headline import headline
from epsmesh.report.laws import Law, Laws
from epsmesh.report.study import DatasetError, Labels
from epsmesh.report.times import doubts
from epsmesh.report.uncertainty import unknowns
from epsmesh.report.verdicts import EXACT, Cells, Verdict, arrange, by_outside, choose, is_full, keeps, most_accurate
from epsmesh.report.words import barred, choices, percent
from epsmesh.units import parse_quantity

# The accuracy that the report asks for, and who gives neither accuracy nor budget.
USUAL_ACCURACY = "5 %"
_TEMPLATE = Path(__file__).parent / "templates" / "guide.txt.j2"
_MOST_NAMED = 4
# What a guide has as plain data, besides settings: those that are chosen, and the rest.
_CHOSEN = ("answer", "corrected", "best", "best_corrected", "carried", "best_carried", "lean")
_PLAIN = (
    "title", "accuracy", "budget", "reference", "timing", "doubts", "tissue", "axes", "scenes", "uncovered", "left_out",
    "unjudged", "no_law", "tools",
)  # fmt: skip
_OF_VERDICT = (
    "missing", "deviation", "error", "limit", "force", "exact", "distance", "force_bar", "exact_bar", "seconds",
    "usual", "dofs", "cells",
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
        return [_row(verdict, is_kept=self.keeps(verdict)) for verdict in self.verdicts]

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
        return render_text(_TEMPLATE, guide=self, verbose=verbose)

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
        judged = "puncture and cutting are" if self._is_of_paths else "F is"
        return (
            f"{self._named(chosen)} is {what}: {judged} within {percent(chosen.error)} of {self._compared}"
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
        is_of_paths = self._is_of_paths
        found = f"{force}, {self._compared} {exact}" if is_of_paths else f"F = {force}, {self.reference} = {exact}"
        return [
            ("Worst case", f"{found}{where}"),
            ("Cost", f"{cost(verdict)}, on {self.timing}{' (times are doubtful)' if self.doubts else ''}"),
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
            lines.append(f"Fewest unknowns: {self._named(lean)} ({cost(lean)}).")
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
        found = f"{best}{self._named(carried)}, {of_tools.formula}, {constants(of_tools)}"
        off = f"within {percent(of_tools.error)} for tools that it was not fitted to"
        fitted = f"Fitted to: {'; '.join(self.tools)}."
        return [*lines, f"Correction for other tools on the same tissue: {found}, {off}. {fitted}"]

    @property
    def by_scene(self) -> list[str]:
        """The smallest ε at each depth and for each law, a line each; nothing if it is the same at all."""
        if len(self.parts) < 2:
            return []
        rows = [
            {symbol(name): self._range(name, part) for name in part.where}
            | {"ε" if one.outside == "epsilon" else one.outside: self._smallest(one) for one in part.answers}
            for part in self.parts
        ]
        what = "what is judged" if self._is_of_paths else "F"
        first = f"Smallest ε for {what} within {percent(self.accuracy)} of {self._compared}:"
        return [first, *pd.DataFrame(rows).to_string(index=False).splitlines()]

    @property
    def outsides(self) -> pd.DataFrame:
        """The answer for each value of outside: the smallest ε as F is, and with F / r."""
        rows = []
        for name, (plain, corrected) in self.of_each_outside().items() if isfinite(self.accuracy) else ():
            law = corrected.correction if corrected else None
            rows.append(
                {
                    "outside": name,
                    "smallest ε": self._short(plain),
                    "worst error": percent(plain.error) if plain else "",
                    "smallest ε with F / r": self._short(corrected),
                    "r": f"{law.r:.4g}" if law else "",
                    "worst error with F / r": percent(law.error) if law else "",
                }
            )
        return pd.DataFrame(rows)

    @property
    def settings(self) -> pd.DataFrame:
        """A row of words for each setting, ε running fastest: what is swept, error, cost, F/F_max, and r."""
        share = "F/F_max" if self.has_full else "F/F_exact"
        rows = []
        for v in sorted(self.verdicts, key=_place):
            row = {symbol(name): write(name, v.labels[name]) for name in sorted(v.labels, key="epsilon".__eq__)}
            if v.labels.get("epsilon") == inf and "outside" in v.labels:
                row[symbol("outside")] = "any"
            if not v.is_judged:
                rows.append(row | {"worst error": f"incomplete: {v.missing} of {self.scenes} scenes have no result"})
                continue
            law, spread = v.correction, v.spread
            row |= {"worst error": percent(v.error), "unknowns": f"{v.dofs:,.0f}"}
            row |= {"median time": time(v.usual), "longest time": time(v.seconds)}
            row[share] = f"{spread.least:.3f} … {spread.most:.3f}" if isfinite(spread.most) else ""
            rows.append(row | {"r": f"{law.r:.4g}" if isfinite(law.r) else "", "error of F/r": percent(law.error)})
        return pd.DataFrame(rows).fillna("")

    @property
    def _is_of_paths(self) -> bool:
        """Whether paths of insertions are judged: by force and depth of the puncture, and by the last force."""
        return "quantity" in self.axes

    @property
    def _compared(self) -> str:
        return "the full order" if self._is_of_paths else self.reference

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
        what, best = "puncture and cutting" if self._is_of_paths else "F", self._best_cut
        none = (
            f"No ε keeps {what} within {percent(self.accuracy)} of {self._compared}{_all(self.scenes)}, {self._bars}."
        )
        return f"{none} Best: {self._named(best)}, within {percent(best.error)}." if best else none

    def _no_answer(self) -> str:
        limits, best = list[str](), self.best
        if isfinite(self.accuracy):
            what = "puncture and cutting" if self._is_of_paths else "F"
            limits.append(f"keeps {what} within {percent(self.accuracy)} of {self._compared}{_all(self.scenes)}")
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

    def _range(self, name: str, part: Part) -> str:
        """Return the labels of a part: "all" of a parameter, or the first and the last of numbers."""
        labels = part.where[name]
        everything = {label for other in self.parts for label in other.where[name]}
        if len(labels) > 1 and len(labels) == len(everything):
            return "all"
        words = [write(name, label) for label in labels]
        return f"{words[0]} to {words[-1]}" if len(words) > 1 and name == "depth" else ", ".join(words)

    def _smallest(self, one: OfOutside) -> str:
        """Return the smallest ε; where none suffices, F over F_max with the largest one."""
        if isfinite(one.epsilon):
            return write("epsilon", one.epsilon)
        if one.widest is None:
            return "full order" if one.answer else "none"
        spread, epsilon = one.widest.spread, write("epsilon", one.widest.mesh["epsilon"])
        share = "F_max" if self.has_full else self.reference
        return f"none: {spread.least:.2f} to {spread.most:.2f} {share} at {epsilon}"

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

    def _short(self, verdict: Verdict | None) -> str:
        if verdict is None:
            return "none"
        if verdict.labels.get("epsilon") == inf:
            return "none: full order only"
        labels = {name: value for name, value in verdict.labels.items() if name != "outside"}
        return choices(self.coordinates, labels) or "the one setting"


def guide_if_any(dataset: xr.Dataset) -> Guide | None:
    """Return the guide for a usual accuracy, or None if the study compares no meshes, or nothing can be judged."""
    try:
        found = guide(dataset, USUAL_ACCURACY)
    except DatasetError:
        return None
    return found if len(found.verdicts) > 1 else None


def guide(dataset: xr.Dataset, accuracy: str | float | None = None, budget: str | float | None = None) -> Guide:
    """Answer from ``dataset``; ``accuracy`` as "5 %" or a share, ``budget`` as "10 ms" or seconds; 5 % without both.

    Raises:
        DatasetError: if nothing can be judged.
        ValueError: if one makes no sense.
    """
    if accuracy is None and budget is None:
        accuracy = USUAL_ACCURACY
    wanted = quantity("accuracy", accuracy, "") if accuracy is not None else inf
    seconds = quantity("budget", budget, "s") if budget is not None else inf
    cells = arrange(dataset)
    if cells.covered.empty:
        reasons = "; ".join(f"{count} {why}" for why, count in Counter(cells.frame["why"]).most_common())
        raise DatasetError(f"no case can be judged: {reasons}")
    if len(cells.settings) == 1 and cells.reference != EXACT:
        raise DatasetError(
            "the study has one mesh setting, and F_max is its own force: it compares no meshes. "
            f"{' '.join(headline(dataset))} To compare, write `exact = true` in [solve] for F_exact, or sweep epsilon "
            'with "full" in place of an accuracy'
        )
    return Guide(dataset, cells, wanted, seconds)


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


def _row(verdict: Verdict, *, is_kept: bool) -> dict[str, Any]:
    """Return a verdict as plain data."""
    spread = verdict.spread
    return verdict.labels | {
        "mesh": verdict.mesh,
        **{name: getattr(verdict, name) for name in _OF_VERDICT},
        "judged": verdict.is_judged,
        "keeps": bool(is_kept),
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
    """Return laws as plain data, by their names."""
    rows = {law.name: asdict(law) | {"carried": dict(law.carried)} for law in laws.laws}
    for row in rows.values():
        del row["name"]
    return {**rows, "bar": laws.bar, "best": laws.best.name if laws.best else None}


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


def _place(verdict: Verdict) -> tuple[bool, str, float]:
    """Return what settings are sorted by: full order last."""
    labels = verdict.labels
    epsilon = labels.get("epsilon", 0.0)
    return epsilon == inf and "outside" in labels, str([v for k, v in labels.items() if k != "epsilon"]), epsilon


def constants(law: Law) -> str:
    """Write the range of a law's first constant over the tissues."""
    name, unit = ("r", "") if law.name == "ratio" else ("c", " 1/m")
    if f"{law.least:.3g}" == f"{law.most:.3g}":
        return f"{name} = {law.most:.3g}{unit}"
    return f"{name} = {law.least:.3g} … {law.most:.3g}{unit}, depending on the tissue"


def cost(verdict: Verdict) -> str:
    """Return unknowns, elements and time, the largest over the scenes."""
    size = f"up to {verdict.dofs:,.0f} unknowns, {verdict.cells:,.0f} elements"
    return f"{size}, {time(verdict.seconds)} a case (median {time(verdict.usual)})"


def time(seconds: float) -> str:
    """Write seconds, in ms where they are few."""
    return f"{seconds:.3g} s" if seconds >= 0.9995 else f"{1e3 * seconds:.3g} ms"


def _all(count: int) -> str:
    return {1: "", 2: " in both scenes"}.get(count, f" in all {count} scenes")
