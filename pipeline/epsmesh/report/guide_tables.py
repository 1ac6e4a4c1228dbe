"""The tables of a guide: the smallest ε by depth and law, or by what is outside; all settings, in words and as data."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

import pandas as pd
import xarray as xr

from epsmesh.quantities import symbol, write
from epsmesh.report.by_scene import OfOutside, Part
from epsmesh.report.laws import Laws
from epsmesh.report.verdicts import Verdict
from epsmesh.report.words import choices, percent, time

_OF_VERDICT = (
    "missing", "deviation", "error", "limit", "force", "exact", "distance", "force_bar", "exact_bar", "seconds",
    "usual", "dofs", "cells",
)  # fmt: skip


def by_scene(parts: Sequence[Part], what: str, whole: str) -> list[str]:
    """Return the smallest ε at each depth and for each law, a line each; nothing if it is the same at all.

    ``what`` is within which accuracy of what, ``whole`` the name of the force that one is a share of.
    """
    if len(parts) < 2:
        return []
    rows = [
        {symbol(name): _range(parts, name, part) for name in part.where}
        | {"ε" if one.outside == "epsilon" else one.outside: _smallest(one, whole) for one in part.answers}
        for part in parts
    ]
    return [f"Smallest ε for {what}:", *pd.DataFrame(rows).to_string(index=False).splitlines()]


def outsides(
    answers: Mapping[str, tuple[Verdict | None, Verdict | None]], coordinates: Mapping[Any, xr.DataArray]
) -> pd.DataFrame:
    """Return the answers for each value of outside: the smallest ε as F is, and with F / r."""
    rows = []
    for name, (plain, corrected) in answers.items():
        law = corrected.correction if corrected else None
        rows.append(
            {
                "outside": name,
                "smallest ε": _short(coordinates, plain),
                "worst error": percent(plain.error) if plain else "",
                "ε with F / r": _short(coordinates, corrected),
                "r": f"{law.r:.4g}" if law else "",
                "error with F / r": percent(law.error) if law else "",
            }
        )
    return pd.DataFrame(rows)


def settings(verdicts: Iterable[Verdict], scenes: int, *, has_full: bool) -> pd.DataFrame:
    """Return a row of words for each setting, ε running fastest: what is swept, error, cost, F/F_max, and r."""
    share = "F/F_max" if has_full else "F/F_exact"
    rows = []
    for v in sorted(verdicts, key=_place):
        row = {symbol(name): write(name, v.labels[name]) for name in sorted(v.labels, key="epsilon".__eq__)}
        if v.labels.get("epsilon") == inf and "outside" in v.labels:
            row[symbol("outside")] = "any"
        if not v.is_judged:
            rows.append(row | {"worst error": f"incomplete: {v.missing} of {scenes} scenes have no result"})
            continue
        law, spread = v.correction, v.spread
        row |= {"worst error": percent(v.error), "unknowns": f"{v.dofs:,.0f}"}
        row |= {"median time": time(v.usual), "longest time": time(v.seconds)}
        row[share] = f"{spread.least:.3f} … {spread.most:.3f}" if isfinite(spread.most) else ""
        rows.append(row | {"r": f"{law.r:.4g}" if isfinite(law.r) else "", "error of F/r": percent(law.error)})
    return pd.DataFrame(rows).fillna("")


def _range(parts: Sequence[Part], name: str, part: Part) -> str:
    """Return the labels of a part: "all" of a parameter, or the first and the last of numbers."""
    labels = part.where[name]
    everything = {label for other in parts for label in other.where[name]}
    if len(labels) > 1 and len(labels) == len(everything):
        return "all"
    words = [write(name, label) for label in labels]
    return f"{words[0]} to {words[-1]}" if len(words) > 1 and name == "depth" else ", ".join(words)


def _smallest(one: OfOutside, whole: str) -> str:
    """Return the smallest ε; where none suffices, F over F_max with the largest one."""
    if isfinite(one.epsilon):
        return write("epsilon", one.epsilon)
    if one.widest is None:
        return "full order" if one.answer else "none"
    spread, epsilon = one.widest.spread, write("epsilon", one.widest.mesh["epsilon"])
    return f"none: {spread.least:.2f} to {spread.most:.2f} {whole} at {epsilon}"


def _short(coordinates: Mapping[Any, xr.DataArray], verdict: Verdict | None) -> str:
    if verdict is None:
        return "none"
    if verdict.labels.get("epsilon") == inf:
        return "none: full order only"
    labels = {name: value for name, value in verdict.labels.items() if name != "outside"}
    return choices(coordinates, labels) or "the one setting"


def _place(verdict: Verdict) -> tuple[bool, str, float]:
    """Return what settings are sorted by: full order last."""
    labels = verdict.labels
    epsilon = labels.get("epsilon", 0.0)
    return epsilon == inf and "outside" in labels, str([v for k, v in labels.items() if k != "epsilon"]), epsilon


def row(verdict: Verdict, *, is_kept: bool) -> dict[str, Any]:
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


def cost(verdict: Verdict) -> str:
    """Return unknowns, elements and time, the largest over the scenes."""
    size = f"up to {verdict.dofs:,.0f} unknowns, {verdict.cells:,.0f} elements"
    return f"{size}, {time(verdict.seconds)} a case (median {time(verdict.usual)})"
