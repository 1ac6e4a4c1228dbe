"""The figure of a study, drawn from its dataset alone: F/F_max and speed-up against ε."""

import itertools
import os
from collections.abc import Iterator, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# The paper's claims: 80 % of F_max at ε = 10 mm, 50 times faster.
CLAIM_EPSILON, CLAIM_RATIO, CLAIM_SPEEDUP = 10e-3, 0.8, 50.0

_WIDTH, _PANEL_HEIGHT = 7.1, 1.75  # inches: the width of a page's text
# From dark to light, told apart by the colour-blind and in grey; markers tell them apart as well.
COLOURS = ("#00204d", "#1f5fa8", "#2a9d8f", "#c98a00", "#b0413e", "#7b5ea7", "#777777")
MARKERS = "osD^vPX"
_CLAIM = "#d81b60"
STYLE = {"font.size": 8, "axes.titlesize": 8, "legend.fontsize": 7.5, "svg.fonttype": "none", "axes.grid": True,
          "grid.linewidth": 0.4, "grid.color": "#dddddd", "lines.linewidth": 1.2, "lines.markersize": 3.5}  # fmt: skip
# Display units: factor and unit of coordinates that people do not read in SI.
_DISPLAY = {"m": (1e3, "mm"), "Pa": (1e-3, "kPa")}
_SYMBOLS = {"epsilon": "ε", "poisson": "ν", "young": "E"}


def draw(dataset: xr.Dataset, stem: Path, formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw the figure of ``dataset`` into ``<stem>.png`` and ``<stem>.svg``; return the files written."""
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context(STYLE):
        figure = _figure(dataset)
        return [save(figure, stem.with_name(f"{stem.name}.{kind}")) for kind in formats]


def save(figure: Figure, path: Path) -> Path:
    """Write ``figure`` to ``path``, in place of an earlier one only once it is whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        figure.savefig(temporary, dpi=200)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def _figure(dataset: xr.Dataset) -> Figure:
    if "epsilon" in dataset.dims and bool(np.isfinite(dataset["force_ratio"]).any()):
        figure = _against_epsilon(dataset)
    else:
        figure = _forces(dataset)
    figure.suptitle(dataset.attrs.get("title", ""), fontsize=9.5, fontweight="bold")
    failed = int((dataset["status"] == "failed").sum())
    pending = int((dataset["status"] == "pending").sum())
    if failed or pending:
        words = [f"{n} {word}" for n, word in ((failed, "failed"), (pending, "not yet run")) if n]
        figure.text(0.995, 0.005, f"cases: {', '.join(words)}", ha="right", va="bottom", fontsize=7, color="#b0413e")
    return figure


# ---- against ε --------------------------------------------------------------------------------------


def _against_epsilon(dataset: xr.Dataset) -> Figure:
    """One column a value of ``outside``; for each other panel, a row of F/F_max and a row of speed-up."""
    curves = _curve_dimension(dataset, besides="epsilon")
    columns = "outside" if "outside" in dataset.dims else None
    row_dims = [d for d in dataset["force"].dims if d not in ("epsilon", curves, columns)]
    rows = list(_panels(dataset, row_dims))
    across = list(_panels(dataset, [columns] if columns else []))
    figure = Figure(
        figsize=(max(_WIDTH * len(across) / 3, 4.2), 2 * _PANEL_HEIGHT * len(rows) + 1.0), layout="constrained"
    )
    FigureCanvasAgg(figure)
    axes = figure.subplots(2 * len(rows), len(across), squeeze=False, sharex=True)
    for (i, (row, row_name)), (j, (column, column_name)) in itertools.product(enumerate(rows), enumerate(across)):
        panel = dataset.sel(row | column)
        name = ", ".join(part for part in (row_name, column_name) if part)
        _draw_panel(axes[2 * i, j], panel, "force_ratio", curves)
        _draw_panel(axes[2 * i + 1, j], panel, "speedup", curves)
        axes[2 * i, j].set_title(name)
    for i, j in np.ndindex(axes.shape):
        _finish_panel(axes[i, j], dataset, is_ratio=i % 2 == 0, first=j == 0, last=i == axes.shape[0] - 1)
    _legend(figure, axes[0, 0])
    return figure


def _draw_panel(ax: Axes, panel: xr.Dataset, variable: str, curves: str | None) -> None:
    """Draw one quantity against ε, a curve for each value of the dimension ``curves``."""
    x = _positions(panel["epsilon"].values)
    for number, (choice, label) in enumerate(_panels(panel, [curves] if curves else [])):
        y = panel[variable].sel(choice).values
        style = {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number % len(MARKERS)]}
        ax.plot(x, y, label=label, **style)


