"""Curves of quantities against a swept dimension, in a grid of panels."""

import itertools
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.quantities import write
from epsmesh.report.figures.facets import Facets
from epsmesh.report.figures.style import FAILED, LEGEND, STEPS, WIDTH, log_scale, look, new_figure
from epsmesh.report.words import choices, heading, is_numeric, lengths, scale
from epsmesh.states import FAILURES

_HEIGHT = 2.1  # inches of a panel
_BESIDE = 1.6  # inches: what a figure takes besides its panels, above and below them
_LONG = 30.0  # values that span more than this have a logarithmic axis
_LINEAR = {"depth"}  # F over it is read as a stiffness
# Letters: of a word's line at an axis, of all words there, of a panel's title, and of a line beside an axis.
_WORD, _LINE, _TITLE, _LABEL = 14, 32, 34, 26
_MARKED = 40  # points of a curve up to which each has a marker and a bar
BARS = {"capsize": 2, "elinewidth": 0.8}


@dataclass(frozen=True)
class Panel:
    """One panel: its axes, the part of the dataset that it shows, its quantity, its column, and the facets of that."""

    ax: Axes
    data: xr.Dataset
    quantity: str
    column: int
    facets: Facets

    @property
    def curves(self) -> Iterator[tuple[str, dict[str, str], xr.Dataset]]:
        """Label, colour with marker, and data of each curve."""
        for position, curve in enumerate(self.facets.curves):
            yield choices(self.data, curve), look(position), self.data.sel(curve)


def grid(
    dataset: xr.Dataset,
    facets: Sequence[Facets],
    quantities: Sequence[str],
    panel: float = WIDTH / 3,
    beside: float = LEGEND,
) -> tuple[Figure, list[Panel]]:
    """Return a figure with columns for those of all ``facets``, and a row for each of their rows and each quantity.

    Each column is ``panel`` inches wide; a legend has so many ``beside``.
    """
    columns = [(one, column) for one in facets for column in one.columns]
    rows = list(itertools.product(facets[0].rows, quantities))
    figure = new_figure(panel * max(len(columns), 2 * WIDTH / 3 / panel) + beside, _HEIGHT * len(rows) + _BESIDE)
    axes = figure.subplots(len(rows), len(columns), squeeze=False, sharex="col")
    panels = []
    for j, (one, column) in enumerate(columns):
        for ax, (row, quantity) in zip(axes[:, j], rows, strict=True):
            panels.append(Panel(ax, dataset.sel(one.at | row | column), quantity, j, one))
            ax.locator_params(steps=STEPS)
            if quantity == quantities[0]:
                ax.set_title(textwrap.fill(choices(dataset, row | column), _TITLE))
            ax.set_ylabel(textwrap.fill(heading(dataset[quantity], short=j > 0), _LABEL))
        if one.x:
            axes[-1, j].set_xlabel(heading(dataset[one.x]))
    return figure, panels


def share(panels: Sequence[Panel]) -> None:
    """Give panels of a quantity one scale: all or, where columns are kinds of outside, those of each column."""
    first: dict[tuple[str, int], Axes] = {}
    for panel in panels:
        by_column = "outside" in panel.facets.columns[0] and panel.quantity != "speedup"
        key = panel.quantity, panel.column if by_column else 0
        if first.setdefault(key, panel.ax) is not panel.ax:
            panel.ax.sharey(first[key])
            panel.ax.autoscale_view()


def draw(panel: Panel) -> None:
    """Draw the curves of a panel, with the error bars of its quantity, and crosses where cases failed."""
    assert panel.facets.x is not None
    along = panel.data[panel.facets.x]
    x, count = positions(along), len(panel.facets.curves)
    joins = is_numeric(along) and len(x) > 1
    factor = scale(panel.data[panel.quantity])[0]
    for position, (label, own, line) in enumerate(panel.curves):
        y = factor * line[panel.quantity].values.astype(float)
        if not np.isfinite(y).any():
            continue
        style = own | ({} if joins else {"linestyle": "none"})
        is_long = joins and len(x) > _MARKED and not _has_lone(y)
        style |= {"marker": "none"} if is_long else {}
        beside = x if joins else x + 0.12 * (position - (count - 1) / 2)
        if (error := f"{panel.quantity}_error") in line:
            bars = np.broadcast_to(np.nan_to_num(np.abs(factor * line[error].values)), y.shape)
            if is_long:  # a band: the ends of so many bars would cover the curve
                panel.ax.fill_between(x, y - bars, y + bars, color=own["color"], alpha=0.15, linewidth=0)
            panel.ax.errorbar(beside, y, None if is_long else bars, label=label or None, **BARS, **style)
        else:
            panel.ax.plot(beside, y, label=label or None, **style)
        failed = np.isin(line["status"].values.astype(str), FAILURES)
        place = {"transform": panel.ax.get_xaxis_transform(), "zorder": 6}
        panel.ax.plot(x[failed], np.full(failed.sum(), 0.04), "x", color=FAILED, **place)
    write_ticks(panel.ax, along)


def _has_lone(values: np.ndarray) -> bool:
    """Tell whether a value has no neighbour: no line goes there, and without a marker it is not seen."""
    known = np.pad(np.isfinite(values), 1)
    return bool((known[1:-1] & ~known[:-2] & ~known[2:]).any())


def positions(coordinate: xr.DataArray) -> np.ndarray:
    """Return where the values of a dimension are on an axis: words in a row, full order a step past the largest."""
    values = coordinate.values
    if not is_numeric(coordinate):
        return np.arange(len(values), dtype=float)
    scaled = scale(coordinate)[0] * values.astype(float)
    finite = scaled[np.isfinite(scaled)]
    if not finite.size:
        return np.zeros(len(values))
    past = finite.max() * 1.3 if _is_long(finite) else finite.max() + 0.2 * max(np.ptp(finite), finite.max() / 3)
    return np.where(np.isfinite(scaled), scaled, past)


def write_ticks(ax: Axes, coordinate: xr.DataArray) -> None:
    """Write words at an axis, or numbers, and the word for infinity: "full" for the full order."""
    x, values = positions(coordinate), coordinate.values
    if not is_numeric(coordinate):
        words = [lengths(coordinate, str(value)) for value in values]
        texts = [textwrap.fill(text, _WORD) for text in words]
        if sum(2 + max(map(len, text.splitlines())) for text in texts) < _LINE:
            ax.set_xticks(x, texts)
        else:
            shown = [textwrap.shorten(text, 2 * _WORD, placeholder="…") for text in words]
            ax.set_xticks(x, shown, rotation=30, ha="right", rotation_mode="anchor")
        ax.set_xlim(-0.5, len(x) - 0.5)
        return
    finite = x[np.isfinite(values)]
    if finite.size and _is_long(finite) and coordinate.name not in _LINEAR:
        log_scale(ax, "x")
    if finite.size == len(x):
        return
    ax.margins(x=0.05)
    ax.update_datalim([(place, 0.0) for place in x], updatey=False)  # of cases without a value, too
    ax.autoscale_view(scaley=False)
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
    ticks = [tick for tick in ax.get_xticks() if low - 1e-9 <= tick <= high] if finite.size else []
    full = x[~np.isfinite(values)][0]
    ticks = [tick for tick in ticks if full - tick > 0.12 * (full - low)]
    ax.set_xticks([*ticks, full], [*(f"{tick:g}" for tick in ticks), write(str(coordinate.name), inf)])


def _is_long(finite: np.ndarray) -> bool:
    return bool(finite.min() > 0 and finite.max() > _LONG * finite.min())
