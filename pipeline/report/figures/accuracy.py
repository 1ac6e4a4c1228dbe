"""Error of F against the time it takes, with the cases that no other one beats in both."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.axis import bounds, log_axis
from pipeline.report.figures.convergence import mark_floor, notes
from pipeline.report.figures.dimensions import mesh_dimensions, with_error
from pipeline.report.figures.layout import Selection, arrange
from pipeline.report.figures.panels import BARS, grid, panels
from pipeline.report.figures.style import PAPER, finish, look
from pipeline.report.pareto import front
from pipeline.report.times import spreads, warned
from pipeline.report.words import choices, heading, number, symbol

_MOST_NAMED = 6
# Share of a panel's height that two names keep apart.
_APART = 0.06
# Inches that a letter of a name takes.
_LETTER = 0.05


def accuracy(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The error of F over run time: every case a point, each scene's Pareto front a line, with its meshes named."""
    reference, data = with_error(dataset)
    factor = spreads(dataset, "time_total")
    data["spread"] = xr.ones_like(data["error"]) if factor is None else factor
    meshes = mesh_dimensions(data)
    layout = arrange(data, ("error",), None, flat=meshes)
    figure = grid(layout, ("error",), height=2.7, share="y")
    for panel in panels(figure, data, layout, ("error",)):
        limits = bounds(panel.data["time_total"].values, 1.4)
        log_axis(panel.ax, *limits, which="x")
        # Names are written left of the points: the first ones need room.
        share = min(_LETTER * _longest(panel.data, meshes) / panel.width, 0.5)
        panel.ax.set_xlim(limits[0] / (limits[1] / limits[0]) ** (share / (1 - share)), limits[1])
        for position, curve in enumerate(layout.curves):
            named = position == len(layout.curves) - 1
            _draw_scene(panel.ax, panel.data.sel(curve), position, choices(data, curve), meshes if named else [])
        panel.ax.set_title(panel.title)
        mark_floor(panel.ax, panel.data)
        if panel.is_last:
            panel.ax.set_xlabel(heading(dataset["time_total"]))
        if panel.is_first:
            panel.ax.set_ylabel(f"$|F/F_{{{reference}}}-1|$ (%)")
    log_axis(figure.axes[0], *bounds(100 * data["error"].values, 1.6))
    what = "lines: cases that no other beats in both, without errors that a finer mesh has 1.5 times as large"
    labels = f"their {', '.join(symbol(data[name]) for name in meshes)} at the points"
    bars = "" if factor is None else "bars: how far repeats are apart"
    finish(figure, title, notes(reference, f"{what}, {labels}", bars, layout.note), warned(warning, dataset))
    return figure


def _draw_scene(ax: Axes, scene: xr.Dataset, position: int, label: str, named: list[str]) -> None:
    """Draw the cases of one scene, those on its front strong, and name the meshes of the front."""
    flat = scene.stack(case=list(scene["error"].dims)) if scene["error"].dims else scene.expand_dims("case")
    seconds, error = flat["time_total"].values, 100 * flat["error"].values
    best = front(seconds, np.where(flat["is_by_chance"].values, np.nan, error))
    style = look(position)
    ax.plot(seconds, error, **style, linestyle="none", alpha=0.35, markeredgewidth=0)
    ax.plot(seconds[best], error[best], **style, label=label or None, drawstyle="steps-post")
    factor = flat["spread"].values[best]
    bars = seconds[best] * np.stack([1 - 1 / factor, factor - 1])
    if bars.any():
        ax.errorbar(seconds[best], error[best], xerr=bars, fmt="none", ecolor=style["color"], **BARS)
    for i in _some(best, error):
        words = _name_of({name: flat[name].values[i] for name in named}, scene)
        place = {"xytext": (-4, -3), "textcoords": "offset points", "ha": "right", "va": "top"}
        ground = {"facecolor": PAPER, "alpha": 0.75, "linewidth": 0, "pad": 0.6}
        ax.annotate(words, (seconds[i], error[i]), fontsize=6.5, color=style["color"], bbox=ground, **place)


def _name_of(mesh: Selection, scene: xr.Dataset) -> str:
    """Name a mesh by what is swept; what is outside does not matter to the full order."""
    if mesh.get("epsilon") == np.inf:
        mesh.pop("outside", None)
    return ", ".join(number(scene[name], value) for name, value in mesh.items())


def _longest(data: xr.Dataset, meshes: list[str]) -> int:
    """Return how many letters the longest name of a mesh has."""
    return sum(2 + max(len(number(data[name], value)) for value in data[name].values) for name in meshes)


def _some(best: np.ndarray, error: np.ndarray) -> list[int]:
    """Return the cases of a front whose names do not cover one another, first and last before the others."""
    height = np.log10(np.where(error > 0, error, np.nan))
    span = float(np.nanmax(height) - np.nanmin(height)) if np.isfinite(height).any() else 0.0
    chosen: list[int] = []
    for i in (*best[:1], *best[:0:-1]):
        if all(abs(height[i] - height[j]) > _APART * span for j in chosen):
            chosen.append(int(i))
    return chosen[:_MOST_NAMED]
