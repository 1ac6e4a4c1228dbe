"""Force and area of contact against the depth, where how much of the tool touches is found."""

import xarray as xr
from matplotlib.figure import Figure

from pipeline.report.figures.layout import arrange
from pipeline.report.figures.panels import draw_curves, grid, panels
from pipeline.report.figures.style import finish
from pipeline.report.words import heading, scale

_QUANTITIES = ("force", "contact_area")


def contact(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force with its error bar, and below it the area in contact, against the depth."""
    layout = arrange(dataset, _QUANTITIES, "depth")
    figure = grid(layout, _QUANTITIES)
    for panel in panels(figure, dataset, layout, _QUANTITIES):
        array = dataset[panel.quantity]
        draw_curves(panel, layout, scale(array)[0], errors="force_error" if panel.quantity == "force" else "")
        panel.ax.set_ylim(bottom=0)
        if panel.is_first:
            panel.ax.set_ylabel(heading(array))
    finish(figure, title, "; ".join(filter(None, ("bars: 95 % error bars", layout.note))), warning)
    return figure
