"""The laws of correction in words: which one to use for other tools on the same tissue, and how sure it is."""

from collections.abc import Callable
from math import inf, isfinite, isnan, nan

from pipeline.quantities import symbol
from pipeline.report.guide_words import cells_of, cost, heads, in_order, percent, table
from pipeline.report.guideline import Guideline
from pipeline.report.laws import LAWS, Law, Laws
from pipeline.report.table import words

_SHORT = {"ratio": "F/r", "compliance": "c", "second order": "c + g m²"}


def carried(guide: Guideline) -> list[str]:
    """Return which setting serves with the best law for other tools, for which tools, and how sure that is."""
    head = "For other tools on the same tissue, constants from some"
    chosen = guide.carried or guide.best_carried
    best = chosen.laws.best if chosen else None
    if chosen is None or best is None:
        why = "; ".join(f"{count} scenes: {reason}" for reason, count in guide.no_law)
        return [f"{head}: nothing can be said: it takes a study of several tools{f' ({why})' if why else ''}"]
    found = "" if guide.carried else "no setting does that either; best reached: "
    others = ", ".join(
        f"{law.formula}: {percent(law.others)}" for law in chosen.laws.laws if law is not best and isfinite(law.others)
    )
    lines = [
        f"{head}: {best.formula}: {found}{words(chosen.labels)}, {constants(best)}; off by at most "
        f"{percent(best.error)} for tools that it was not taken from, {percent(best.others)} without error bars "
        f"({others}), {cost(chosen)}",
        f"  seen for     {'; '.join(guide.tools)} from the axis; of others nothing is claimed",
    ]
    return lines + [f"  not for      {count} scenes: {reason}" for reason, count in guide.no_law]


def constants(law: Law) -> str:
    """Write the range of a law's first constant over the tissues."""
    name, unit = ("r", "") if law.name == "ratio" else ("c", " 1/m")
    if f"{law.least:.3g}" == f"{law.most:.3g}":
        return f"{name} = {law.most:.3g}{unit}"
    return f"{name} = {law.least:.3g} … {law.most:.3g}{unit} by tissue"


def comparison(guide: Guideline) -> list[str]:
    """Return the table of how far each law is off where a value of a parameter was left out of its fit."""
    judged = [v for v in in_order(guide) if v.is_judged and v.laws.laws]
    names = [name for name, length in guide.axes if length > 1]
    what = "F_max" if any(v.laws_of_full.laws for v in judged) else "F_exact"
    off = [_off(v.laws_of_full if what == "F_max" else v.laws) for v in judged]
    known = [(law, name) for law in LAWS for name in names if any(not isnan(each(law, name)) for each in off)]
    if not known:
        return []
    rows = [[*heads(guide), *(f"{_SHORT[law]} by {symbol(name)}" for law, name in known), "bars", "best for tools"]]
    for v, each in zip(judged, off, strict=True):
        values = [each(law, name) for law, name in known]
        cells = ["∞" if value == inf else percent(value) for value in values]
        rows.append([*cells_of(v), *cells, percent(v.laws.bar), _SHORT[v.laws.best.name] if v.laws.best else ""])
    return [
        f"How far is {what} off by a law whose constants are from the scenes alike in all but one parameter? Largest,",
        "on values left out of the fit, without error bars (bars: largest of F and F_exact together; best: with them).",
        *table(rows, len(heads(guide))),
        "r: F_exact ≈ F / r; c: 1/F_exact ≈ 1/F - c/(E d); m²: mean square distance of F from the axis.",
    ]


def _off(laws: Laws) -> Callable[[str, str], float]:
    """Return how to look up how far a law is off, by its name and that of the parameter."""
    found = {(law.name, name): value for law in laws.laws for name, value in law.carried}
    return lambda law, name: found.get((law, name), nan)
