"""A ranking of tests in words, and as data."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from epsmesh.report.words import percent
from epsmesh_identify.estimation.design import POINTS, USUAL, Design, Widths
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.report.identified import engineering, title, words_of_undeclared

UNSEEN = "not seen"
"""The bar of an unknown that may be anywhere in its range."""


def lines(design: Design) -> Iterator[str]:
    """Yield the ranking as a table, and then what it says of unknowns that the planned tests do not see."""
    names = list(design.planned)
    kinds = ("", " undeclared") if design.may_hide else ("",)
    head = ["test", "narrower", *(f"{title(name)}{kind}" for name in names for kind in kinds)]
    rows = [("as planned", "", design.planned)]
    rows += [(one.words, _times(one.gain), one.widths) for one in design.ranked]
    table = [head, *([words, gain, *_cells(design, names, widths)] for words, gain, widths in rows)]
    sizes = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        yield "  ".join(cell.ljust(size) for cell, size in zip(row, sizes, strict=True)).rstrip()
    yield from _of_unseen(design)
    yield "narrower: the geometric mean over all bars of a row."
    size, rho = percent(USUAL.level), USUAL.noise.correlation
    yield (
        f"Bars are half widths of 95 %, for noise of {size} of the largest force, {rho:g} correlated from one of the "
        f"{POINTS} points of a test to the next."
    )
    if design.may_hide:
        yield f"undeclared: {words_of_undeclared(design.may_hide)}."


def _times(gain: float) -> str:
    return f"{gain:.1f} times" if gain >= 1 else f"{1 / gain:.1f} times wider"


def _cells(design: Design, names: list[str], widths: Widths) -> list[str]:
    known = {unknown.name: unknown for unknown in design.unknowns}
    both = 1 + bool(design.may_hide)
    return [bar(known[name], width) for name in names for width in widths[name][:both]]


def _of_unseen(design: Design) -> Iterator[str]:
    """Yield which test would give an unknown that the planned ones do not see."""
    known = {unknown.name: unknown for unknown in design.unknowns}
    for name, (width, _) in design.planned.items():
        if bar(known[name], width) == UNSEEN and design.ranked:
            best = min(design.ranked, key=lambda one: one.widths[name][0])
            found = bar(known[name], best.widths[name][0])
            if found != UNSEEN:
                yield f"{title(name)} is not in the planned tests: {best.words} would give it {found}."


def bar(unknown: Unknown, width: float) -> str:
    """Write a half width, a share of an unknown's range, as a bar."""
    if not Design.is_seen(width):
        return UNSEEN
    if unknown.is_logarithmic:
        return f"± {percent(float(np.expm1(width * np.log(unknown.high / unknown.low))))}"
    return f"± {engineering(width * (unknown.high - unknown.low), unknown.unit, 2)}"


def as_data(design: Design) -> Mapping[str, Any]:
    """Return the ranking as plain data: both half widths of each unknown, as shares of its range."""

    def plain(widths: Widths) -> dict[str, list[float]]:
        return {name: list(both) for name, both in widths.items()}

    ranked = [{"test": one.words, "gain": one.gain, "half_widths": plain(one.widths)} for one in design.ranked]
    return {"values": dict(design.values), "planned": plain(design.planned), "ranked": ranked}
