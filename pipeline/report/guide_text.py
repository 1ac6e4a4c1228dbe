"""A guide in words, for people: mm, kPa, mN, ms."""

from collections.abc import Sequence
from math import inf, isfinite

from pipeline.quantities import symbol, write
from pipeline.report.correction import Correction
from pipeline.report.guideline import Guideline
from pipeline.report.table import Labels, words
from pipeline.report.verdict import Verdict


def text(guide: Guideline) -> str:
    """Return the answer, the settings, the law of correction and what is left out, as lines."""
    parts = [[guide.title], _question(guide), answer(guide), _per_outside(guide), _settings(guide)]
    parts += [_constancy(guide), _left_out(guide)]
    return "\n\n".join("\n".join(part) for part in parts if part and part[0])


def _question(guide: Guideline) -> list[str]:
    axes = " × ".join(f"{length} {name}" for name, length in guide.axes)
    wanted = [f"F within {percent(guide.accuracy)} of F_exact, error bars included"] if isfinite(guide.accuracy) else []
    wanted += [f"at most {time(guide.budget)} a case"] if isfinite(guide.budget) else []
    scenes = f"{guide.scenes} scene{'s' * (guide.scenes != 1)}{f' ({axes})' if axes and not guide.lost else ''}"
    return [f"Asked for: {', '.join(wanted)}, over {scenes}."]


def answer(guide: Guideline) -> list[str]:
    """Return the chosen setting, what it costs and what limits it, and the one with the law of correction."""
    if guide.answer is None:
        lines = [f"No setting of this study does that{_nearest(guide)}"]
        if guide.best:
            lines += _details(guide.best, guide)
    else:
        smallest = "Smallest ε" if "epsilon" in guide.answer.labels else "Fewest unknowns"
        what = smallest if isfinite(guide.accuracy) else "Most accurate"
        lines = [f"{what}: {words(guide.answer.labels)}", *_details(guide.answer, guide)]
        if guide.lean and guide.lean is not guide.answer and guide.lean.dofs < guide.answer.dofs:
            lines.append(f"Fewest unknowns: {words(guide.lean.labels)} ({cost(guide.lean)})")
    corrected = guide.corrected or guide.best_corrected
    if corrected:
        law = corrected.correction
        found = "" if guide.corrected else "no setting does that either; best reached: "
        lines.append(
            f"With the correction F_exact ≈ F / r: {found}{words(corrected.labels)}, r = {law.r:.4g}; off by at most "
            f"{percent(law.error)} on scenes that r was not taken from, {cost(corrected)}"
        )
    else:
        few = "nothing can be said: it takes more than one scene"
        lines.append(
            f"With the correction F_exact ≈ F / r: {few if guide.scenes == 1 else 'no setting does that either'}"
        )
    return lines


def _nearest(guide: Guideline) -> str:
    if guide.best:
        return f"; best reached: {words(guide.best.labels)}"
    if not any(v.is_judged for v in guide.verdicts):
        return ": none was computed for every scene."
    quickest = min((v for v in guide.verdicts if v.is_judged), key=lambda v: v.seconds)
    return f"; the quickest takes {time(quickest.seconds)}: {words(quickest.labels)}"


