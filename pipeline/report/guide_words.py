"""Pieces of a guide in words: settings, elements, cost, numbers, tables."""

from collections.abc import Sequence
from math import inf, isfinite

from pipeline.quantities import symbol, write
from pipeline.report.guideline import Guideline
from pipeline.report.table import Labels, words
from pipeline.report.verdict import Verdict

_NOUGHT = 1e-9  # what rounding leaves of no error


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
    if abs(share) < _NOUGHT:
        return "0 %"
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"


def time(seconds: float) -> str:
    """Write seconds, in ms where they are few."""
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def newton(force: float) -> str:
    """Write a force in mN."""
    return f"{1e3 * force:.4g} mN"


def ratio(value: float) -> str:
    """Write the r of a law of correction; nothing for what is not known."""
    return f"{value:.4g}" if isfinite(value) else ""


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
