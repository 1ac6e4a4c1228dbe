"""F/F_max and speed-up against ε: the paper's figure."""

from itertools import islice

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from epsmesh.report.figures.curves import BARS, Panel, draw, grid, positions, share
from epsmesh.report.figures.facets import Facets, arrange
from epsmesh.report.figures.style import CLAIM, LINE, finish, log_scale, look
from epsmesh.report.study import study_of
from epsmesh.report.times import doubtful, spreads
from epsmesh.study.sweep import Study

# The paper's claims: 80 % of F_max at ε = 10 mm, 50 times faster.
CLAIM_EPSILON, CLAIM_RATIO, CLAIM_SPEEDUP = 10e-3, 0.8, 50.0
_LEAST = 0.99  # a panel reaches from here to as far above 1, at least: smaller differences do not matter
_TELLS = {
    "force_ratio": "F/F_max: force of the ε-mesh over that of the full-order mesh; 1 is no difference.",
    "energy_release_ratio": "G/G_max: the same of the energy release.",
    "speedup": "Speed-up: how many times faster than the full-order mesh.",
}
_FAR = 3.0  # from such a ratio on, the axis is logarithmic


def ratio(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F/F_max, with a slit the energy released as well, and the speed-up, against ε."""
    facets = ratio_facets(dataset)
    quantities = _quantities(dataset)
    figure, panels = grid(dataset, facets, quantities)
    study, spread = study_of(dataset), spreads(dataset, "speedup")
    paper = study if study and study.drawing.paper else None
    for panel in panels:
        draw(panel, facets)
    share(panels, facets)
    for panel in panels:
        if panel.quantity == "speedup":
            if spread is not None:
                _draw_spread(panel, facets, spread)
            _mark_speedup(panel, claimed=paper is not None)
        else:
            _mark_ratio(panel, claimed=paper is not None and _shows_free(paper, panel.data))
    parts = [_TELLS[name] for name in quantities]
    parts += [facets.note, "" if spread is None else "Bars: how far repeats are apart."]
    finish(figure, title, " ".join(filter(None, [*parts, *doubtful(dataset)])), warning)
    return figure


def ratio_facets(dataset: xr.Dataset) -> Facets:
    """Return the facets of the figure against ε."""
    return arrange(dataset, _quantities(dataset), "epsilon")


def _quantities(dataset: xr.Dataset) -> list[str]:
    return [name for name in ("force_ratio", "energy_release_ratio", "speedup") if name in dataset]


def _shows_free(study: Study, shown: xr.Dataset) -> bool:
    """Tell whether a body cut free is among what is ``shown``: the paper's claim is of such a body."""
    if "outside" in shown.coords:
        return "free" in np.atleast_1d(shown["outside"].values)
    return any(case.mesh.outside == "free" for case in islice(study.cases(), 1))


def _mark_ratio(panel: Panel, *, claimed: bool) -> None:
    """Mark F = F_max, and the paper's 80 % at 10 mm if it is ``claimed`` of these curves."""
    panel.ax.axhline(1.0, color=LINE, linewidth=0.7)
    claimed = claimed and panel.quantity == "force_ratio"
    low, high = panel.ax.get_ylim()
    panel.ax.set_ylim(min(low, _LEAST), max(high, 2 - _LEAST))
    if panel.ax.get_ylim()[1] > _FAR:
        log_scale(panel.ax)
    elif claimed:
        panel.ax.set_ylim(bottom=min(panel.ax.get_ylim()[0], 0.95 * CLAIM_RATIO))
    x = positions(panel.data["epsilon"])
    if claimed and x.min() <= 1e3 * CLAIM_EPSILON <= x.max():
        star = {"color": CLAIM, "markersize": 10, "markeredgecolor": "white", "linestyle": "none", "zorder": 5}
        panel.ax.plot(1e3 * CLAIM_EPSILON, CLAIM_RATIO, "*", label="paper: 80 %", **star)


def _mark_speedup(panel: Panel, *, claimed: bool) -> None:
    """Mark the paper's 50-fold speed-up if it is ``claimed``, where the curves come near it."""
    if claimed and panel.ax.get_ylim()[1] > CLAIM_SPEEDUP / 3:
        panel.ax.axhline(CLAIM_SPEEDUP, color=CLAIM, linewidth=0.9, linestyle=":", label="paper: 50 ×")
    log_scale(panel.ax)


def _draw_spread(panel: Panel, facets: Facets, spread: xr.DataArray) -> None:
    """Draw bars that reach above and below the speed-ups by the factor ``spread``."""
    x = positions(panel.data["epsilon"])
    data = panel.data.assign(spread=spread.sel({d: panel.data[d] for d in spread.dims if d in panel.data.coords}))
    for position, curve in enumerate(facets.curves):
        line = data.sel(curve)
        y, factor = line["speedup"].values, line["spread"].values
        known = np.isfinite(y) & (factor > 1)
        bars = np.abs(np.stack([y / factor - y, y * factor - y]))[:, known]
        panel.ax.errorbar(x[known], y[known], bars, fmt="none", ecolor=look(position)["color"], **BARS)
