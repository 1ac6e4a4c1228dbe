"""Facets: which dimension of a study becomes curves, columns and rows of a figure."""

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.quantities import MESH_DIMENSIONS, QUANTITIES
from epsmesh.report.pareto import is_by_chance
from epsmesh.report.values import relative
from epsmesh.report.words import choice, is_numeric, number, symbol

Selection = dict[str, Any]

# More than these cannot be distinguished, or do not fit a page.
MOST = (7, 3, 3)
# Quantities that differ by less than this along a dimension do not depend on it: E scales F and leaves F/F_max.
_IDLE = 1e-7
# What refines a mesh, the most telling first: the rim rules the error.
_REFINEMENTS = ("epsilon", "rim", "fine", "coarse", "growth", "mesh_accuracy")


@dataclass(frozen=True)
class Facets:
    """Every combination of a row, a column and a curve, each a selection along dimensions, at the selection ``at``.

    ``fixed`` is the part of ``at`` on which something depends; ``note`` says what is shown of a study that has more,
    ``part`` of which dimension some values only.
    """

    x: str | None
    curves: list[Selection] = field(default_factory=lambda: [{}])
    columns: list[Selection] = field(default_factory=lambda: [{}])
    rows: list[Selection] = field(default_factory=lambda: [{}])
    at: Selection = field(default_factory=dict)
    fixed: Selection = field(default_factory=dict)
    note: str = ""
    part: tuple[str, ...] = ()


def arrange(
    dataset: xr.Dataset,
    quantities: Sequence[str],
    x: str | None,
    flat: Collection[str] = (),
    most: tuple[int, int, int] = MOST,
    first: Collection[str] = ("poisson", "law"),
) -> Facets:
    """Choose facets of ``quantities`` against the dimension ``x``; panels draw the dimensions ``flat`` themselves.

    Curves are a dimension of ``first``, or the first numbers; columns the kinds of outside, or other words; rows the
    next. ``most`` limits their numbers. Dimensions that change nothing, or have no place, have one value.
    """
    free = [str(dim) for dim in dataset["force"].dims if dim != x and dim not in flat]
    live = [d for d in free if dataset.sizes[d] > 1 and any(_depends(dataset[name], d) for name in quantities)]
    at = {dim: _representative(dataset, dim, x, quantities) for dim in free if dim not in live}
    ranks: tuple[Callable[[str], Any], ...] = (
        lambda dim: (dim not in first, not is_numeric(dataset[dim]), dim == "outside"),
        lambda dim: (dim != "outside", is_numeric(dataset[dim])),
        lambda dim: is_numeric(dataset[dim]),
    )
    chosen: list[list[Selection]] = []
    for rank, count in zip(ranks, most, strict=True):
        dim = min(live, key=rank, default=None) if count > 1 else None
        if dim is not None:
            live.remove(dim)
        chosen.append(_spread(dataset, dim, count))
    fixed = {dim: _representative(dataset, dim, x, quantities) for dim in live}
    words = [f"{choice(dataset[d], value)} (one of {dataset.sizes[d]})" for d, value in fixed.items()]
    part = [
        f"{len(some)} of {dataset.sizes[d]} values of {symbol(dataset[d])}"
        for some in chosen
        for d in some[0]
        if len(some) < dataset.sizes[d]
    ]
    curves, columns, rows = chosen
    note = f"Shown: {', '.join([*words, *part])}." if words or part else ""
    return Facets(x, curves, columns, rows, at | fixed, fixed, note, tuple(part))


