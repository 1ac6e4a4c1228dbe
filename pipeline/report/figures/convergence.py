"""How the error of F falls, and what it costs."""

from collections.abc import Iterable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.axis import bounds, log_axis
from pipeline.report.figures.dimensions import main_dimension, refinements, with_error
from pipeline.report.figures.layout import Layout, arrange
from pipeline.report.figures.panels import Panel, draw_curves, draw_signed, grid, panels
from pipeline.report.figures.style import QUIET, finish, look
from pipeline.report.words import at_most, heading

_QUANTITIES = ("error", "dofs")


def convergence(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The error of F over what is refined, and below it over the number of unknowns."""
    reference, data = with_error(dataset)
    layout = _layout(data)
    figure = grid(layout, _QUANTITIES, height=2.0, share="y")
    unknowns = bounds(shown_of(data["dofs"], layout))
    for panel in panels(figure, data, layout, _QUANTITIES):
        if panel.quantity == "dofs":
            _over_unknowns(panel, layout, unknowns)
        else:
            draw_curves(panel, layout, factor=100.0).finish(panel.ax, panel.width)
        mark_floor(panel.ax, panel.data)
        if panel.is_first:
            panel.ax.set_ylabel(f"$|F/F_{{{reference}}}-1|$ (%)")
    log_axis(figure.axes[0], *bounds(100 * shown_of(data["error"], layout)))
    crossing = f"hollow: F below F_{reference}, dotted where it passes that" if data["is_below"].any() else ""
    finish(figure, title, notes(reference, data, crossing, layout.note), warning)
    return figure


def convergence_layout(dataset: xr.Dataset) -> Layout:
    """Return what the figure of errors shows."""
    return _layout(with_error(dataset)[1])


def _layout(data: xr.Dataset) -> Layout:
    return arrange(data, ("error",), next(iter(refinements(data)), main_dimension(data)))


def mark_floor(ax: Axes, data: xr.Dataset) -> None:
    """Shade the errors that the error bar of F_exact does not tell from none."""
    bar = 100 * float(data["force_exact_error"].max())
    if np.isfinite(bar) and bar > 0:
        ax.axhspan(0, bar, color=QUIET, alpha=0.18, linewidth=0)


def notes(reference: str, data: xr.Dataset, *others: str) -> str:
    """Return the notes below a figure of errors."""
    bar = at_most(data["force_exact_error"])
    floor = f"grey: below the error bar of F_exact{bar}" if reference == "exact" else "no F_exact: errors against F_max"
    return "; ".join(filter(None, (floor, *others)))


def _over_unknowns(panel: Panel, layout: Layout, limits: tuple[float, float]) -> None:
    for position, curve in enumerate(layout.curves):
        line = panel.data.sel(curve)
        x, y = np.atleast_1d(line["dofs"].values), 100 * np.atleast_1d(line["error"].values)
        known = np.flatnonzero((x > 0) & np.isfinite(y))
        known = known[np.argsort(x[known], kind="stable")]
        below = np.atleast_1d(line["is_below"].values)[known]
        draw_signed(panel.ax, x[known], y[known], below, None, look(position))
    log_axis(panel.ax, *limits, which="x")
    panel.ax.set_xlabel(heading(panel.data["dofs"]))


def shown_of(array: xr.DataArray, layout: Layout) -> np.ndarray:
    """Return the values of ``array`` that the panels of a layout show."""
    parts: Iterable[xr.DataArray] = (
        array.sel({name: value for name, value in (layout.at | row | column | curve).items() if name in array.dims})
        for row in layout.rows for column in layout.columns for curve in layout.curves
    )  # fmt: skip
    return np.concatenate([np.ravel(part.values) for part in parts])
