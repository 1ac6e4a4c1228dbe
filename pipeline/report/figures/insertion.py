"""Figure of an insertion: F over depth with its parts and phases, and the energies below."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.facets import swept
from pipeline.report.figures.force import columns
from pipeline.report.figures.style import COLOURS, GRID, LINE, WIDTH, finish, new_figure
from pipeline.report.values import by_case

_HEIGHT = 5.2  # inches
_PARTS = ("force_cutting", "force_friction", "force_elastic")
_ENERGIES = ("energy_fracture", "energy_friction", "energy_stored")
# Share of the depths from which on there is room for a name.
_WIDE = 0.2
# Share of the largest force below zero that is drawn.
_LOW = 0.1
_LABELS = ("cutting", "friction", "elastic")
_OF_SEVERAL = "The force over depth, up to the last one that was solved; bars are 95\N{NO-BREAK SPACE}% error bars."
_CAPTION = (
    "Parts of the force, and of the work, one on top of the other: what they do not fill is the error of the balance "
    "of energies. Grey band: 95 % error bar of F."
)


def insertion(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F over depth with its phases; of one case, also its parts and the energies."""
    back = dataset.isel(stroke=-1) if "stroke" in dataset.dims else None
    dataset = dataset if back is None else dataset.isel(stroke=0)
    if len(swept(dataset)) > 1:
        names = ("status", "force", "force_exact_ratio", "force_exact_error")
        dataset = dataset.assign({name: by_case(dataset, name) for name in names})
        return columns(dataset, ["depth"], ["force"], (title, _OF_SEVERAL, "", warning))
    dataset = dataset.squeeze(list(dataset["status"].dims), drop=True)
    figure = new_figure(WIDTH, _HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    depth = 1e3 * _along(dataset, "depth")
    force, bar = (1e3 * _along(dataset, name) for name in ("force", "force_error"))
    _stack(above, dataset, _PARTS, 1e3)
    above.fill_between(depth, force - bar, force + bar, color=GRID)
    above.plot(depth, force, color=LINE, label="F")
    if back is not None:
        back = back.squeeze(list(back["status"].dims), drop=True)
        away, pulled, own = (1e3 * back[name].values for name in ("depth", "force", "force_error"))
        above.fill_between(away, pulled - own, pulled + own, color=GRID)
        above.plot(away, pulled, color=COLOURS[4], label="F of the withdrawal")
        above.axhline(0, color=LINE, linewidth=0.6)
    above.set_ylabel("force (mN)")
    _stack(below, dataset, _ENERGIES, 1e3)
    below.plot(depth, 1e3 * _along(dataset, "work"), color=LINE, linestyle="--", label="work of the tool")
    below.set_ylabel("energy (mJ)")
    below.set_xlabel("depth of the tip (mm)")
    _name_phases(above, dataset)
    finish(figure, title, _CAPTION, warning)
    return figure


def _along(dataset: xr.Dataset, name: str) -> np.ndarray:
    """Return values along the path, with those of the first touch and of both sides of the puncture."""
    depths, at = dataset["depth"].values, float(dataset["puncture_depth"])
    own = np.full(2, at) if name == "depth" else dataset[f"{name}_at_puncture"].values
    place = int(np.searchsorted(depths, at)) if np.isfinite(at) else 0
    own = own if np.isfinite(at) else own[:0]
    return np.concatenate([[0.0], dataset[name].values[:place], own, dataset[name].values[place:]])


def _stack(ax: Axes, dataset: xr.Dataset, names: Sequence[str], factor: float) -> None:
    parts = [factor * _along(dataset, name) for name in names]
    ax.stackplot(1e3 * _along(dataset, "depth"), parts, labels=_LABELS, colors=COLOURS[1:4], alpha=0.5, linewidth=0)


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
