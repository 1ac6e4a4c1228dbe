"""How much of F is decided within a distance of the touch."""

from math import isfinite

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from epsmesh.report.figures.curves import BARS, grid
from epsmesh.report.figures.facets import arrange
from epsmesh.report.figures.style import LINE, finish
from epsmesh.report.study import study_of
from epsmesh.report.words import heading, scale

_SAID = 0.9  # the share of F whose distance is told in words


def influence(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """Share of F that is decided within a distance of the touch, beside the ε of the meshes."""
    name = "influence_radius"
    factor, unit = scale(dataset[name])
    facets = arrange(dataset, (name,), None)
    figure, panels = grid(dataset, [facets], (name,))
    radii = sorted({factor * epsilon for epsilon in _epsilons(dataset) if isfinite(epsilon)})
    for panel in panels:
        share = 100 * panel.data["decided"].values
        for label, style, line in panel.curves:
            radius, bar = (factor * line[one].values for one in (name, f"{name}_error"))
            known = np.isfinite(radius)
            bars = np.nan_to_num(bar[known])
            panel.ax.errorbar(radius[known], share[known], xerr=bars, label=label or "F", **BARS, **style)
        for radius in radii:
            panel.ax.axvline(radius, color=LINE, linewidth=0.7, linestyle="--", label="ε")
        panel.ax.set(xlim=(0, None), ylim=(0, 102), ylabel=f"{'' if panel.column else 'decided within r, '}% of F")
        if panel.ax.get_subplotspec().is_last_row():
            panel.ax.set_xlabel(heading(dataset[name]))
    told = dataset[name].sel(decided=_SAID, method="nearest").values
    low, high = (factor * find(told, initial=start) for find, start in ((np.nanmin, np.inf), (np.nanmax, -np.inf)))
    within = f"{low:.3g} {unit}" if low > 0.99 * high else f"{low:.3g} to {high:.3g} {unit}"
    said = f"{100 * _SAID:.0f} % of F is decided within {within} of the touch." if isfinite(low) else ""
    finish(figure, title, " ".join(filter(None, (said, "Dashed: ε." if radii else "", facets.note))), warning)
    return figure


def _epsilons(dataset: xr.Dataset) -> list[float]:
    """Return every ε (m) of a study."""
    if "epsilon" in dataset.coords:
        return [*map(float, np.atleast_1d(dataset["epsilon"].values))]
    study = study_of(dataset)
    return [] if study is None else [float(mesh.epsilon) for mesh in study.sections["mesh"]]  # type: ignore[attr-defined]
