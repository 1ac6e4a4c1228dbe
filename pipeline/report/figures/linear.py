"""F over that of linear elasticity, against the depth: until where linear elasticity holds."""

import xarray as xr
from matplotlib.figure import Figure

from pipeline.report.figures.layout import arrange
from pipeline.report.figures.panels import draw_curves, grid, panels
from pipeline.report.figures.style import LINE, finish
from pipeline.report.words import formula

# Differences that are marked: where these are reached, linear elasticity is so far off.
_MARKED = (0.01, 0.05)


def linear(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F/F_linear of every other law against the depth."""
    others = dataset.sel(law=[law for law in dataset["law"].values if law != "linear"])
    others = others.squeeze("law") if others.sizes["law"] == 1 else others
    quantities = ("linear_ratio",)
    layout = arrange(others, quantities, "depth")
    figure = grid(layout, quantities)
    for panel in panels(figure, others, layout, quantities):
        draw_curves(panel, layout)
        panel.ax.axhline(1.0, color=LINE, linewidth=0.7)
        low, high = panel.ax.get_ylim()
        for share in _MARKED:
            for level in (1 - share, 1 + share):
                if low <= level <= high:
                    panel.ax.axhline(level, color=LINE, linewidth=0.6, linestyle=":")
        if panel.is_first:
            panel.ax.set_ylabel(formula("linear_ratio"))
    finish(figure, title, layout.note, warning)
    return figure