def _details(verdict: Verdict, guide: Guideline) -> list[str]:
    margin = guide.accuracy - verdict.error
    spare = f" (margin {percent(margin)})" if isfinite(margin) and margin >= 0 else ""
    limit = f" at {words(verdict.limit)}" if verdict.limit else ""
    return [
        f"  elements     {elements(verdict.mesh)}",
        f"  cost         {cost(verdict)}, on {guide.timing}",
        f"  worst error  {percent(verdict.error)}{spare}; {percent(verdict.deviation)} without error bars",
        f"  limited      {f'F = {newton(verdict.force)}, F_exact = {newton(verdict.exact)}'}{limit}",
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
        rows.append([*row, _short(corrected), *((f"{law.r:.4g}", percent(law.error)) if corrected else ("", ""))])
    return table(rows)


def _settings(guide: Guideline) -> list[str]:
    """Return the table of all settings: error, cost, and the law of correction."""
    rows = [[*heads(guide), "worst error", "usual", "time", "unknowns", "r", "residual", "left out", "unseen"]]
    for v in in_order(guide):
        row = cells_of(v)
        if not v.is_judged:
            rows.append([*row, f"not judged: {v.missing} of {guide.scenes} scenes not computed"])
            continue
        law = v.correction
        row += [percent(v.error), time(v.usual), time(v.seconds), f"{v.dofs:,.0f}"]
        rows.append([*row, f"{law.r:.4f}", percent(law.residual), percent(law.left_out), percent(law.unseen)])
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
    ratio = "F/F_max" if guide.has_full else "F/F_exact"
    names_of = heads(guide)
    rows = [[*names_of, "least", "most", "most - least", "relative", *(f"by {symbol(name)}" for name in names)]]
    for v in in_order(guide):
        if v.is_judged and isfinite(v.spread.most):
            over = dict(v.spread.over)
            row = [number(v.spread.least), number(v.spread.most), number(v.spread.width), percent(v.spread.relative)]
            rows.append([*cells_of(v), *row, *(number(over[name]) for name in names)])
    title = f"How constant is {ratio} over the scenes? By a parameter: the largest change it makes, all else held."
    return [title, *table(rows, len(names_of))] if len(rows) > 1 else []


def heads(guide: Guideline) -> list[str]:
    """Return the names of what the settings differ in, ε last."""
    labels = guide.verdicts[0].labels
    return sorted((symbol(name) for name in labels), key="ε".__eq__) or ["setting"]


def cells_of(verdict: Verdict) -> list[str]:
    """Return a setting under :func:`heads`."""
    labels = verdict.labels
    full = {"outside": "any"} if labels.get("epsilon") == inf and "outside" in labels else {}
    names = sorted(labels, key="epsilon".__eq__)
    return [full.get(name) or write(name, labels[name]) for name in names] or ["the only one"]


def in_order(guide: Guideline) -> list[Verdict]:
    """Return the verdicts with ε running fastest, full order last."""

    def place(verdict: Verdict) -> tuple[bool, str, float]:
        labels = verdict.labels
        epsilon = labels.get("epsilon", 0.0)
        full = epsilon == inf and "outside" in labels
        return full, str([v for k, v in labels.items() if k != "epsilon"]), epsilon

    return sorted(guide.verdicts, key=place)


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


def elements(mesh: Labels) -> str:
    """Return the sizes and kind of the elements in words."""
    if "accuracy" in mesh:
        return f"chosen by the program for an accuracy of {percent(mesh['accuracy'])}"
    parts = []
    if "fine" in mesh:
        full = mesh.get("epsilon", inf) == inf
        parts.append(f"{write('fine', mesh['fine'])} {'everywhere' if full else 'within ε'}")
        parts += [] if full else [f"{write('coarse', mesh['coarse'])} far away"]
        rim = mesh["rim"]
        edge = "a tenth of its half width" if rim is None else write("rim", rim)
        parts.append(f"{edge} at the probe's edge")
        parts.append(f"growth {mesh['growth']:g}, degree {mesh['degree']}, element {mesh['element']}")
    return ", ".join(parts) or words(mesh)


def cost(verdict: Verdict) -> str:
    """Return unknowns, elements and time, the largest over the scenes."""
    times = f"{time(verdict.seconds)} (usually {time(verdict.usual)})"
    return f"up to {verdict.dofs:,.0f} unknowns, {verdict.cells:,.0f} elements, {times}"


def percent(share: float) -> str:
    """Write a share as people read it; nothing for what is not known."""
    if not isfinite(share):
        return ""
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"


def time(seconds: float) -> str:
    """Write seconds, in ms where they are few."""
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def newton(force: float) -> str:
    """Write a force in mN."""
    return f"{1e3 * force:.4g} mN"


def number(value: float) -> str:
    """Write a ratio or a difference of ratios."""
    return f"{value:.3f}" if isfinite(value) else ""


def table(rows: Sequence[Sequence[str]], left: int = 1) -> list[str]:
    """Return rows of words as aligned lines, ``left`` columns to the left; a row that ends early ends in free text."""
    whole = [row for row in rows if len(row) == len(rows[0])]
    widths = [max(len(row[i]) for row in (rows if i < left else whole)) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        aligned = [cell.ljust(widths[i]) if i < left else cell.rjust(widths[i]) for i, cell in enumerate(row)]
        if len(row) < len(rows[0]):
            aligned[-1] = row[-1]
        lines.append(("  " + "  ".join(aligned)).rstrip())
    return lines


def _short(verdict: Verdict | None) -> str:
    if verdict is None:
        return "none"
    labels = {k: v for k, v in verdict.labels.items() if k != "outside"}
    return words(labels)
