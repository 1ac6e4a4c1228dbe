"""The table of cases: columns in the units people read, rows in the order in which a reader needs them."""

from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np
import xarray as xr
from markupsafe import Markup

from epsmesh.pages import json_in_page
from epsmesh.quantities import LARGEST, MESH_DIMENSIONS, QUANTITIES
from epsmesh.report.study import study_of
from epsmesh.report.values import by_case, relative
from epsmesh.report.words import decimals, is_numeric, lengths, number, scale, symbol
from epsmesh.states import WORST_FIRST

# Rows of a page of the table.
FIRST_ROWS = 50
# The columns of numbers; some are shown only when asked for.
_QUANTITIES = (
    "depth",
    "depth_error",
    "force",
    "force_error_share",
    "force_error",
    "jaw_force",
    "jaw_force_error",
    "pull_force",
    "pull_force_error",
    "jaw_pull_force",
    "jaw_pull_force_error",
    "slip_begins",
    "slip_whole",
    "support_force",
    "support_force_error",
    "lift_off_area",
    "lift_off_area_error",
    "puncture_depth",
    "puncture_force",
    "force_ratio",
    "force_exact_ratio",
    "force_exact_error",
    "speedup",
    "time_total",
    "dofs",
    "cells",
    "iterations",
    "time_mesh",
    "time_assemble",
    "time_setup",
    "time_solve",
    "time_error",
    "memory",
    *LARGEST,
    "energy",
    "balance",
)
_SHARE = "force_error_share"  # of F: what errors of different forces are compared by
_SHOWN = {
    "puncture_depth",
    "puncture_force",
    "depth",
    "depth_error",
    "force",
    _SHARE,
    "jaw_force",
    "pull_force",
    "support_force",
    "lift_off_area",
    "force_ratio",
    "force_exact_ratio",
    "speedup",
    "time_total",
}
_DIGITS = 4
_RATIO = 1e-3  # the least error bar of F/F_exact, and that of F/F_max, for digits: four decimals


@dataclass(frozen=True)
class Column:
    """A column: ``values`` are numbers (None: none) or, where there are ``words``, the index of a word.

    ``decimals`` are those of the numbers that have an error bar, or are one. ``keys`` sort the words of a swept number;
    ``hint`` is the long name; ``is_first`` columns are shown at first.
    """

    name: str
    heading: str
    values: list[float | int | None]
    hint: str = ""
    words: list[str] | None = None
    keys: list[float] | None = None
    decimals: list[int] | None = None
    is_filter: bool = False
    is_first: bool = True

    def text(self, row: int) -> str:
        """Return what stands in a row."""
        value = self.values[row]
        if self.words is not None:
            return self.words[int(value or 0)]
        if self.decimals is not None and value is not None:
            return f"{value:.{self.decimals[row]}f}"
        return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Table:
    """The table of cases; ``order`` lists the rows with failed ones first."""

    columns: list[Column]
    order: list[int]

    @property
    def json(self) -> Markup:
        """The table as JSON that can stand in a ``<script>`` element."""
        columns = [vars(column) for column in self.columns]
        return json_in_page({"columns": columns, "order": self.order, "rows": FIRST_ROWS})

    @property
    def filters(self) -> list[Column]:
        """The columns by whose words cases can be chosen."""
        return [column for column in self.columns if column.is_filter and len(column.words or ()) > 1]


