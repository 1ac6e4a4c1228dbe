"""Maps over a raster of places: of the force and its error bar, and of its excess over that on a healthy body."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from epsmesh.arrays import FloatArray
from epsmesh.report.figures.facets import arrange
from epsmesh.report.figures.style import CLAIM, FAILED, LINE, finish, look, new_figure
from epsmesh.report.study import study_of
from epsmesh.report.words import choices, heading, scale
from epsmesh.shapes.facetted import Facetted
from epsmesh.shapes.triangles import closed_edges, doubled_normals
from epsmesh.states import FAILURES, NO_CONTACT, OK, PENDING, SKIPPED

PLACES = ("x", "y")
_MOST_PANELS = 3
_COLOURS = "cividis"
_WHOLE = {"edgecolors": "face", "linewidth": 0.4}  # else gaps between cells are seen in a page
_PANEL, _BESIDE = 3.4, 0.8  # inches: the width of a panel, and the height of the scale below it and its texts
# Beside the outline, as a share of the map.
_ROOM = 0.03


def force_map(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force (mN) seen from above, and its error bar (mN); a column for each value of one other quantity.

    Places without contact have a ring, those without a force a cross; the line is the outline of the body.
    """
    outline = _outline(dataset)
    facets = arrange(dataset, ("force",), None, flat=PLACES, most=(_MOST_PANELS, 1, 1))
    parts = [dataset.sel(facets.at | curve).transpose("y", "x", ...) for curve in facets.curves]
    titles = [choices(dataset, curve) for curve in facets.curves]
    figure = new_figure(_PANEL * len(parts) + 0.6, 2 * _PANEL)
    axes = figure.subplots(2, len(parts), squeeze=False, sharex=True, sharey=True)
    for row, (name, label) in enumerate((("force", heading(dataset["force"])), ("force_error", "error bar of F, mN"))):
        # Zero where there is no contact would leave no colours for the others.
        maps = [1e3 * part[name].where(part["status"] == "ok").values for part in parts]
        known = np.concatenate([values[np.isfinite(values)] for values in maps])
        limits = {"vmin": known.min(), "vmax": known.max()} if known.size else {}
        for column, (ax, values) in enumerate(zip(axes[row], maps, strict=True)):
            drawn = draw_map(ax, parts[column], values, **limits)
            _draw_outline(ax, outline)
            ax.set_title(titles[column] if row == 0 else "")
            ax.set_xlabel(heading(dataset["x"]) if row == 1 else "")
            ax.set_ylabel(heading(dataset["y"], short=column > 0))
            # On a phone a column is alone.
            ax.tick_params(labelleft=True)
            figure.colorbar(drawn, ax=ax, label=label, location="bottom", aspect=30)
    width, height = (float(np.ptp(ends)) for ends in (ax.get_xlim(), ax.get_ylim()))
    figure.set_figheight(2 * (_PANEL * min(1.2, max(0.4, height / width)) + _BESIDE))
    tells = "The force at each place, seen from above, and below it its 95\N{NO-BREAK SPACE}% error bar."
    finish(figure, title, " ".join(filter(None, (tells, facets.note))), warning)
    return figure


def draw_map(ax: Axes, part: xr.Dataset, values: np.ndarray, **look: Any) -> Any:
    """Draw ``values`` (y, x) over the raster of ``part`` (mm) and mark where there is none; return what has colours."""
    ax.grid(visible=False)
    factor = scale(part["x"])[0]
    x, y = (factor * part[name].values for name in PLACES)
    drawn = ax.pcolormesh(x, y, np.ma.masked_invalid(values), shading="nearest", **{"cmap": _COLOURS} | _WHOLE | look)
    for state, marker, colour, label in (
        ([NO_CONTACT], "o", LINE, "no contact"),
        ([*FAILURES, SKIPPED, PENDING], "x", FAILED, "no force"),
    ):
        rows, columns = np.nonzero(np.isin(part["status"].values.astype(str), state))
        if rows.size:
            style = {"marker": marker, "color": colour, "linestyle": "none", "fillstyle": "none", "markersize": 4}
            ax.plot(x[columns], y[rows], label=label, **style)
    ax.set_aspect("equal")
    return drawn


def _outline(dataset: xr.Dataset) -> FloatArray:
    """Return the outline of the body seen from above: lines (n, 2, 2), in mm; none where the study cannot be read."""
    study = study_of(dataset)
    body = next(iter(study.cases())).body if study else None
    if body is None:
        return np.empty((0, 2, 2))
    if isinstance(body, Facetted):
        points, facets = body.triangles.points, body.triangles.facets
        edges, owners = closed_edges(facets)
        is_above = doubled_normals(points, facets)[:, 2] > 0
        return 1e3 * points[edges[np.diff(is_above[owners])[:, 0]], :2]
    places = np.vstack(body.outline())[:, :2]
    return 1e3 * places[ConvexHull(places).simplices]


def _draw_outline(ax: Axes, outline: FloatArray) -> None:
    """Draw lines beside a map, as far away as the map is large."""
    if not len(outline):
        return
    ax.add_collection(LineCollection(list(outline), colors=LINE, linewidths=0.8), autolim=False)
    for which, places in (("x", outline[..., 0]), ("y", outline[..., 1])):
        low, high = getattr(ax, f"get_{which}lim")()
        room = _ROOM * (high - low)
        least, most = places.min() - room, places.max() + room
        getattr(ax, f"set_{which}lim")(max(least, low - (high - low)), min(most, high + (high - low)))


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
