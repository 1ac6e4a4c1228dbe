"""F/F_max and speed-up against ε: the paper's figure."""

from collections.abc import Sequence
from itertools import islice

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.axis import log_axis
from pipeline.report.figures.layout import Layout, arrange
from pipeline.report.figures.panels import draw_curves, draw_spread, grid, panels, share_columns, share_heights
from pipeline.report.figures.style import CLAIM, LINE, finish
from pipeline.report.table import study_of
from pipeline.report.times import spreads, warned
from pipeline.report.words import formula, heading
from pipeline.study.sweep import Study

# The paper's claims: 80 % of F_max at ε = 10 mm, 50 times faster.
CLAIM_EPSILON, CLAIM_RATIO, CLAIM_SPEEDUP = 10e-3, 0.8, 50.0


def epsilon(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F/F_max, with a slit that of the energy released, and below it the speed-up, against ε."""
    return _against_epsilon(dataset, _quantities(dataset), title, warning)


def ratio(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F/F_max against ε."""
    return _against_epsilon(dataset, ("force_ratio",), title, warning)


def speedup(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """Speed-up over the full order against ε."""
    return _against_epsilon(dataset, ("speedup",), title, warning)


def epsilon_layout(dataset: xr.Dataset) -> Layout:
    """Return what the figure against ε shows."""
    return arrange(dataset, _quantities(dataset), "epsilon")


def _quantities(dataset: xr.Dataset) -> tuple[str, ...]:
    released = [name for name in ("energy_release_ratio",) if name in dataset]
    return ("force_ratio", *released, "speedup")


def _against_epsilon(dataset: xr.Dataset, quantities: Sequence[str], title: str, warning: str) -> Figure:
    layout = arrange(dataset, quantities, "epsilon")
    figure = grid(layout, quantities)
    if (factor := spreads(dataset, "speedup") if "speedup" in quantities else None) is not None:
        dataset = dataset.assign(spread=factor)
    shown = list(panels(figure, dataset, layout, quantities))
    x = [draw_curves(panel, layout).positions for panel in shown]
    for panel in shown:
        panel.ax.set_yscale("log" if panel.quantity == "speedup" else "linear")
        if panel.quantity == "speedup" and "spread" in dataset:
            draw_spread(panel, layout)
    share_heights((panel for panel in shown if panel.quantity == "speedup"), lambda panel: panel.quantity)
    share_columns((panel for panel in shown if panel.quantity != "speedup"), layout)
    study = study_of(dataset)
    asking = study if study and study.drawing.paper else None
    for panel, positions in zip(shown, x, strict=True):
        if panel.quantity == "force_ratio":
            _mark_ratio(panel.ax, positions, claimed=asking is not None and _shows_free(asking, panel.data))
        elif panel.quantity == "speedup":
            _mark_speedup(panel.ax, claimed=asking is not None)
        else:
            _mark_release(panel.ax)
        if panel.is_first:
            is_speedup = panel.quantity == "speedup"
            panel.ax.set_ylabel(heading(dataset["speedup"]) if is_speedup else formula(panel.quantity))
    note = "; ".join(filter(None, (layout.note, "bars: how far repeats are apart" if "spread" in dataset else "")))
    finish(figure, title, note, warned(warning, dataset) if "speedup" in quantities else warning)
    return figure


def _shows_free(study: Study, shown: xr.Dataset) -> bool:
    """Tell whether a body cut free is among what is ``shown``: it is of such a body that the paper's claim is true."""
    if "outside" in shown.coords:
        return "free" in np.atleast_1d(shown["outside"].values)
    return any(case.mesh.outside == "free" for case in islice(study.cases(), 1))


def _mark_ratio(ax: Axes, x: np.ndarray, *, claimed: bool) -> None:
    """Mark F = F_max, and the paper's 80 % at 10 mm if it is ``claimed`` of these curves."""
    ax.axhline(1.0, color=LINE, linewidth=0.7)
    low, high = ax.get_ylim()
    if high > 3:
        log_axis(ax, min(0.7, low), high)
    else:
        low, high = min(low, CLAIM_RATIO if claimed else 0.99), max(high, 1.02 if claimed else 1.01)
        ax.set_ylim(low - 0.1 * (high - low), high)
    if claimed and x.min() <= 1e3 * CLAIM_EPSILON <= x.max():
        star = {"marker": "*", "markersize": 9, "markeredgecolor": "white", "markeredgewidth": 0.5, "linestyle": "none"}
        point = (1e3 * CLAIM_EPSILON, CLAIM_RATIO)
        ax.plot(*point, color=CLAIM, zorder=5, **star)
        place = {"xytext": (6, -2), "textcoords": "offset points", "va": "center"}
        ax.annotate("paper: 80 %", point, color=CLAIM, fontsize=7, zorder=5, **place)


def _mark_release(ax: Axes) -> None:
    """Mark G = G_max, with room for 5 % at least."""
    ax.axhline(1.0, color=LINE, linewidth=0.7)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, 0.95), max(high, 1.05))


def _mark_speedup(ax: Axes, *, claimed: bool) -> None:
    """Mark the paper's 50-fold speed-up if it is ``claimed``, where the curves come near it."""
    low, high = ax.get_ylim()
    if claimed and high > CLAIM_SPEEDUP / 3:
        high = max(high, 1.6 * CLAIM_SPEEDUP)
        ax.axhline(CLAIM_SPEEDUP, color=CLAIM, linewidth=0.8, linestyle=":")
        place = {"xytext": (-2, 2), "textcoords": "offset points", "ha": "right"}
        spot = (1, CLAIM_SPEEDUP)
        ax.annotate("paper: 50 ×", spot, xycoords=("axes fraction", "data"), color=CLAIM, fontsize=7, **place)
    log_axis(ax, low, high)
