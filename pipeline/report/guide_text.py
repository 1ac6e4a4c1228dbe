"""A guide in words, and its settings as a table in the units that people read."""

from math import inf, isfinite
from pathlib import Path

import pandas as pd
from jinja2 import Environment, StrictUndefined

from pipeline.printable import counted
from pipeline.quantities import symbol, write
from pipeline.report.guideline import Guideline
from pipeline.report.laws import Law
from pipeline.report.table import Labels, words
from pipeline.report.verdict import Verdict

_TEMPLATE = Path(__file__).parent / "templates" / "guide.txt.j2"
_NOUGHT = 1e-9  # what rounding leaves of no error


def text(guide: Guideline) -> str:
    """Return the answer, what it costs, the laws of correction and what is left out."""
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    table = of_each_outside(guide)
    shown = table.to_string(index=False).splitlines() if len(table) > 1 else []
    lost = "; ".join([*map(words, guide.lost[:4]), *(["…"] if len(guide.lost) > 4 else [])])
    return template.render(
        guide=guide,
        table=shown,
        lost=f"{counted(len(guide.lost), 'scene')} ({lost})",
    ).rstrip()


def question(guide: Guideline) -> str:
    """Return what was asked for, and of how many scenes."""
    axes = " × ".join(f"{length} {name}" for name, length in guide.axes.items())
    wanted = [f"F within {percent(guide.accuracy)} of F_exact, error bars included"] if isfinite(guide.accuracy) else []
    wanted += [f"at most {time(guide.budget)} a case"] if isfinite(guide.budget) else []
    scenes = f"{counted(guide.scenes, 'scene')}{f' ({axes})' if axes and not guide.lost else ''}"
    return f"Asked for: {', '.join(wanted)}, over {scenes}."


def setting(guide: Guideline) -> str:
    """Return the chosen setting, or the best one where none does what was asked for."""
    if guide.answer is not None:
        smallest = "Smallest ε" if "epsilon" in guide.answer.labels else "Fewest unknowns"
        return f"{smallest if isfinite(guide.accuracy) else 'Most accurate'}: {words(guide.answer.labels)}"
    none = f"No setting of this study {_asked(guide)}"
    if guide.best:
        return f"{none}; best reached: {words(guide.best.labels)}"
    judged = [v for v in guide.verdicts if v.is_judged]
    if not judged:
        return f"{none}: none was computed for every scene."
    quickest = min(judged, key=lambda v: v.seconds)
    return f"{none}; the quickest takes {time(quickest.seconds)}: {words(quickest.labels)}"


def _asked(guide: Guideline) -> str:
    parts = [f"is within {percent(guide.accuracy)} in every scene"] if isfinite(guide.accuracy) else []
    return " and ".join([*parts, *([f"takes at most {time(guide.budget)}"] if isfinite(guide.budget) else [])])


def details(guide: Guideline) -> list[tuple[str, str]]:
    """Return how sure the chosen setting is, what limits it, what it costs and its elements: names and words."""
    verdict = guide.answer or guide.best
    if verdict is None:
        return []
    margin = guide.accuracy - verdict.error
    spare = f" (margin {percent(margin)})" if isfinite(margin) and margin >= 0 else ""
    limit = f" at {words(verdict.limit)}" if verdict.limit else ""
    return [
        ("worst error", f"{percent(verdict.error)}{spare}; {percent(verdict.deviation)} without error bars"),
        ("worst case", f"F = {newton(verdict.force)}, F_exact = {newton(verdict.exact)}{limit}"),
        ("cost", f"{cost(verdict)}, on {guide.timing}"),
        *(("times", doubt) for doubt in guide.doubts),
        ("mesh", elements(verdict.mesh)),
    ]