def case_table(dataset: xr.Dataset) -> Table:
    """Return the table of the cases of ``dataset``."""
    dims = [str(dim) for dim in dataset["status"].dims]
    size = dataset["status"].size
    states = [str(state) for state in dataset["status"].values.ravel()]
    exact = relative(dataset, "force_exact_error").fillna(0.0).clip(min=_RATIO)
    bars = {"force_ratio_error": xr.full_like(exact, _RATIO), "force_exact_ratio_error": exact}
    dataset = dataset.assign(bars | {_SHARE: relative(dataset, "force_error")})
    study = study_of(dataset)
    stages = prod(len(axis) for axis in (study.axes if study else ()) if axis.is_stage)  # the last axis of a plan
    numbers = Column(
        "case", "case", [stages * (n + 1) - 1 for n in range(size)], "the number by which epsmesh plan knows it"
    )
    axes = [_axis(dataset, dim, position, dims) for position, dim in enumerate(dims)]
    quantities = [
        _quantity(dataset, name) for name in _QUANTITIES if name in dataset and {*dataset[name].dims} <= {*dims}
    ]
    status = _texts("status", states, QUANTITIES["status"].meaning, is_filter=True)
    origin = _texts(
        "origin",
        by_case(dataset, "origin").values.ravel(),
        QUANTITIES["origin"].meaning,
        is_filter=True,
        is_first=False,
    )
    message = _texts("message", by_case(dataset, "message").values.ravel(), "why there is no force")
    known = [column for column in quantities if any(value is not None for value in column.values)]
    # The depth of a sweep is a column of its own; of one mesh setting, F_max is each case's own force.
    swept = "probe_depth" in dims or "depth" in dims
    needless = {
        *(["depth"] if swept else []),
        *(("force_ratio", "speedup") if {*dims}.isdisjoint(MESH_DIMENSIONS) else ()),
    }
    known = [replace(one, is_first=False) if one.name in needless else one for one in known]
    words = [column for column in (origin, message) if any(column.words or ())]
    rank = {state: position for position, state in enumerate(WORST_FIRST)}
    order = sorted(range(size), key=lambda row: rank.get(states[row], 0))
    return Table([numbers, status, *axes, *known, *words], order)


def _axis(dataset: xr.Dataset, dim: str, position: int, dims: list[str]) -> Column:
    coordinate = dataset[dim]
    codes = np.indices([dataset.sizes[d] for d in dims])[position].ravel()
    values = coordinate.values
    keys = [min(float(value), 1e300) for value in values] if is_numeric(coordinate) else None
    hint = str(coordinate.attrs.get("long_name", dim))
    words = [lengths(coordinate, number(coordinate, value)) for value in values]
    return Column(dim, symbol(coordinate), codes.tolist(), hint, words, keys, is_filter=True)


def _quantity(dataset: xr.Dataset, name: str) -> Column:
    array = by_case(dataset, name)
    if name == _SHARE:
        heading, factor, unit = "± F", 100.0, "%"
    else:
        heading, (factor, unit) = symbol(array), scale(array)
    hint, flat = str(array.attrs.get("long_name", name)), array.values.ravel()
    title, places = f"{heading} ({unit})" if unit else heading, _decimals(dataset, name, factor)
    if np.issubdtype(array.dtype, np.integer):
        values: list[Any] = [int(value) if value >= 0 else None for value in flat]
    elif places:
        known = zip(flat, places, strict=True)
        values = [round(factor * float(value), digits) if np.isfinite(value) else None for value, digits in known]
    else:
        values = [_rounded(value, name, factor) if np.isfinite(value) else None for value in flat]
    return Column(name, title, values, hint, decimals=places, is_first=name in _SHOWN)


def _decimals(dataset: xr.Dataset, name: str, factor: float) -> list[int] | None:
    """Return the decimals of each case of a quantity that has an error bar, or is one; None of others.

    A case without a bar has four digits.
    """
    value = name if name == _SHARE else name.removesuffix("_error")
    bar = name if name == _SHARE else f"{value}_error"
    if value not in dataset or bar not in dataset:
        return None
    sizes = (np.nan_to_num(abs(factor * by_case(dataset, one).values.ravel())) for one in (value, bar))
    return [decimals(size, error or 0.01 * size or 1.0) for size, error in zip(*sizes, strict=True)]


def _rounded(value: float, name: str, factor: float) -> float | int:
    if name in ("dofs", "cells", "iterations"):
        return int(value)
    return float(f"{value * factor:.{_DIGITS}g}")


def _texts(name: str, values: Any, hint: str, *, is_filter: bool = False, is_first: bool = True) -> Column:
    texts = [str(value) for value in values]
    words = list(dict.fromkeys(texts))
    codes = {word: code for code, word in enumerate(words)}
    return Column(name, name, [codes[text] for text in texts], hint, words, is_filter=is_filter, is_first=is_first)
