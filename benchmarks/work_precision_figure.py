"""The figure of the work–precision benchmark, from its dataset alone."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from epsmesh.files import FIGURE_FORMATS
from epsmesh.report.figures import STYLE, save

# Colours by element, line styles by mesh; they can be told apart in grey and by the colour-blind.
_COLOURS = {"P1": "#777777", "P2": "#1f5fa8", "P3": "#00204d", "P2/P1": "#c98a00", "P3/P2": "#b0413e"}
_OTHERS = {"axisymmetric, by degree": ("#2a9d8f", "-", "D"), "accuracy asked for, 3D": ("#d81b60", "-", "*")}


def draw(dataset: xr.Dataset, stem: Path) -> list[Path]:
    """Draw the error of F over run time and over unknowns into ``<stem>.png`` and ``<stem>.svg``."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.1, 6.6))
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(dataset["poisson"]), 2, sharey=True, sharex="col", squeeze=False)
        for row, nu in zip(panels, dataset["poisson"].values, strict=True):
            for axes, quantity in zip(row, ("seconds", "dofs"), strict=True):
                _panel(axes, dataset.sel(poisson=nu), quantity)
            row[0].set_ylabel(f"ν = {nu:g}\n|error of F| (%)")
        panels[-1, 0].set_xlabel("run time (s), one core, warm")
        panels[-1, 1].set_xlabel("unknowns of the whole body")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        more = panels[-1, 0].get_legend_handles_labels()
        known = dict(zip([*labels, *more[1]], [*handles, *more[0]], strict=True))
        figure.legend(known.values(), known.keys(), loc="lower center", ncol=3)
        figure.subplots_adjust(left=0.11, right=0.98, top=0.94, bottom=0.2, wspace=0.06, hspace=0.08)
        figure.suptitle(dataset.attrs["title"], fontsize=9.5, fontweight="bold")
        return [save(figure, stem.with_name(f"{stem.name}.{kind}")) for kind in FIGURE_FORMATS]


def _panel(axes: Axes, dataset: xr.Dataset, quantity: str) -> None:
    for method in dataset["elements"].values:
        curve = dataset.sel(elements=method)
        x, y = curve[quantity].values, 100 * np.abs(curve["error"].values)
        known = np.isfinite(x) & np.isfinite(y)
        if known.any():
            colour, line, marker = _look(method)
            axes.plot(x[known], y[known], line, color=colour, marker=marker, label=method)
    axes.set_xscale("log")
    axes.set_yscale("log")


def _look(method: str) -> tuple[str, str, str]:
    if method in _OTHERS:
        return _OTHERS[method]
    colour = _COLOURS[method.split(maxsplit=1)[0]]
    if "uniform" in method:
        return colour, ":", "o"
    return (colour, "--", "v") if "no symmetry" in method else (colour, "-", "s")
