"""A guide in words, for people: mm, kPa, mN, ms."""

from math import isfinite

from pipeline.quantities import symbol
from pipeline.report.correction import Correction
from pipeline.report.guide_laws import carried, comparison
from pipeline.report.guide_settings import (
    ERROR,
    LEFT_OUT,
    RATIO,
    RESIDUAL,
    TIME,
    UNKNOWNS,
    UNSEEN,
    USUAL,
    range_of,
    settings,
)  # fmt: skip
from pipeline.report.guide_words import (
    cells_of,
    cost,
    elements,
    heads,
    in_order,
    newton,
    number,
    percent,
    ratio,
    table,
    time,
)  # fmt: skip
from pipeline.report.guideline import Guideline
from pipeline.report.table import words
from pipeline.report.verdict import Verdict


def text(guide: Guideline) -> str:
    """Return the answer, the settings, the law of correction and what is left out, as lines."""
    parts = [[guide.title], question(guide), answer(guide), _per_outside(guide), _settings(guide)]
    parts += [_constancy(guide), comparison(guide), _left_out(guide)]
    return "\n\n".join("\n".join(part) for part in parts if part and part[0])


def question(guide: Guideline) -> list[str]:
    """Return what was asked for, and of how many scenes."""
    axes = " × ".join(f"{length} {name}" for name, length in guide.axes)
    wanted = [f"F within {percent(guide.accuracy)} of F_exact, error bars included"] if isfinite(guide.accuracy) else []
    wanted += [f"at most {time(guide.budget)} a case"] if isfinite(guide.budget) else []
    scenes = f"{guide.scenes} scene{'s' * (guide.scenes != 1)}{f' ({axes})' if axes and not guide.lost else ''}"
    return [f"Asked for: {', '.join(wanted)}, over {scenes}."]


def answer(guide: Guideline) -> list[str]:
    """Return the chosen setting, what it costs and what limits it, and the one with the law of correction."""
    return [setting(guide), *(f"  {name:<11}  {words}" for name, words in details(guide)), *others(guide)]


def setting(guide: Guideline) -> str:
    """Return the chosen setting, or the best one where none does what was asked for."""
    if guide.answer is None:
        return f"No setting of this study does that{_nearest(guide)}"
    smallest = "Smallest ε" if "epsilon" in guide.answer.labels else "Fewest unknowns"
    what = smallest if isfinite(guide.accuracy) else "Most accurate"
    return f"{what}: {words(guide.answer.labels)}"


def others(guide: Guideline) -> list[str]:
    """Return the setting with the fewest unknowns, and those with laws of correction."""
    lines = []
    chosen, lean = guide.answer, guide.lean
    if chosen and lean and lean is not chosen and lean.dofs < chosen.dofs:
        lines.append(f"Fewest unknowns: {words(lean.labels)} ({cost(lean)})")
    corrected = guide.corrected or guide.best_corrected
    if corrected:
        law = corrected.correction
        found = "" if guide.corrected else "no setting does that either; best reached: "
        lines.append(
            f"With the correction F_exact ≈ F / r: {found}{words(corrected.labels)}, r = {ratio(law.r)}; off by at "
            f"most {percent(law.error)} on scenes that r was not taken from, {cost(corrected)}"
        )
    else:
        few = "nothing can be said: it takes more than one scene"
        lines.append(
            f"With the correction F_exact ≈ F / r: {few if guide.scenes == 1 else 'no setting does that either'}"
        )
    return lines + carried(guide)


def _nearest(guide: Guideline) -> str:
    if guide.best:
        return f"; best reached: {words(guide.best.labels)}"
    if not any(v.is_judged for v in guide.verdicts):
        return ": none was computed for every scene."
    quickest = min((v for v in guide.verdicts if v.is_judged), key=lambda v: v.seconds)
    return f"; the quickest takes {time(quickest.seconds)}: {words(quickest.labels)}"


