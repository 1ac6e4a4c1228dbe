"""A grid of panels: a curve for each choice, an axis that all share."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.axis import Horizontal, horizontal
from pipeline.report.figures.layout import Layout, title_of
from pipeline.report.figures.style import FAILED, PANEL_HEIGHT, PAPER, WIDTH, look, new_figure
from pipeline.report.figures.text import wrapped
from pipeline.report.words import choices

# How bars of errors and of repeats look.
BARS = {"capsize": 2, "elinewidth": 0.8}
# Of a panel's title: points, lines, and the inches by which it may be wider than the panel.
_TITLE, _TITLE_LINES, _BESIDE = 8.0, 4, 0.1


@dataclass(frozen=True)
class Panel:
    """One panel: its axes, the part of the dataset it shows, which quantity, and where in the grid it is."""

    ax: Axes
    data: xr.Dataset
    quantity: str
    title: str
    width: float
    column: int
    is_last: bool

    @property
    def is_first(self) -> bool:
        """Whether it is the first of its row."""
        return self.column == 0


def grid(layout: Layout, quantities: Sequence[str], height: float = PANEL_HEIGHT, share: str = "x") -> Figure:
    """Return a figure with room for every row, column and quantity of ``layout``, whose panels ``share`` x or y."""
    rows, columns = len(layout.rows) * len(quantities), len(layout.columns)
    figure = new_figure(_width(columns), height * rows + 1.0 + (0.5 if rows == 1 else 0.0))
    figure.subplots(rows, columns, squeeze=False, sharex=share == "x", sharey=share == "y")
    return figure


def panels(figure: Figure, dataset: xr.Dataset, layout: Layout, quantities: Sequence[str]) -> Iterator[Panel]:
    """Yield the panels of a figure made by :func:`grid`, row by row."""
    columns = len(layout.columns)
    width = _width(columns) / columns - 0.55
    for number, ax in enumerate(figure.axes):
        line, column = divmod(number, columns)
        row, quantity = divmod(line, len(quantities))
        choice = layout.rows[row] | layout.columns[column]
        title = title_of(dataset, layout.rows[row], layout.columns[column]) if quantity == 0 else ""
        title = wrapped(title, width + _BESIDE, _TITLE, most=_TITLE_LINES)
        last = line == len(figure.axes) // columns - 1
        yield Panel(ax, dataset.sel(layout.at | choice), quantities[quantity], title, width, column, last)


def share_heights(shown: Iterable[Panel], group: Callable[[Panel], Hashable]) -> None:
    """Give the panels of a ``group`` one scale, that holds the curves of all."""
    together = defaultdict(list)
    for panel in shown:
        together[group(panel)].append(panel.ax)
    for axes in together.values():
        limits = np.array([ax.get_ylim() for ax in axes])
        for ax in axes:
            ax.set_ylim(limits[:, 0].min(), limits[:, 1].max())


def share_columns(shown: Iterable[Panel], layout: Layout) -> None:
    """Give panels one scale: all of them or, where columns are what becomes of the outside, those of each column."""
    by_column = any("outside" in column for column in layout.columns)
    share_heights(shown, lambda panel: (panel.quantity, panel.column if by_column else 0))


def draw_curves(panel: Panel, layout: Layout, factor: float = 1.0, errors: str = "") -> Horizontal:
    """Draw the panel's quantity, times ``factor``, against the layout's dimension, with bars of relative ``errors``."""
    assert layout.x is not None
    axis = horizontal(panel.data[layout.x])
    for position, curve in enumerate(layout.curves):
        line = panel.data.sel(curve)
        y = line[panel.quantity].values * factor
        known = np.isfinite(y)
        shown = np.where(known, y, np.nan)  # a line does not go over a case that has no value
        style = look(position) | ({} if axis.joins and len(axis.positions) > 1 else {"linestyle": "none"})
        label = choices(panel.data, curve) if known.any() else None
        x = axis.positions + _aside(axis, position, len(layout.curves))
        if errors and known.any():  # of a curve without a value matplotlib's bars warn
            bars = np.nan_to_num(np.abs(y * line[errors].values))
            panel.ax.errorbar(x, shown, bars, label=label, **BARS, **style)
        elif not errors and "is_below" in line:
            draw_signed(panel.ax, x, shown, line["is_below"].values, label, style)
        else:
            panel.ax.plot(x, shown, label=label, **style)
        failed = line["status"].values == "failed"
        if failed.any():
            place = {"transform": panel.ax.get_xaxis_transform(), "zorder": 6}
            panel.ax.plot(x[failed], np.full(failed.sum(), 0.04), "x", color=FAILED, markersize=5, **place)
    if panel.title:
        panel.ax.set_title(panel.title)
    axis.finish(panel.ax, panel.width, last=panel.is_last)
    return axis


def draw_spread(panel: Panel, layout: Layout) -> None:
    """Draw, over the curves of a quantity, bars that reach above and below it by the factor ``spread``."""
    axis = horizontal(panel.data[layout.x])
    for position, curve in enumerate(layout.curves):
        line = panel.data.sel(curve)
        y, factor = line[panel.quantity].values, line["spread"].values
        x = axis.positions + _aside(axis, position, len(layout.curves))
        bars = np.abs(np.stack([y / factor - y, y * factor - y]))
        known = np.isfinite(y) & (bars.max(axis=0) > 0)
        panel.ax.errorbar(x[known], y[known], bars[:, known], fmt="none", ecolor=look(position)["color"], **BARS)


def draw_signed(
    ax: Axes, x: np.ndarray, y: np.ndarray, is_below: np.ndarray, label: str | None, style: dict[str, str]
) -> None:
    """Draw sizes of errors, hollow where F ``is_below`` what it is to be, and dotted where it passes that."""
    ax.plot(x, np.where(is_below, np.nan, y), label=label, **style)
    ax.plot(x, np.where(is_below, y, np.nan), **style, markerfacecolor=PAPER)
    if style.get("linestyle") != "none":
        for i in np.flatnonzero(is_below[1:] != is_below[:-1]):
            ax.plot(x[i : i + 2], y[i : i + 2], color=style["color"], linestyle=":", linewidth=0.8, zorder=1)


def _aside(axis: Horizontal, position: int, count: int) -> float:
    """Return how far beside a word its points stand, so that they do not hide one another; a number's stand on it."""
    return 0.0 if axis.joins or count < 2 else 0.3 * (position / (count - 1) - 0.5)


def _width(columns: int) -> float:
    return max(WIDTH * columns / 3, 4.4)
