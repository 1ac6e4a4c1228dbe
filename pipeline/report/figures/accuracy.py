"""Error of F against the time it takes, with the cases that no other one beats in both."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.axis import bounds, log_axis
from pipeline.report.figures.convergence import mark_floor, notes, shown_of
from pipeline.report.figures.dimensions import mesh_dimensions, with_error
from pipeline.report.figures.layout import Layout, Selection, arrange
from pipeline.report.figures.names import Places
from pipeline.report.figures.panels import BARS, Panel, grid, panels
from pipeline.report.figures.style import finish, look
from pipeline.report.figures.text import width_of
from pipeline.report.pareto import front
from pipeline.report.times import spreads, warned
from pipeline.report.words import choices, heading, number, symbol

_MOST_NAMED = 6
_HEIGHT, _BESIDE = 2.7, 0.85  # inches: of a row, and of what is above and below its axes
_SIZE, _LINE = 6.5, 0.1  # of a name: points, and inches from line to line


def accuracy(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The error of F over run time: every case a point, each scene's Pareto front a line, with its meshes named."""
    reference, data = with_error(dataset)
    factor = spreads(dataset, "time_total")
    data["spread"] = xr.ones_like(data["error"]) if factor is None else factor
    meshes = mesh_dimensions(data)
    layout = arrange(data, ("error",), None, flat=meshes)
    figure = grid(layout, ("error",), height=_HEIGHT, share="y")
    times = bounds(shown_of(data["time_total"], layout), 2.0)
    errors = bounds(100 * shown_of(data["error"], layout), 1.6)
    for panel in panels(figure, data, layout, ("error",)):
        log_axis(panel.ax, *times, which="x")
        for position, curve in enumerate(layout.curves):
            _draw_scene(panel.ax, panel.data.sel(curve), position, choices(data, curve))
        _name_meshes(panel, layout, meshes, times, errors)
        panel.ax.set_title(panel.title)
        mark_floor(panel.ax, panel.data)
        if panel.is_last:
            panel.ax.set_xlabel(heading(dataset["time_total"]))
        if panel.is_first:
            panel.ax.set_ylabel(f"$|F/F_{{{reference}}}-1|$ (%)")
    log_axis(figure.axes[0], *errors)
    what = "lines: cases that no other beats in both, without errors that a finer mesh has 1.5 times as large"
    whose = f"those of {choices(data, layout.curves[-1])}" if len(layout.curves) > 1 else "they"
    named = f"{whose} have {', '.join(symbol(data[name]) for name in meshes)} beside them where there is room"
    bars = "" if factor is None else "bars: how far repeats are apart"
    finish(figure, title, notes(reference, data, what, named, bars, layout.note), warned(warning, dataset))
    return figure


def _draw_scene(ax: Axes, scene: xr.Dataset, position: int, label: str) -> None:
    """Draw the cases of one scene, those on its front strong."""
    seconds, error, best = _front(scene)
    factor = _flat(scene)["spread"].values[best]
    style = look(position)
    ax.plot(seconds, error, **style, linestyle="none", alpha=0.35, markeredgewidth=0)
    ax.plot(seconds[best], error[best], **style, label=label or None, drawstyle="steps-post")
    bars = seconds[best] * np.stack([1 - 1 / factor, factor - 1])
    if bars.any():
        ax.errorbar(seconds[best], error[best], xerr=bars, fmt="none", ecolor=style["color"], **BARS)


def _name_meshes(
    panel: Panel, layout: Layout, meshes: list[str], times: tuple[float, float], errors: tuple[float, float]
) -> None:
    """Name meshes on the front of the last scene, first and last before the others, where nothing is covered."""
    size = (panel.width, _HEIGHT - _BESIDE)
    room = Places(*size)

    def inches(values: np.ndarray, limits: tuple[float, float], length: float) -> np.ndarray:
        low, high = np.log(limits)
        known = np.where(values > 0, values, np.nan)
        return np.asarray((np.log(known) - low) / (high - low) * length)

    for curve in layout.curves:
        seconds, error, best = _front(panel.data.sel(curve))
        x, y = inches(seconds, times, size[0]), inches(error, errors, size[1])
        room.take_points(x, y)
        room.take_steps(x[best], y[best])
    scene = panel.data.sel(layout.curves[-1])
    flat, colour, count = _flat(scene), look(len(layout.curves) - 1)["color"], 0
    for i in (*best[:1], *best[:0:-1]):
        words = _name_of({name: flat[name].values[i] for name in meshes}, scene)
        place = room.find(x[i], y[i], width_of(words, _SIZE), _LINE) if np.isfinite(x[i] + y[i]) else None
        if place and count < _MOST_NAMED:
            count += 1
            corner = {"xytext": (place[0] / size[0], place[1] / size[1]), "textcoords": "axes fraction"}
            panel.ax.annotate(words, (seconds[i], error[i]), fontsize=_SIZE, color=colour, **corner)


def _front(scene: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return seconds and errors (%) of the cases of a scene, and which of them no other beats in both."""
    flat = _flat(scene)
    seconds, error = flat["time_total"].values, 100 * flat["error"].values
    return seconds, error, np.asarray(front(seconds, np.where(flat["is_by_chance"].values, np.nan, error)))


def _flat(scene: xr.Dataset) -> xr.Dataset:
    return scene.stack(case=list(scene["error"].dims)) if scene["error"].dims else scene.expand_dims("case")


def _name_of(mesh: Selection, scene: xr.Dataset) -> str:
    """Name a mesh by what is swept; what is outside does not matter to the full order."""
    if mesh.get("epsilon") == np.inf:
        mesh.pop("outside", None)
    return ", ".join(number(scene[name], value) for name, value in mesh.items())
