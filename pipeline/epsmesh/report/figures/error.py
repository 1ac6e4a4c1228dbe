"""Error of F against what is refined, and against what it costs: unknowns and run time."""

import textwrap
from collections.abc import Iterable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.quantities import MESH_DIMENSIONS
from epsmesh.report.figures.curves import BARS, positions, write_ticks
from epsmesh.report.figures.facets import Facets, arrange, main_dimension, with_error
from epsmesh.report.figures.style import LEGEND, QUIET, WIDTH, finish, log_scale, look, new_figure
from epsmesh.report.pareto import front
from epsmesh.report.times import doubtful, spreads
from epsmesh.report.words import at_most, choices, heading, is_numeric

_HEIGHT, _BESIDE = 2.3, 1.6  # inches: of a row, and of what is above and below the panels
_COSTS = ("dofs", "time_total")


def error(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The error of F against what is swept of the mesh, the number of unknowns, and the run time of a case."""
    reference, data = with_error(dataset)
    spread = spreads(dataset, "time_total")
    data = data if spread is None else data.assign(spread=spread)
    facets = _facets(data)
    figure = new_figure(WIDTH + LEGEND, _HEIGHT * len(facets.rows) + _BESIDE)
    axes = figure.subplots(len(facets.rows), 1 + len(_COSTS), squeeze=False, sharex="col", sharey=True)
    for number, (row, shown) in enumerate(zip(axes, facets.rows, strict=True)):
        part = data.sel(facets.at | shown)
        for position, curve in enumerate(facets.curves):
            _draw_curve(row, facets, part.sel(curve), position, choices(data, curve))
        for ax, name in zip(row, (str(facets.x), *_COSTS), strict=True):
            if number == len(facets.rows) - 1:
                ax.set_xlabel(heading(data[name]))
        row[0].set_ylabel(f"distance of F from F_{reference}, %")
        row[1].set_title(textwrap.fill(choices(data, shown), 60))
        write_ticks(row[0], part[facets.x])
    log_scale(axes[0, 0])
    floor = 100 * float(data["exact_bar"].max())
    low, high = axes[0, 0].get_ylim()
    for row, shown in zip(axes, facets.rows, strict=True):
        _mark_floor(row, data.sel(facets.at | shown))
    axes[0, 0].set_ylim(max(low, floor / 10) if floor > 0 else low, high)
    for ax in axes[0, 1:]:
        log_scale(ax, "x")
    bar = at_most(data["exact_bar"])
    parts = [
        f"Distance of F from F_{reference}: lower is better.",
        "Unknowns and run time: the line joins cases that no other case beats in both."
        " Cases that a finer mesh does not confirm, since its error is larger, are left out.",
        f"Grey: below the error bar of F_exact{bar}." if reference == "exact" and np.isfinite(floor) else "",
        "" if spread is None else "Bars: how far repeats are apart.",
        facets.note,
    ]
    finish(figure, title, " ".join(filter(None, [*parts, *doubtful(dataset)])), warning)
    return figure


def error_facets(dataset: xr.Dataset) -> Facets:
    """Return the facets of the figure of errors."""
    return _facets(with_error(dataset)[1])


def _facets(data: xr.Dataset) -> Facets:
    return arrange(data, ("error",), main_dimension(data), most=(7, 1, 3))


def _draw_curve(row: np.ndarray, facets: Facets, line: xr.Dataset, position: int, label: str) -> None:
    """Draw the errors of one curve against the dimension, and against each cost with those on the front joined."""
    known = 100 * np.atleast_1d(line["error"].values)
    if not (known > 0).any():
        return
    style, flat = look(position), line.expand_dims("case") if not line["error"].dims else line
    x = line[facets.x]
    joined = {} if is_numeric(x) and x.size > 1 else {"linestyle": "none"}
    row[0].plot(positions(x), known, label=label or None, **style | joined)
    for ax, name in zip(row[1:], _COSTS, strict=True):
        cost = np.atleast_1d(flat[name].values).astype(float)
        cost = np.where(cost > 0, cost, np.nan)
        best = front(cost, np.where(np.atleast_1d(flat["is_by_chance"].values), np.nan, known))
        ax.plot(cost, known, **style | {"linestyle": "none"})
        if name == "time_total" and "spread" in flat:
            share = np.atleast_1d(flat["spread"].values)[best]
            bars = cost[best] * np.stack([1 - 1 / share, share - 1])
            ax.errorbar(cost[best], known[best], xerr=bars, fmt="none", ecolor=style["color"], **BARS)
        joins = facets.x in MESH_DIMENSIONS
        ax.plot(cost[best], known[best], color=style["color"], drawstyle="steps-post", alpha=1.0 if joins else 0.0)


def _mark_floor(row: Iterable[Axes], data: xr.Dataset) -> None:
    """Shade the errors that the error bar of F_exact does not tell from none."""
    bar = 100 * float(data["exact_bar"].max())
    if np.isfinite(bar) and bar > 0:
        for ax in row:
            ax.axhspan(1e-3 * bar, bar, color=QUIET, alpha=0.18, linewidth=0)