def _finish_panel(ax: Axes, dataset: xr.Dataset, *, is_ratio: bool, first: bool, last: bool) -> None:
    epsilon = dataset["epsilon"].values
    x = _positions(epsilon)
    ticks = _ticks(epsilon)
    ax.set_xticks([position for position, _ in ticks], [label for _, label in ticks])
    ax.set_xlim(x.min() - 0.04 * np.ptp(x) - 1e-9, x.max() + 0.04 * np.ptp(x) + 1e-9)
    if is_ratio:
        _mark_ratio(ax, x)
    else:
        _mark_speedup(ax, first=first)
    if first:
        ax.set_ylabel("$F/F_{max}$" if is_ratio else "speed-up $t_{full}/t$")
    if last:
        ax.set_xlabel("ε-mesh radius ε (mm)")


def _mark_ratio(ax: Axes, x: np.ndarray) -> None:
    """Mark F = F_max, and the paper's 80 % at 10 mm."""
    ax.axhline(1.0, color="black", linewidth=0.7)
    low, high = ax.get_ylim()
    if high > 3:
        _log_axis(ax, min(0.7, low), high)
    else:
        low, high = min(low, CLAIM_RATIO), max(high, 1.02)
        ax.set_ylim(low - 0.1 * (high - low), high)
    if x.min() <= 1e3 * CLAIM_EPSILON <= x.max():
        star = {"marker": "*", "markersize": 9, "markeredgecolor": "white", "markeredgewidth": 0.5, "linestyle": "none"}
        point = (1e3 * CLAIM_EPSILON, CLAIM_RATIO)
        ax.plot(*point, color=_CLAIM, zorder=5, **star)
        place = {"xytext": (6, -2), "textcoords": "offset points", "va": "center"}
        ax.annotate("paper: 80 %", point, color=_CLAIM, fontsize=7, zorder=5, **place)


def _mark_speedup(ax: Axes, *, first: bool) -> None:
    """Mark the paper's 50-fold speed-up where the curves come near it."""
    ax.set_yscale("log")
    low, high = ax.get_ylim()
    if high > CLAIM_SPEEDUP / 3:
        high = max(high, 1.6 * CLAIM_SPEEDUP)
        ax.axhline(CLAIM_SPEEDUP, color=_CLAIM, linewidth=0.8, linestyle=":")
        if first:
            place = {"xytext": (-2, 2), "textcoords": "offset points", "ha": "right"}
            spot = (1, CLAIM_SPEEDUP)
            ax.annotate("paper: 50 ×", spot, xycoords=("axes fraction", "data"), color=_CLAIM, fontsize=7, **place)
    _log_axis(ax, low, high)


def _log_axis(ax: Axes, low: float, high: float) -> None:
    """Make the vertical axis logarithmic, with round numbers written out."""
    ax.set_yscale("log")
    low = max(low, 1e-3)
    ticks = [m * 10.0**e for e in range(-3, 7) for m in (1, 2, 5) if low / 1.05 <= m * 10.0**e <= 1.05 * high]
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_yticks([], minor=True)
    ax.set_ylim(low, high)


