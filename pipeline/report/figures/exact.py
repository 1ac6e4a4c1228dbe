"""F/F_exact with error bars."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from pipeline.report.figures.axis import log_axis
from pipeline.report.figures.dimensions import main_dimension
from pipeline.report.figures.layout import Layout, arrange
from pipeline.report.figures.panels import draw_curves, grid, panels, share_columns
from pipeline.report.figures.style import LINE, QUIET, finish
from pipeline.report.words import at_most, formula

# From such a ratio on, the axis is logarithmic.
_FAR = 3.0


def exact(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F/F_exact with both error bars: the case's own at each point, that of F_exact as a band around 1."""
    layout = exact_layout(dataset)
    figure = grid(layout, ("accuracy",), height=2.2)
    shown = list(panels(figure, dataset, layout, ("accuracy",)))
    for panel in shown:
        draw_curves(panel, layout, errors="force_error")
    share_columns(shown, layout)
    for panel in shown:
        panel.ax.axhline(1.0, color=LINE, linewidth=0.7)
        bar = float(panel.data["force_exact_error"].max())
        if np.isfinite(bar):
            panel.ax.axhspan(1 - bar, 1 + bar, color=QUIET, alpha=0.25, linewidth=0)
        low, high = panel.ax.get_ylim()
        if high > _FAR:
            log_axis(panel.ax, min(0.7, max(low, 0.1)), high)
        if panel.is_first:
            panel.ax.set_ylabel(formula("accuracy"))
    note = f"bars: 95 % error bars of F; grey band: that of F_exact{at_most(dataset['force_exact_error'])}"
    finish(figure, title, "; ".join(filter(None, (note, layout.note))), warning)
    return figure


def exact_layout(dataset: xr.Dataset) -> Layout:
    """Return what the figure of F/F_exact shows."""
    return arrange(dataset, ("accuracy",), main_dimension(dataset))
