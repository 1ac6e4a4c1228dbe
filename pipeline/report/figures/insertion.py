"""Figure of an insertion: F over depth with its parts and phases, and the energies below."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.files import FIGURE_FORMATS
from pipeline.report.figures.style import COLOURS, GRID, LINE, STYLE, WIDTH, finish, new_figure, save

_HEIGHT = 5.2  # inches
_PARTS = ("force_cutting", "force_friction", "force_elastic")
_ENERGIES = ("energy_fracture", "energy_friction", "energy_stored")
# Share of the depths from which on there is room for a name.
_WIDE = 0.2
# Share of the largest force below zero that is drawn.
_LOW = 0.1
_LABELS = ("cutting", "friction", "elastic")
_CAPTION = (
    "Parts of the force, and of the work, one on top of the other: what they do not fill is the error of the balance "
    "of energies. Grey band: 95 % error bar of F."
)


def draw(dataset: xr.Dataset, stem: Path, formats: Sequence[str] = FIGURE_FORMATS) -> list[Path]:
    """Draw an insertion into ``<stem>.png`` and ``.svg``, and return the files."""
    with mpl.rc_context(STYLE):
        figure = insertion(dataset)
        return [save(figure, stem.with_name(f"{stem.name}.{suffix}")) for suffix in formats]


def insertion(dataset: xr.Dataset) -> Figure:
    """F over depth above, energies over depth below."""
    figure = new_figure(WIDTH, _HEIGHT)
    back = dataset.isel(direction=-1) if "direction" in dataset.dims else None
    dataset = dataset if back is None else dataset.isel(direction=0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    depth, force = 1e3 * _from_zero(dataset["depth"]), 1e3 * _from_zero(dataset["force"])
    bar = 1e3 * _from_zero(dataset["force_error"])
    _stack(above, dataset, _PARTS, 1e3)
    above.fill_between(depth, force - bar, force + bar, color=GRID)
    above.plot(depth, force, color=LINE, label="F")
    if back is not None:
        away, pulled, own = (1e3 * back[name].values for name in ("depth", "force", "force_error"))
        above.fill_between(away, pulled - own, pulled + own, color=GRID)
        above.plot(away, pulled, color=COLOURS[4], label="F of the withdrawal")
        above.axhline(0, color=LINE, linewidth=0.6)
    above.set_ylabel("force (mN)")
    _stack(below, dataset, _ENERGIES, 1e3)
    below.plot(depth, 1e3 * _from_zero(dataset["work"]), color=LINE, linestyle="--", label="work of the tool")
    below.set_ylabel("energy (mJ)")
    below.set_xlabel("depth of the tip (mm)")
    _name_phases(above, dataset)
    finish(figure, str(dataset.attrs.get("title", "")).replace("$", r"\$"), _CAPTION)
    return figure


def _from_zero(values: xr.DataArray) -> np.ndarray:
    """Return values along the path, with that of the first touch."""
    return np.concatenate([[0.0], values.values])


def _stack(ax: Axes, dataset: xr.Dataset, names: Sequence[str], factor: float) -> None:
    parts = [factor * _from_zero(dataset[name]) for name in names]
    ax.stackplot(1e3 * _from_zero(dataset["depth"]), parts, labels=_LABELS, colors=COLOURS[1:4], alpha=0.5, linewidth=0)


def _name_phases(ax: Axes, dataset: xr.Dataset) -> None:
    """Mark the puncture, and name the phases beside it."""
    end, depth = 1e3 * float(dataset["depth"][-1]), 1e3 * float(dataset["puncture_depth"])
    low, top = ax.get_ylim()
    ax.set_ylim(low if low < -_LOW * top else 0, 1.12 * top)
    if np.isnan(depth):
        ax.text(end / 2, 1.04 * top, "indentation", ha="center")
        return
    ax.axvline(depth, color=LINE, linewidth=0.6, linestyle=":")
    ax.text((depth + end) / 2, 1.04 * top, "cutting", ha="center")
    ax.annotate("puncture", (depth, 1.04 * top), xytext=(4, 0), textcoords="offset points")
    if depth > _WIDE * end:
        ax.text(depth / 2, 1.04 * top, "indentation", ha="center")
