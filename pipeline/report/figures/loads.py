"""What loads add to the force, and what the depth takes, against the quantity that is swept."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from pipeline.report.figures.layout import arrange
from pipeline.report.figures.panels import draw_curves, grid, panels
from pipeline.report.figures.style import LINE, finish
from pipeline.report.words import scale

_SYMBOLS = {"force": "$F$", "load_force": "$F_{load}$", "sag": "sag"}
_QUANTITIES, _BAR = tuple(_SYMBOLS), "relative_bar"
_NOTE = "F: of the depth; F_load: what loads add to it while the probe is held; bars: 95 % error bars"
_HEIGHT, _MARGIN = 1.8, 0.06  # of a panel: inches, and share of it above what is drawn


def loads(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force of the depth, that of the loads, each with its error bar, and the sag, against ε or what is swept."""
    data = dataset.assign({_BAR: dataset["load_force_error"] / np.abs(dataset["load_force"])})
    layout = arrange(data, _QUANTITIES, dimension(dataset))
    figure = grid(layout, _QUANTITIES, height=_HEIGHT)
    bars = {"force": "force_error", "load_force": _BAR}
    for panel in panels(figure, data, layout, _QUANTITIES):
        factor, unit = scale(data[panel.quantity])
        draw_curves(panel, layout, factor, errors=bars.get(panel.quantity, ""))
        low, high = min(panel.ax.get_ylim()[0], 0.0), max(panel.ax.get_ylim()[1], 0.0)
        slack = _MARGIN * (high - low)
        panel.ax.set_ylim(low - slack * (low < 0), high + slack * (high > 0))
        panel.ax.axhline(0.0, color=LINE, linewidth=0.7)
        if panel.is_first:
            panel.ax.set_ylabel(f"{_SYMBOLS[panel.quantity]} ({unit})")
    finish(figure, title, "; ".join(filter(None, (_NOTE, layout.note))), warning)
    return figure


def dimension(dataset: xr.Dataset) -> str | None:
    """Return the dimension that loads are drawn against: ε if it is swept, else the first; None if none is."""
    swept = [str(dim) for dim in dataset["force"].dims if dataset.sizes[dim] > 1]
    return next((dim for dim in ("epsilon", *swept) if dim in swept), None)
