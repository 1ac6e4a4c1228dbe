"""Maps over a raster of places: of the force and its error bar, and of its excess over that on a healthy body."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, FixedLocator, Locator

from epsmesh.report.figures.facets import arrange
from epsmesh.report.figures.style import CLAIM, FAILED, LINE, finish, look, new_figure
from epsmesh.report.words import choices, heading, scale
from epsmesh.states import FAILURES, NO_CONTACT, OK, PENDING, SKIPPED

PLACES = ("x", "y")
_MOST_PANELS = 3
_COLOURS = "cividis"
_PANEL = 3.0  # inches: the width of a panel
# Letters of labels that have room below a panel.
_LETTERS = 30


def force_map(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force (mN) seen from above, and its error bar (mN); a column for each value of one other quantity.

    Places without contact have a ring, those without a force a cross.
    """
    facets = arrange(dataset, ("force",), None, flat=PLACES, most=(_MOST_PANELS, 1, 1))
    parts = [dataset.sel(facets.at | curve).transpose("y", "x", ...) for curve in facets.curves]
    titles = [choices(dataset, curve) for curve in facets.curves]
    width, height = (float(np.ptp(dataset[name].values)) for name in PLACES)
    panel = _PANEL * min(1.0, max(0.4, height / width))
    figure = new_figure(_PANEL * len(parts) + 1.2, 2 * panel + 1.3)
    axes = figure.subplots(2, len(parts), squeeze=False, sharex=True, sharey=True)
    for row, (name, label) in enumerate((("force", heading(dataset["force"])), ("force_error", "error bar of F, mN"))):
        # Zero where there is no contact would leave no colours for the others.
        maps = [1e3 * part[name].where(part["status"] == "ok").values for part in parts]
        known = np.concatenate([values[np.isfinite(values)] for values in maps])
        limits = {"vmin": known.min(), "vmax": known.max()} if known.size else {}
        for column, (ax, values) in enumerate(zip(axes[row], maps, strict=True)):
            drawn = draw_map(ax, parts[column], values, **limits)
            ax.set_title(titles[column] if row == 0 else "")
            ax.set_xlabel(heading(dataset["x"]) if row == 1 else "")
            ax.set_ylabel(heading(dataset["y"]) if column == 0 else "")
        figure.colorbar(drawn, ax=axes[row].tolist(), label=label)
    tells = "The force at each place, seen from above, and below it its 95\N{NO-BREAK SPACE}% error bar."
    finish(figure, title, " ".join(filter(None, (tells, facets.note))), warning)
    return figure


def draw_map(ax: Axes, part: xr.Dataset, values: np.ndarray, **look: Any) -> Any:
    """Draw ``values`` (y, x) over the raster of ``part`` (mm) and mark where there is none; return what has colours."""
    ax.grid(visible=False)
    factor = scale(part["x"])[0]
    x, y = (factor * part[name].values for name in PLACES)
    drawn = ax.pcolormesh(x, y, np.ma.masked_invalid(values), shading="nearest", **{"cmap": _COLOURS} | look)
    for state, marker, colour, label in (
        ([NO_CONTACT], "o", LINE, "no contact"),
        ([*FAILURES, SKIPPED, PENDING], "x", FAILED, "no force"),
    ):
        rows, columns = np.nonzero(np.isin(part["status"].values.astype(str), state))
        if rows.size:
            style = {"marker": marker, "color": colour, "linestyle": "none", "fillstyle": "none", "markersize": 4}
            ax.plot(x[columns], y[rows], label=label, **style)
    ax.xaxis.set_major_locator(_labels_of(x))
    ax.yaxis.set_major_locator(_labels_of(y))
    ax.set_aspect("equal")
    return drawn


def draw_excess(ax: Axes, excess: xr.DataArray, bar: xr.DataArray, point: tuple[float, float, float]) -> Any:
    """Draw the ``excess`` (%) on ``ax``: a map of a raster, with a dot where it is beyond its ``bar``, or a curve.

    ``point`` (m) is marked. Return what has colours, None of a curve.
    """
    if excess.ndim == 1:
        (dim,) = excess.dims
        ax.errorbar(1e3 * excess[dim], 100 * excess, 100 * bar, capsize=2, elinewidth=0.8, **look(1))
        ax.axhline(0.0, color=LINE, linewidth=0.7)
        ax.set_xlabel("length along the path, mm")
        ax.set_ylabel("excess of F, %")
        return None
    seen = excess.transpose("y", "x")
    beyond = (excess > bar).transpose("y", "x")
    status = xr.where(np.isfinite(seen), OK, FAILURES[0]).rename("status")
    drawn = draw_map(ax, xr.Dataset({"status": status}), 100 * seen.values)
    rows, columns = np.nonzero(beyond.values)
    x, y = 1e3 * seen["x"].values, 1e3 * seen["y"].values
    ax.plot(x[columns], y[rows], ".", color="white", markersize=3, label="beyond the error bars")
    ax.plot(1e3 * point[0], 1e3 * point[1], "+", color=CLAIM, markersize=12, markeredgewidth=2, label="centre")
    ax.set_xlabel("position x, mm")
    ax.set_ylabel("position y, mm")
    return drawn


def _labels_of(values: np.ndarray) -> Locator:
    """Return where an axis is labelled: at the values if these have room below a panel, otherwise at round numbers."""
    letters = len(values) * max(len(f"{value:.4g}") for value in values)
    return FixedLocator(values) if letters <= _LETTERS else AutoLocator()