def _positions(epsilon: np.ndarray) -> np.ndarray:
    """Return ε in mm, with full order a step past the largest."""
    finite = 1e3 * epsilon[np.isfinite(epsilon)]
    if not finite.size:
        return np.zeros(epsilon.shape)
    step = 0.2 * max(np.ptp(finite), finite.max() / 3)
    return np.where(np.isfinite(epsilon), 1e3 * epsilon, finite.max() + step)


def _ticks(epsilon: np.ndarray) -> list[tuple[float, str]]:
    """Label the values themselves, as many as fit, and full order always."""
    x = _positions(epsilon)
    ticks: list[tuple[float, str]] = []
    for position, value in sorted(zip(x, epsilon, strict=True), reverse=True):
        text = "full" if value == inf else f"{1e3 * value:g}"
        if not ticks or ticks[-1][0] - position > 0.085 * np.ptp(x):
            ticks.append((float(position), text))
    return ticks[::-1]


# ---- without ε --------------------------------------------------------------------------------------


def _forces(dataset: xr.Dataset) -> Figure:
    """Draw the force against the first numeric dimension, or case by case where there is none."""
    force = dataset["force"] * 1e3
    figure = Figure(figsize=(4.8, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    numeric = next((str(d) for d in force.dims if _is_numeric(dataset[d])), None)
    others = [d for d in force.dims if d != numeric]
    for number, (choice, label) in enumerate(_panels(dataset, others)):
        line = force.sel(choice)
        style = {"color": COLOURS[number % len(COLOURS)], "marker": MARKERS[number % len(MARKERS)]}
        if numeric:
            finite = np.where(np.isfinite(line[numeric]), line[numeric], np.nan)
            ax.plot(finite * _scale(dataset[numeric])[0], line.values, label=label, **style)
        else:
            ax.plot([label or "force"], [float(line)], linestyle="none", **style)
    if numeric:
        ax.set_xlabel(_axis_label(dataset[numeric]))
        if others:
            _legend(figure, ax)
    ax.set_ylabel("reaction force F (mN)")
    ax.set_ylim(bottom=0)
    return figure


# ---- words ------------------------------------------------------------------------------------------


def _panels(dataset: xr.Dataset, dims: Sequence[Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield every combination of the labels of ``dims``, with the words for it."""
    for labels in itertools.product(*(dataset[d].values for d in dims)):
        choice = dict(zip(dims, labels, strict=True))
        yield choice, ", ".join(_words(dataset[d], value) for d, value in choice.items())


def _words(coordinate: xr.DataArray, value: Any) -> str:
    if isinstance(value, str):
        return f"outside {value}" if coordinate.name == "outside" else str(value)
    factor, unit = _scale(coordinate)
    number = "full" if value == inf else f"{value * factor:g}"
    return f"{_SYMBOLS.get(str(coordinate.name), coordinate.name)} = {number} {unit}".rstrip()


def _axis_label(coordinate: xr.DataArray) -> str:
    unit = _scale(coordinate)[1]
    text = str(coordinate.attrs.get("long_name", coordinate.name))
    return f"{text} ({unit})" if unit else text


def _scale(coordinate: xr.DataArray) -> tuple[float, str]:
    return _DISPLAY.get(coordinate.attrs.get("units", ""), (1.0, ""))


def _is_numeric(coordinate: xr.DataArray) -> bool:
    return bool(np.issubdtype(coordinate.dtype, np.number))


def _curve_dimension(dataset: xr.Dataset, besides: str) -> str | None:
    """Return the dimension that becomes curves: Poisson's ratio, else the first other numeric one."""
    dims = [str(d) for d in dataset["force"].dims if d != besides and _is_numeric(dataset[d])]
    return "poisson" if "poisson" in dims else next(iter(dims), None)


def _legend(figure: Figure, ax: Axes) -> None:
    handles, labels = ax.get_legend_handles_labels()
    if len(labels) > 1:
        margin = 0.3 / figure.get_figheight()
        figure.get_layout_engine().set(rect=(0, margin, 1, 1 - margin))
        figure.legend(handles, labels, loc="lower center", ncol=min(len(labels), 6), frameon=False)
