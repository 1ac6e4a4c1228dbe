"""What a figure of a large study leaves out, as parts of the study that fit one figure each."""

import itertools
from collections.abc import Callable

import numpy as np
import xarray as xr

from pipeline.report.figures.convergence import convergence_layout
from pipeline.report.figures.epsilon import epsilon_layout
from pipeline.report.figures.exact import exact_layout
from pipeline.report.figures.layout import Layout, Selection
from pipeline.report.words import number, symbol

_LAYOUTS: dict[str, Callable[[xr.Dataset], Layout]] = {
    "epsilon": epsilon_layout, "ratio": epsilon_layout, "speedup": epsilon_layout,
    "convergence": convergence_layout, "exact": exact_layout,
}  # fmt: skip


def parts(dataset: xr.Dataset, kind: str) -> list[tuple[str, xr.Dataset]]:
    """Return, for a figure that shows a part of ``dataset``, the parts that hold the rest, each with its words.

    Of a dimension that the figure shows some values of, as many go to a part; of one that it shows at one value, one.
    What the figure shows in whole is in no part again. Empty for a figure that leaves nothing out, or has no panels.
    """
    if kind not in _LAYOUTS:
        return []
    layout = _LAYOUTS[kind](dataset)
    groups = {dim: _groups(dataset[dim].values, 1) for dim in layout.fixed}
    for shown in (layout.curves, layout.columns, layout.rows):
        for dim in shown[0]:
            if len(shown) < dataset.sizes[dim]:
                groups[dim] = _groups(dataset[dim].values, len(shown))
    seen = _seen(layout)
    found = []
    for chosen in itertools.product(*groups.values()):
        selection = dict(zip(groups, chosen, strict=True))
        if groups and not all(set(values) <= seen[dim] for dim, values in selection.items()):
            found.append((_words(dataset, selection), dataset.sel({dim: list(v) for dim, v in selection.items()})))
    return found


def _groups(values: np.ndarray, most: int) -> list[tuple[object, ...]]:
    """Return ``values`` in groups of at most ``most``, as even as can be."""
    return [tuple(part) for part in np.array_split(values, -(-len(values) // most))]


def _seen(layout: Layout) -> dict[str, set[object]]:
    """Return the values that a figure shows, by dimension."""
    found = {dim: {value} for dim, value in layout.fixed.items()}
    shown: list[Selection] = [*layout.curves, *layout.columns, *layout.rows]
    for selection in shown:
        for dim, value in selection.items():
            found.setdefault(dim, set()).add(value)
    return found


def _words(dataset: xr.Dataset, selection: dict[str, tuple[object, ...]]) -> str:
    return "; ".join(
        f"{symbol(dataset[dim])}: {', '.join(number(dataset[dim], value) for value in values)}"
        for dim, values in selection.items()
    )