def rest(dataset: xr.Dataset, facets: Facets) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the parts of ``dataset`` that a figure with these ``facets`` leaves out, each with its words."""
    groups = {dim: [(value,) for value in dataset[dim].values] for dim in facets.fixed}
    seen = {dim: {value} for dim, value in facets.fixed.items()}
    for shown in (facets.curves, facets.columns, facets.rows):
        for dim in shown[0]:
            if len(shown) < dataset.sizes[dim]:
                count = -(-dataset.sizes[dim] // len(shown))
                groups[dim] = [tuple(part) for part in np.array_split(dataset[dim].values, count)]
                seen[dim] = {part[dim] for part in shown}
    for values in itertools.product(*groups.values()):
        part = dict(zip(groups, values, strict=True))
        if groups and not all(set(chosen) <= seen[dim] for dim, chosen in part.items()):
            words = [f"{symbol(dataset[d])}: {', '.join(number(dataset[d], v) for v in part[d])}" for d in part]
            yield "; ".join(words), dataset.sel({dim: list(chosen) for dim, chosen in part.items()})


def swept(dataset: xr.Dataset) -> list[str]:
    """Return the dimensions with more than one value, in the study's order."""
    return [str(dim) for dim in dataset["force"].dims if dataset.sizes[dim] > 1]


def main_dimension(dataset: xr.Dataset) -> str | None:
    """Return the dimension that a study is about: what refines the mesh, else the first numbers, else the first."""
    refining = [name for name in _REFINEMENTS if dataset.sizes.get(name, 0) > 1]
    numeric = [name for name in swept(dataset) if is_numeric(dataset[name])]
    return next(iter([*refining, *numeric, *map(str, dataset["force"].dims)]), None)


def is_meshed(dataset: xr.Dataset) -> bool:
    """Tell whether meshes are swept."""
    return any(dim in MESH_DIMENSIONS for dim in swept(dataset))


def with_error(dataset: xr.Dataset) -> tuple[str, xr.Dataset]:
    """Add ``error``, the relative error of F against F_exact, or F_max where there is no F_exact, and ``is_by_chance``.

    ``exact_bar`` is the relative error bar of F_exact.

    Return the name of the reference as well, "exact" or "max". A case that is its own reference has no error, nor
    has one that agrees with it to the last digit: a logarithmic axis has no place for it.
    """
    is_exact = bool(np.isfinite(dataset["force_exact_ratio"]).any())
    signed = dataset["force_exact_ratio" if is_exact else "force_ratio"] - 1
    error = abs(signed).where(signed != 0)
    exact_bar = relative(dataset, "force_exact_error")
    added = {"error": error, "is_by_chance": is_by_chance(error), "exact_bar": exact_bar}
    return "exact" if is_exact else "max", dataset.assign(added)


def _depends(array: xr.DataArray, dim: str) -> bool:
    """Tell whether ``array`` varies along ``dim`` by more than rounding."""
    if dim not in array.dims:
        return False
    known = array.where(np.isfinite(array))
    return bool((known.max(dim) - known.min(dim) > _IDLE * abs(known).max(dim)).any())


def _spread(dataset: xr.Dataset, dim: str | None, most: int) -> list[Selection]:
    """Return selections along ``dim``: all of its values, or ``most`` of them from first to last."""
    if dim is None:
        return [{}]
    values = dataset[dim].values
    chosen = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int))
    return [{dim: values[i]} for i in chosen]


def _representative(dataset: xr.Dataset, dim: str, x: str | None, quantities: Sequence[str]) -> Any:
    """Return the value at which a dimension without a place is shown: of those with most known, the finest or first.

    The full order has no outside: against that, the middle ε is shown.
    """
    counts = [np.isfinite(dataset[name]).broadcast_like(dataset["force"]) for name in quantities]
    known = sum(count.sum([d for d in count.dims if d != dim]).values for count in counts)
    values = dataset[dim].values[known == known.max()]
    if dim == "epsilon" and x == "outside" and np.isfinite(values).any():
        finite = np.sort(values[np.isfinite(values)])
        return finite[len(finite) // 2]
    if dim == "depth":
        return values.max()
    finest = QUANTITIES[dim].finest if dim in QUANTITIES else ""
    if not finest:
        return values[0]
    return values.max() if finest == "largest" else values.min()
