"""The force over a raster of places: a map, and below it the map of its error bar."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.facets import arrange
from pipeline.report.figures.style import FAILED, LINE, finish, new_figure
from pipeline.report.words import choices, heading, scale

PLACES = ("x", "y")
_MOST_PANELS = 3
_COLOURS = "cividis"
_PANEL = 3.0  # inches: the width of a panel


def force_map(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force (mN) seen from above, and its error bar (mN); a column for each value of one other quantity.

    Places where contact is lost have a ring, those without a force a cross.
    """
    facets = arrange(dataset, ("force",), None, flat=PLACES, most=(_MOST_PANELS, 1, 1))
    parts = [dataset.sel(facets.at | curve).transpose("y", "x", ...) for curve in facets.curves]
    titles = [choices(dataset, curve) for curve in facets.curves]
    (width, height), rows = _extent(dataset), (_forces(parts), _bars(parts))
    panel = _PANEL * min(1.0, max(0.4, height / width))
    figure = new_figure(_PANEL * len(parts) + 1.2, 2 * panel + 1.3)
    axes = figure.subplots(2, len(parts), squeeze=False, sharex=True, sharey=True)
    for row, (maps, label) in enumerate(zip(rows, (heading(dataset["force"]), "its error bar, mN"), strict=True)):
        known = np.concatenate([values[np.isfinite(values)] for values in maps])
        limits = {"vmin": known.min(), "vmax": known.max()} if known.size else {}
        for column, (ax, values) in enumerate(zip(axes[row], maps, strict=True)):
            drawn = draw_map(ax, parts[column], values, **limits)
            ax.set_title(titles[column] if row == 0 else "")
            ax.set_xlabel(heading(dataset["x"]) if row == 1 else "")
            ax.set_ylabel(heading(dataset["y"]) if column == 0 else "")
        figure.colorbar(drawn, ax=axes[row].tolist(), label=label)
    finish(figure, title, f"seen from above; bars: 95 %{f'; {facets.note}' if facets.note else ''}", warning)
    return figure


def draw_map(ax: Axes, part: xr.Dataset, values: np.ndarray, **look: Any) -> Any:
    """Draw ``values`` (y, x) over the raster of ``part`` (mm) and mark where there is none; return what has colours."""
    ax.grid(visible=False)
    factor = scale(part["x"])[0]
    x, y = (factor * part[name].values for name in PLACES)
    drawn = ax.pcolormesh(x, y, np.ma.masked_invalid(values), shading="nearest", **{"cmap": _COLOURS} | look)
    for state, marker, colour, label in (
        (["lost"], "o", LINE, "contact lost"),
        (["failed", "skipped", "pending"], "x", FAILED, "no force"),
    ):
        rows, columns = np.nonzero(np.isin(part["status"].values.astype(str), state))
        if rows.size:
            style = {"marker": marker, "color": colour, "linestyle": "none", "fillstyle": "none", "markersize": 4}
            ax.plot(x[columns], y[rows], label=label, **style)
    ax.set_xticks(_some(x))
    ax.set_yticks(_some(y))
    ax.set_aspect("equal")
    return drawn


def _forces(parts: list[xr.Dataset]) -> list[np.ndarray]:
    """Return the forces (mN), none where contact is lost: zero would leave no colours for the others."""
    return [1e3 * part["force"].where(part["status"] == "ok").values for part in parts]


def _bars(parts: list[xr.Dataset]) -> list[np.ndarray]:
    return [1e3 * (part["force_error"] * part["force"]).where(part["status"] == "ok").values for part in parts]


def _extent(dataset: xr.Dataset) -> tuple[float, float]:
    x, y = (float(np.ptp(dataset[name].values)) for name in PLACES)
    return x, y


def _some(values: np.ndarray, most: int = 7) -> np.ndarray:
    """Return the values that are written at an axis, first and last among them."""
    chosen = np.unique(np.linspace(0, len(values) - 1, min(most, len(values))).round().astype(int))
    return np.asarray(values[chosen])
