"""A comparison of two datasets, in words and as plain data."""

from dataclasses import asdict
from math import isfinite
from typing import Any

import pandas as pd

from epsmesh.printable import counted
from epsmesh.quantities import readable
from epsmesh.report.compare import Comparison, worded
from epsmesh.report.words import percent

# Cases that a list names; the JSON has all of them.
_MOST = 20


def verdict(found: Comparison) -> str:
    """Return the verdict in a sentence."""
    if found.agrees:
        values = counted(len(found.pairs), "value")
        return f"A and B agree within their error bars: {values} of {counted(found.compared, 'case')}"
    values = counted(len(found.pairs), "value")
    return f"A and B do not agree: {len(found.apart)} of {values} differ by more than their error bars"


def text(found: Comparison, names: tuple[str, str], doubts: dict[str, list[str]]) -> str:
    """Return what came of it for people: ``names`` are those of A and B, ``doubts`` what makes their times doubtful."""
    lines = [verdict(found), *(f"{letter}: {name}" for letter, name in zip("AB", names, strict=True))]
    lines += [
        f"  {key} differs: {worded(key, one)} in A, {worded(key, other)} in B" for key, one, other in found.settings
    ]
    lines.append(
        f"{counted(found.cases, 'case')} in both, {len(found.only_a)} in A only, {len(found.only_b)} in B only"
    )
    if found.again_a or found.again_b:
        lines.append(
            f"  counted once: {found.again_a} of A and {found.again_b} of B; full order is the same for every outside"
        )
    lines += _listed([f"  not compared: {case}: {why}" for case, why in found.not_compared])
    if found.apart:
        lines += _apart(found)
    if largest := max(
        (pair for pair in found.pairs if pair.state == "agree"), key=lambda pair: abs(pair.difference), default=None
    ):
        lines.append(
            f"largest difference within the bars: {percent(largest.difference)} (bars {percent(largest.bars)}), "
            f"{largest.quantity}, {largest.case}"
        )
    if found.times:
        middle, least, most = found.times
        lines.append(f"times in B over those in A: {middle:.2g} × (median), {least:.2g} to {most:.2g} ×")
    lines += [f"  times of {letter}: {doubt}" for letter, sentences in doubts.items() for doubt in sentences]
    return "\n".join(lines)


def to_dict(found: Comparison, names: tuple[str, str], doubts: dict[str, list[str]]) -> dict[str, Any]:
    """Return everything as plain data, in SI units; differences and bars are also relative to A."""
    rows = [asdict(pair) | {"difference": pair.difference, "bars": pair.bars} for pair in found.pairs]
    times = dict(zip(("median", "least", "most"), found.times, strict=True)) if found.times else None
    return {
        "a": names[0],
        "b": names[1],
        "agree": found.agrees,
        "verdict": verdict(found),
        "cases": found.cases,
        "only_a": list(found.only_a),
        "only_b": list(found.only_b),
        "again_a": found.again_a,
        "again_b": found.again_b,
        "not_compared": [{"case": case, "why": why} for case, why in found.not_compared],
        "settings": [{"key": key, "a": one, "b": other} for key, one, other in found.settings],
        "times": times,
        "doubts": doubts,
        "values": rows,
    }


def _apart(found: Comparison) -> list[str]:
    rows = []
    for pair in found.apart[:_MOST]:
        factor, unit = readable(pair.quantity)
        a, b = (f"{factor * value:.5g} {unit}" if isfinite(value) else "" for value in (pair.a, pair.b))
        words = {"case": pair.case, "quantity": pair.quantity, "A": a, "B": b, "B - A": percent(pair.difference)}
        rows.append(words | {"bars": percent(pair.bars), "": pair.why})
    more = len(found.apart) - _MOST
    return [
        *pd.DataFrame(rows).to_string(index=False).splitlines(),
        *([f"  … and {more} more: --json has all"] if more > 0 else []),
    ]


def _listed(lines: list[str]) -> list[str]:
    return lines if len(lines) <= _MOST else [*lines[:_MOST], f"  … and {len(lines) - _MOST} more: --json has all"]
