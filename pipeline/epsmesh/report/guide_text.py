"""A guide in words, and its settings as a table in the units that people read."""

from math import inf, isfinite

import pandas as pd

from epsmesh.printable import counted
from epsmesh.quantities import symbol, write
from epsmesh.report.by_scene import OfOutside, Part
from epsmesh.report.guideline import Guideline
from epsmesh.report.laws import Law
from epsmesh.report.table import EXACT, Labels
from epsmesh.report.verdict import Verdict
from epsmesh.report.words import choices, percent

_MOST_NAMED = 4


def text(guide: Guideline, *, verbose: bool = False) -> str:
    """Return title, answer, worst case, cost, mesh, and ε by depth and law; ``verbose`` adds corrections and others."""
    lines = [guide.title, answer(guide), *(f"{name}: {words}" for name, words in details(guide))]
    lines += ([guide.tissue] if guide.tissue else []) + gaps(guide)[:1] + by_scene(guide)
    if not verbose:
        return "\n".join(lines)
    table = of_each_outside(guide)
    parts = [
        [f"{scenes(guide)}."],
        others(guide),
        table.to_string(index=False).splitlines() if len(table) > 1 else [],
        [f"{doubt[0].upper()}{doubt[1:]}." for doubt in guide.doubts],
        _reasons("scenes that are not covered", guide.left_out),
        _reasons("mesh settings that are incomplete", guide.unjudged),
    ]
    return "\n\n".join("\n".join(part) for part in [lines, *parts] if part)


def answer(guide: Guideline) -> str:
    """Return the answer in one sentence; where no setting suffices, the best one and why it does not."""
    chosen = guide.answer
    if chosen is None:
        return _no_answer(guide)
    if not isfinite(guide.accuracy):
        return (
            f"{_named(guide, chosen)} is the most accurate setting within {time(guide.budget)} a case: "
            f"{_judged(guide)} within {percent(chosen.error)} of {_reference(guide)}{_all(guide.scenes)}, "
            f"{_bars(guide)}."
        )
    smallest = "the smallest ε" if "epsilon" in chosen.labels else "the cheapest setting"
    allowed = " and ".join([percent(guide.accuracy), *([time(guide.budget)] if isfinite(guide.budget) else [])])
    return (
        f"{_named(guide, chosen)} is {smallest} that suffices: {_judged(guide)} within {percent(chosen.error)} of "
        f"{_reference(guide)}{_all(guide.scenes)}, {_bars(guide)} ({allowed} allowed).{_untried(guide, chosen)}"
    )


def _bars(guide: Guideline) -> str:
    """Say what is done with error bars: F and F_max have the same elements at the tool, with the same error."""
    return "error bars included" if guide.reference == EXACT else "without the elements' error, which F_max shares"


def _untried(guide: Guideline, chosen: Verdict) -> str:
    """Say that the answer is the smallest ε of the study: a smaller one may suffice as well."""
    tried = [v.labels["epsilon"] for v in guide.verdicts if "epsilon" in v.labels]
    return " No smaller ε was tried." if len(set(tried)) > 1 and chosen.labels["epsilon"] == min(tried) else ""


def _no_answer(guide: Guideline) -> str:
    what = "puncture and cutting" if _is_of_paths(guide) else "F"
    limits = [f"keeps {what} within {percent(guide.accuracy)} of {_reference(guide)}{_all(guide.scenes)}"]
    limits = limits if isfinite(guide.accuracy) else []
    limits += [f"takes at most {time(guide.budget)} a case"] if isfinite(guide.budget) else []
    none = f"No mesh setting {' and '.join(limits)}"
    if guide.best is None:
        judged = [v for v in guide.verdicts if v.is_judged]
        if not judged:
            return f"{none}: none has a force for every scene."
        quickest = min(judged, key=lambda v: v.seconds)
        return f"{none}. The quickest, {_named(guide, quickest)}, takes {time(quickest.seconds)}."
    best = guide.best
    if best.error <= guide.accuracy:
        return f"{none}. {_named(guide, best)} is within {percent(best.error)}, but by chance: a larger ε is not."
    found = f"{none}. Best: {_named(guide, best)}, within {percent(best.error)}"
    if guide.reference != EXACT:
        return f"{found}, {_bars(guide)}."
    parts = {"distance of F from F_exact": best.distance, "error bar of F": best.force_bar}
    parts |= {"error bar of F_exact": best.exact_bar}
    total = " + ".join(f"{percent(part)} {name}" for name, part in parts.items())
    found = f"{found} ({total})."
    alone = best.force_bar <= guide.accuracy
    return f"{found} The error bar of F alone is within {percent(guide.accuracy)}." if alone else found