def details(guide: Guideline) -> list[tuple[str, str]]:
    """Return the elements of the chosen setting, what it costs, how sure it is and what limits it: names and words."""
    verdict = guide.answer or guide.best
    if verdict is None:
        return []
    margin = guide.accuracy - verdict.error
    spare = f" (margin {percent(margin)})" if isfinite(margin) and margin >= 0 else ""
    limit = f" at {words(verdict.limit)}" if verdict.limit else ""
    return [
        ("elements", elements(verdict.mesh)),
        ("cost", f"{cost(verdict)}, on {guide.timing}"),
        *(("times", doubt) for doubt in guide.doubts),
        ("worst error", f"{percent(verdict.error)}{spare}; {percent(verdict.deviation)} without error bars"),
        ("limited", f"F = {newton(verdict.force)}, F_exact = {newton(verdict.exact)}{limit}"),
    ]


def _per_outside(guide: Guideline) -> list[str]:
    """Return the answer for each value of outside, where there is more than one and an accuracy to keep."""
    answers = guide.of_each_outside()
    if len(answers) < 2 or not isfinite(guide.accuracy):
        return []
    rows = [["outside", "smallest ε", "worst error", "smallest ε with F / r", "r", "worst error"]]
    for name, (plain, corrected) in answers.items():
        row = [name, _short(plain), percent(plain.error) if plain else ""]
        law = corrected.correction if corrected else Correction()
        rows.append([*row, _short(corrected), *((ratio(law.r), percent(law.error)) if corrected else ("", ""))])
    return table(rows)


def _settings(guide: Guideline) -> list[str]:
    """Return the table of all settings: error, cost, and the law of correction."""
    columns = [*heads(guide), ERROR, USUAL, TIME, UNKNOWNS, RATIO, RESIDUAL, LEFT_OUT, UNSEEN]
    # What is not judged ends with its reason.
    rows = [columns, *([row[name] for name in columns if name in row] for row in settings(guide))]
    legend = [
        "Largest over the scenes (usual: median of the time); error with, the last three without error bars.",
        "r: F_exact ≈ F / r; residual: on the scenes that r is taken from; left out: on each scene, r taken from the",
        "others; unseen: on the scenes with one value of a parameter (one ν, one probe, …), r taken from the rest.",
    ]
    return [*table(rows, len(heads(guide))), *legend]


def _constancy(guide: Guideline) -> list[str]:
    """Return the table that tells how constant F/F_max is over the scenes, and what changes it."""
    names = [name for name, length in guide.axes if length > 1]
    if not names:
        return []
    names_of = heads(guide)
    rows = [[*names_of, "least", "most", "most - least", "relative", *(f"by {symbol(name)}" for name in names)]]
    for v in in_order(guide):
        if v.is_judged and isfinite(v.spread.most):
            over = dict(v.spread.over)
            row = [number(v.spread.least), number(v.spread.most), number(v.spread.width), percent(v.spread.relative)]
            rows.append([*cells_of(v), *row, *(number(over[name]) for name in names)])
    what = f"How constant is {range_of(guide)} over the scenes?"
    title = f"{what} By a parameter: the largest change it makes, all else held."
    return [title, *table(rows, len(names_of))] if len(rows) > 1 else []


def _left_out(guide: Guideline) -> list[str]:
    lines = []
    if guide.lost:
        few = "; ".join(words(scene) for scene in guide.lost[:4]) + ("; …" if len(guide.lost) > 4 else "")
        lines.append(f"Left out, and nothing is claimed of them: {len(guide.lost)} scenes ({few}). Their cases:")
        lines += [f"  {count} {reason}" for reason, count in guide.left_out]
    if guide.unjudged:
        lines.append("Cases that keep settings from being judged:")
        lines += [f"  {count} {reason}" for reason, count in guide.unjudged]
    return lines


def _short(verdict: Verdict | None) -> str:
    if verdict is None:
        return "none"
    labels = {k: v for k, v in verdict.labels.items() if k != "outside"}
    return words(labels)