def others(guide: Guideline) -> list[str]:
    """Return the setting with the fewest unknowns, and those with laws of correction."""
    chosen, lean = guide.answer, guide.lean
    lines = []
    if chosen and lean and lean is not chosen and lean.dofs < chosen.dofs:
        lines.append(f"Fewest unknowns: {words(lean.labels)} ({cost(lean)})")
    corrected = guide.corrected or guide.best_corrected
    if corrected is None:
        why = (
            "nothing can be said: it takes more than one scene" if guide.scenes == 1 else "no setting does that either"
        )
        lines.append(f"With F_exact ≈ F / r: {why}")
    else:
        law = corrected.correction
        best = "" if guide.corrected else "no setting does that either; best reached: "
        off = f"off by at most {percent(law.error)} on scenes that r was not fitted to"
        lines.append(f"With F_exact ≈ F / r: {best}{words(corrected.labels)}, r = {law.r:.4g}; {off}")
    return [*lines, _for_other_tools(guide)]


def _for_other_tools(guide: Guideline) -> str:
    """Say which setting serves with the best law for other tools, and how sure that is."""
    chosen = guide.carried or guide.best_carried
    law = chosen.laws.best if chosen else None
    if chosen is None or law is None:
        why = "; ".join(f"{counted(count, 'scene')}: {reason}" for reason, count in guide.no_law.items())
        return f"For other tools: nothing can be said: it takes a study of several tools{f' ({why})' if why else ''}"
    best = "" if guide.carried else "no setting does that either; best reached: "
    found = f"{best}{words(chosen.labels)}, {law.formula}, {constants(law)}"
    off = f"off by at most {percent(law.error)} for tools that it was not fitted to"
    return f"For other tools on the same tissue: {found}; {off}. Fitted to: {'; '.join(guide.tools)}"


def of_each_outside(guide: Guideline) -> pd.DataFrame:
    """Return the answer for each value of outside: the smallest ε as F is, and with F / r."""
    rows = []
    for name, (plain, corrected) in guide.of_each_outside().items() if isfinite(guide.accuracy) else ():
        law = corrected.correction if corrected else None
        rows.append(
            {
                "outside": name,
                "smallest ε": _short(plain),
                "worst error": percent(plain.error) if plain else "",
                "smallest ε with F / r": _short(corrected),
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
            rows.append(row | {"worst error": f"not judged: {v.missing} of {guide.scenes} scenes not computed"})
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
    return f"{name} = {law.least:.3g} … {law.most:.3g}{unit} by tissue"


def elements(mesh: Labels) -> str:
    """Return the sizes and kind of the elements in words."""
    if "accuracy" in mesh:
        return f"chosen by the program for an accuracy of {percent(mesh['accuracy'])}"
    if "fine" not in mesh:
        return words(mesh)
    full = mesh.get("epsilon", inf) == inf
    edge = "a tenth of its half width" if mesh["rim"] is None else write("rim", mesh["rim"])
    parts = [f"{write('fine', mesh['fine'])} {'everywhere' if full else 'within ε'}"]
    parts += [] if full else [f"{write('coarse', mesh['coarse'])} far away"]
    parts += [f"{edge} at the probe's edge", f"growth {mesh['growth']:g}", f"degree {mesh['degree']}"]
    return ", ".join([*parts, f"element {mesh['element']}"])


def cost(verdict: Verdict) -> str:
    """Return unknowns, elements and time, the largest over the scenes."""
    size = f"up to {verdict.dofs:,.0f} unknowns, {verdict.cells:,.0f} elements"
    return f"{size}, {time(verdict.seconds)} (median {time(verdict.usual)})"


def percent(share: float) -> str:
    """Write a share as people read it; nothing for what is not known."""
    if not isfinite(share):
        return ""
    if abs(share) < _NOUGHT:
        return "0 %"
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"


def time(seconds: float) -> str:
    """Write seconds, in ms where they are few."""
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def newton(force: float) -> str:
    """Write a force in mN."""
    return f"{1e3 * force:.4g} mN"


def _short(verdict: Verdict | None) -> str:
    return words({k: v for k, v in verdict.labels.items() if k != "outside"}) if verdict else "none"