def details(guide: Guideline) -> list[tuple[str, str]]:
    """Return the worst case of the chosen setting, its cost and its elements: names and words."""
    verdict = guide.answer or guide.best
    if verdict is None:
        return []
    where = f", at {choices(guide.coordinates, verdict.limit)}" if verdict.limit else ""
    own = verdict.exact / verdict.force  # from a share of F_exact to one of F
    known = guide.reference == EXACT
    bars = (f" ± {percent(own * bar)}" if known else "" for bar in (verdict.force_bar, verdict.exact_bar))
    is_length = "depth" in str((verdict.limit or {}).get("quantity", ""))
    write_one = millimetre if is_length else newton
    force, exact = (f"{write_one(f)}{bar}" for f, bar in zip((verdict.force, verdict.exact), bars, strict=True))
    found = (
        f"{force}, {_reference(guide)} {exact}" if _is_of_paths(guide) else f"F = {force}, {guide.reference} = {exact}"
    )
    return [
        ("Worst case", f"{found}{where}"),
        ("Cost", f"{cost(verdict)}, on {guide.timing}{' (times are doubtful)' if guide.doubts else ''}"),
        ("Mesh", elements(guide, verdict.mesh)),
    ]


def scenes(guide: Guideline) -> str:
    """Return how many scenes the answer is for, and what differs between them."""
    axes = " × ".join(f"{length} {symbol(name)}" for name, length in guide.axes.items() if length > 1)
    return f"{counted(guide.scenes, 'scene')}{f' ({axes})' if axes and not guide.uncovered else ''}"


def gaps(guide: Guideline) -> list[str]:
    """Return which scenes the answer does not cover, and how many settings lack a force, a sentence each."""
    found = []
    if guide.uncovered:
        names = [choices(guide.coordinates, scene) for scene in guide.uncovered[:_MOST_NAMED]]
        names += ["…"] if len(guide.uncovered) > _MOST_NAMED else []
        found.append(f"Not covered: {counted(len(guide.uncovered), 'scene')} without results ({'; '.join(names)}).")
    if guide.unjudged:
        count = sum(not v.is_judged for v in guide.verdicts)
        found.append(f"Incomplete: {counted(count, 'mesh setting')} without a result for every scene.")
    return found


def _reasons(what: str, counts: dict[str, int]) -> list[str]:
    return [f"Cases of {what}:", *(f"  {count} {reason}" for reason, count in counts.items())] if counts else []


def others(guide: Guideline) -> list[str]:
    """Return the setting with the fewest unknowns, and those that suffice once F is corrected."""
    chosen, lean = guide.answer, guide.lean
    lines = []
    if chosen and lean and lean is not chosen and lean.dofs < chosen.dofs:
        lines.append(f"Fewest unknowns: {_named(guide, lean)} ({cost(lean)}).")
    corrected = guide.corrected or guide.best_corrected
    if corrected is None:
        why = "needs more than one scene" if guide.scenes == 1 else "does not help: no setting suffices with it"
        lines.append(f"Correction {guide.reference} ≈ F / r: {why}.")
    else:
        law = corrected.correction
        best = "" if guide.corrected else "no setting suffices with it; best: "
        off = f"within {percent(law.error)} in scenes that r was not fitted to"
        lines.append(f"Correction {guide.reference} ≈ F / r: {best}{_named(guide, corrected)}, r = {law.r:.4g}, {off}.")
    return [*lines, _for_other_tools(guide)]


def _for_other_tools(guide: Guideline) -> str:
    """Say which setting and which correction suit other tools, and how sure that is."""
    chosen = guide.carried or guide.best_carried
    law = chosen.laws.best if chosen else None
    if chosen is None or law is None:
        why = "; ".join(f"{counted(count, 'scene')}: {reason}" for reason, count in guide.no_law.items())
        return f"Correction for other tools: needs a study of several tools{f' ({why})' if why else ''}."
    best = "" if guide.carried else "no setting suffices with it; best: "
    found = f"{best}{_named(guide, chosen)}, {law.formula}, {constants(law)}"
    off = f"within {percent(law.error)} for tools that it was not fitted to"
    return f"Correction for other tools on the same tissue: {found}, {off}. Fitted to: {'; '.join(guide.tools)}."


def by_scene(guide: Guideline) -> list[str]:
    """Return the smallest ε at each depth and for each law, a line each; nothing if it is the same at all."""
    if len(guide.parts) < 2:
        return []
    rows = [_by_scene_row(guide, part) for part in guide.parts]
    table = pd.DataFrame(rows).to_string(index=False).splitlines()
    what = "what is judged" if _is_of_paths(guide) else "F"
    return [f"Smallest ε for {what} within {percent(guide.accuracy)} of {_reference(guide)}:", *table]


def _by_scene_row(guide: Guideline, part: Part) -> dict[str, str]:
    where = {symbol(name): _range(guide, name, part) for name in part.where}
    return where | {one.outside or "ε": _smallest(guide, one) for one in part.answers}


def _range(guide: Guideline, name: str, part: Part) -> str:
    """Return the labels of a part: "all" of a parameter, or the first and the last of numbers."""
    labels = part.where[name]
    everything = {label for other in guide.parts for label in other.where[name]}
    if len(labels) > 1 and len(labels) == len(everything):
        return "all"
    words = [write(name, label) for label in labels]
    return f"{words[0]} to {words[-1]}" if len(words) > 1 and name == "depth" else ", ".join(words)


