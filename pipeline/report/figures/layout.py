"""Which dimension of a study becomes curves, columns and rows of a figure, and what of a large study is shown."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from pipeline.quantities import QUANTITIES
from pipeline.report.words import choice, choices, is_numeric, symbol

Selection = dict[str, Any]

# More than these cannot be told apart, or do not fit a page.
MOST_CURVES, MOST_COLUMNS, MOST_ROWS = 7, 3, 3
# Quantities that differ by less than this along a dimension do not depend on it: E scales F and leaves F/F_max.
_IDLE = 1e-7


@dataclass(frozen=True)
class Layout:
    """What a figure shows: every combination of a row, a column and a curve, each a selection along dimensions.

    ``at`` is selected throughout, ``fixed`` the part of it that matters; ``note`` says so to the reader, ``part`` which
    values were left out.
    """

    x: str | None
    rows: list[Selection] = field(default_factory=lambda: [{}])
    columns: list[Selection] = field(default_factory=lambda: [{}])
    curves: list[Selection] = field(default_factory=lambda: [{}])
    at: Selection = field(default_factory=dict)
    fixed: Selection = field(default_factory=dict)
    note: str = ""
    part: tuple[str, ...] = ()


def arrange(
    dataset: xr.Dataset,
    quantities: Sequence[str],
    x: str | None,
    flat: Collection[str] = (),
    most: tuple[int, int, int] = (MOST_CURVES, MOST_COLUMNS, MOST_ROWS),
) -> Layout:
    """Lay out ``quantities`` against the dimension ``x``; the dimensions ``flat`` are left to the panels.

    Curves are Poisson's ratios, or the first other numbers; columns what becomes of the outside, or other words; rows
    what is left; ``most`` says how many of each. Dimensions on which nothing depends, and those for which there is no
    place, are shown at one value.
    """
    free = [str(dim) for dim in dataset["force"].dims if dim != x and dim not in flat]
    dims = [dim for dim in free if dataset.sizes[dim] > 1]
    live = [dim for dim in dims if any(_depends(dataset[name], dim) for name in quantities)]
    idle = [dim for dim in dims if dim not in live]
    at = {dim: _representative(dataset, dim, x) for dim in free if dim not in live}
    parts: list[tuple[str | None, list[Selection]]] = []
    ranks: tuple[Callable[[xr.Dataset, str], tuple[bool, ...]], ...] = (_curve_rank, _column_rank, _row_rank)
    for rank, count in zip(ranks, most, strict=True):
        dim = min(live, key=lambda name: rank(dataset, name), default=None) if count > 1 else None
        if dim:
            live.remove(dim)
        parts.append((dim, _spread(dataset, dim, count)))
    fixed = {dim: _representative(dataset, dim, x) for dim in live}
    (_, curves), (_, columns), (_, rows) = parts
    part = tuple(f"{len(p)} of {dataset.sizes[d]} values of {symbol(dataset[d])}"
                 for d, p in parts if d and len(p) < dataset.sizes[d])  # fmt: skip
    return Layout(x, rows, columns, curves, at | fixed, fixed, _note(dataset, fixed, idle, part), part)


def _depends(array: xr.DataArray, dim: str) -> bool:
    """Tell whether ``array`` varies along ``dim`` by more than rounding."""
    if dim not in array.dims:
        return False
    values = np.moveaxis(array.values, array.dims.index(dim), 0)
    known = np.where(np.isfinite(values), values, np.nan)
    first = np.take_along_axis(known, np.isfinite(known).argmax(axis=0)[None], axis=0)
    differs = np.abs(known - first) > _IDLE * np.abs(first)
    return bool(differs.any())


def _curve_rank(dataset: xr.Dataset, dim: str) -> tuple[bool, ...]:
    return (dim != "poisson", not is_numeric(dataset[dim]), dim == "outside")


def _column_rank(dataset: xr.Dataset, dim: str) -> tuple[bool, ...]:
    return (dim != "outside", is_numeric(dataset[dim]))


def _row_rank(dataset: xr.Dataset, dim: str) -> tuple[bool, ...]:
    return (is_numeric(dataset[dim]),)


def _spread(dataset: xr.Dataset, dim: str | None, most: int) -> list[Selection]:
    """Return selections along ``dim``: all of its values, or ``most`` of them from first to last."""
    if dim is None:
        return [{}]
    values = dataset[dim].values
    chosen = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int))
    return [{dim: values[i]} for i in chosen]


def _note(dataset: xr.Dataset, fixed: Selection, idle: list[str], part: Sequence[str]) -> str:
    """Say what is shown of a study that has more than fits."""
    words = [f"{choice(dataset[d], value)} (one of {dataset.sizes[d]})" for d, value in fixed.items()]
    text = f"shown: {', '.join((*words, *part))}" if words or part else ""
    same = f"the same for every {', '.join(symbol(dataset[d]) for d in idle)}" if idle else ""
    return "; ".join(filter(None, (text, same)))


def _representative(dataset: xr.Dataset, dim: str, x: str | None) -> Any:
    """Return the value at which a dimension without a place is shown: the finest mesh, or the first, with most forces.

    What is outside does not matter to the full order: against it, the middle ε is shown.
    """
    known = np.isfinite(dataset["force"]).sum([d for d in dataset["force"].dims if d != dim]).values
    values = dataset[dim].values[known == known.max()]
    if dim == "epsilon" and x == "outside" and np.isfinite(values).any():
        finite = np.sort(values[np.isfinite(values)])
        return finite[len(finite) // 2]
    finest = QUANTITIES[dim].finest if dim in QUANTITIES else ""
    if not finest:
        return values[0]
    return values.max() if finest == "largest" else values.min()


def title_of(dataset: xr.Dataset, *parts: Selection) -> str:
    """Return the words for what a panel shows."""
    return ", ".join(filter(None, (choices(dataset, part) for part in parts)))