def _smallest(guide: Guideline, one: OfOutside) -> str:
    """Return the smallest ε; where none suffices, F over F_max with the largest one."""
    if isfinite(one.epsilon):
        return write("epsilon", one.epsilon)
    if one.widest is None:
        return "full order" if one.answer else "none"
    spread, share = one.widest.spread, "F_max" if guide.has_full else guide.reference
    return f"none: {spread.least:.2f} to {spread.most:.2f} {share} at {write('epsilon', one.widest.mesh['epsilon'])}"


def of_each_outside(guide: Guideline) -> pd.DataFrame:
    """Return the answer for each value of outside: the smallest ε as F is, and with F / r."""
    rows = []
    for name, (plain, corrected) in guide.of_each_outside().items() if isfinite(guide.accuracy) else ():
        law = corrected.correction if corrected else None
        rows.append(
            {
                "outside": name,
                "smallest ε": _short(guide, plain),
                "worst error": percent(plain.error) if plain else "",
                "smallest ε with F / r": _short(guide, corrected),
                "r": f"{law.r:.4g}" if law else "",
                "worst error with F / r": percent(law.error) if law else "",
            }
        )
    return pd.DataFrame(rows)


def settings(guide: Guideline) -> pd.DataFrame:
    """Return a row of words for each setting, ε running fastest: what is swept, error, cost, F/F_max, and r."""
    share = "F/F_max" if guide.has_full else "F/F_exact"
    rows = []
    for v in sorted(guide.verdicts, key=_place):
        row = {symbol(name): write(name, v.labels[name]) for name in sorted(v.labels, key="epsilon".__eq__)}
        if v.labels.get("epsilon") == inf and "outside" in v.labels:
            row[symbol("outside")] = "any"
        if not v.is_judged:
            rows.append(row | {"worst error": f"incomplete: {v.missing} of {guide.scenes} scenes have no result"})
            continue
        law, spread = v.correction, v.spread
        row |= {"worst error": percent(v.error), "unknowns": f"{v.dofs:,.0f}"}
        row |= {"median time": time(v.usual), "longest time": time(v.seconds)}
        row[share] = f"{spread.least:.3f} … {spread.most:.3f}" if isfinite(spread.most) else ""
        rows.append(row | {"r": f"{law.r:.4g}" if isfinite(law.r) else "", "error of F/r": percent(law.error)})
    return pd.DataFrame(rows).fillna("")


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


def elements(guide: Guideline, mesh: Labels) -> str:
    """Return the sizes and kind of the elements in words."""
    if "accuracy" in mesh:
        return f"chosen by the program for an accuracy of {percent(mesh['accuracy'])}"
    if "fine" not in mesh:
        return choices(guide.coordinates, mesh)
    full = mesh.get("epsilon", inf) == inf
    edge = "a tenth of its half width" if mesh["rim"] is None else write("rim", mesh["rim"])
    parts = [f"elements of {write('fine', mesh['fine'])} {'everywhere' if full else 'within ε'}"]
    parts += [] if full else [f"{write('coarse', mesh['coarse'])} far away"]
    parts += [f"{edge} at the probe's edge", f"growth {mesh['growth']:g}", f"degree {mesh['degree']}"]
    return ", ".join([*parts, f"element {mesh['element']}"])


def cost(verdict: Verdict) -> str:
    """Return unknowns, elements and time, the largest over the scenes."""
    size = f"up to {verdict.dofs:,.0f} unknowns, {verdict.cells:,.0f} elements"
    return f"{size}, {time(verdict.seconds)} a case (median {time(verdict.usual)})"


def time(seconds: float) -> str:
    """Write seconds, in ms where they are few."""
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def newton(force: float) -> str:
    """Write a force in mN."""
    return f"{1e3 * force:.4g} mN"


def millimetre(length: float) -> str:
    """Write a length in mm."""
    return f"{1e3 * length:.4g} mm"


def _is_of_paths(guide: Guideline) -> bool:
    """Tell whether paths of insertions are judged: by force and depth of the puncture, and by the last force."""
    return "quantity" in guide.axes


def _judged(guide: Guideline) -> str:
    return "puncture and cutting are" if _is_of_paths(guide) else "F is"


def _reference(guide: Guideline) -> str:
    return "the full order" if _is_of_paths(guide) else guide.reference


def _named(guide: Guideline, verdict: Verdict) -> str:
    """Name a setting, ε first."""
    labels = {name: verdict.labels[name] for name in sorted(verdict.labels, key="epsilon".__ne__)}
    return choices(guide.coordinates, labels) or "the one setting"


def _all(count: int) -> str:
    return {1: "", 2: " in both scenes"}.get(count, f" in all {count} scenes")


def _short(guide: Guideline, verdict: Verdict | None) -> str:
    labels = {k: v for k, v in verdict.labels.items() if k != "outside"} if verdict else None
    if labels is None:
        return "none"
    if labels.get("epsilon") == inf:
        return "none: full order only"
    return choices(guide.coordinates, labels) or "the one setting"
