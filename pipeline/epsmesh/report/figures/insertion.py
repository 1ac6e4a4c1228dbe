"""Figure of an insertion: F over depth with its parts and phases, and the energies below."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.insertion.steps import ENDED, INDENTATION, PHASES
from epsmesh.report.figures.curves import BARS, grid, share
from epsmesh.report.figures.facets import arrange, swept
from epsmesh.report.figures.style import COLOURS, LINE, WIDTH, finish, new_figure
from epsmesh.report.values import punctures
from epsmesh.report.words import heading

_HEIGHT = 5.2  # inches
_PARTS = ("force_cutting", "force_friction", "force_elastic")
_ENERGIES = ("energy_fracture", "energy_friction", "energy_stored")
# Share of the depths from which on there is room for a name; and room for names above the forces.
_WIDE, _HEAD = 0.2, 1.35
# Share of the largest force below zero that is drawn.
_LOW = 0.1
# Parts of the force are seen through its error bar.
_BAND = {"color": LINE, "alpha": 0.15, "linewidth": 0}
_LABELS = ("cutting", "friction", "elastic")
_OF_SEVERAL = "The force over depth; markers are the punctures. Bands and bars are 95\N{NO-BREAK SPACE}% error bars."
_BARRED = ("depth", "force", "force_error", "depth_error")
# Curves, columns and rows of a figure of several cases, and what is a curve first.
_MOST, _CURVES = (6, 3, 1), ("epsilon", "friction", "toughness", "poisson", "law")
_CAPTION = (
    "Parts of the force, and of the work, one on top of the other: what they do not fill is the error of the balance "
    "of energies. Grey band and bars: 95 % error bars of F and of the puncture."
)


def insertion(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F over depth with its phases; of one case, also its parts and the energies."""
    back = dataset.isel(stroke=-1) if "stroke" in dataset.dims else None
    dataset = dataset if back is None else dataset.isel(stroke=0)
    if len(swept(dataset)) > 1:
        return _several(dataset, title, warning)
    dataset = dataset.squeeze(list(dataset["status"].dims), drop=True)
    figure = new_figure(WIDTH, _HEIGHT)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    depth = 1e3 * with_puncture(dataset, "depth")
    force, bar = (1e3 * with_puncture(dataset, name) for name in ("force", "force_error"))
    _stack(above, dataset, _PARTS)
    above.fill_between(depth, force - bar, force + bar, **_BAND)
    above.plot(depth, force, color=LINE, label="F")
    if back is not None:
        back = back.squeeze(list(back["status"].dims), drop=True)
        away, pulled, own = (1e3 * back[name].values for name in ("depth", "force", "force_error"))
        above.fill_between(away, pulled - own, pulled + own, **_BAND)
        above.plot(away, pulled, color=COLOURS[4], label="F of the withdrawal")
        above.axhline(0, color=LINE, linewidth=0.6)
    above.set_ylabel(heading(dataset["force"]))
    _stack(below, dataset, _ENERGIES)
    below.plot(depth, 1e3 * with_puncture(dataset, "work"), color=LINE, linestyle="--", label="work of the tool")
    below.set_ylabel("energy, mJ")
    below.set_xlabel("depth of the tip, mm")
    _name_phases(above, dataset)
    finish(figure, title, _CAPTION, warning)
    return figure


def _several(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """Draw F over depth of several cases, with the puncture of each: curves, in columns."""
    facets = arrange(dataset, ["force", "puncture_depth"], "depth", most=_MOST, first=_CURVES)
    figure, panels = grid(dataset, [facets], ["force"])
    for panel in panels:
        for label, style, one in panel.curves:
            depth, force, bar = (1e3 * with_puncture(one, name) for name in ("depth", "force", "force_error"))
            panel.ax.fill_between(depth, force - bar, force + bar, color=style["color"], alpha=0.15)
            panel.ax.plot(depth, force, label=label or "F", **style | {"marker": "none"})
            at = (1e3 * punctures(one)[f"puncture_{name}"].values for name in _BARRED)
            panel.ax.errorbar(*at, **style | {"linestyle": "none"}, **BARS)
    share(panels)
    panels[0].ax.set_ylim(bottom=0)
    finish(figure, title, f"{_OF_SEVERAL} {facets.note}".strip(), warning)
    return figure


def with_puncture(dataset: xr.Dataset, name: str) -> np.ndarray:
    """Return values along the path, with those of the first touch and of both sides of each puncture."""
    pierced = punctures(dataset)
    depths, at = dataset["depth"].values, np.repeat(pierced["puncture_depth"].values, 2)
    own = at if name == "depth" else pierced[f"{name}_at_puncture"].transpose("puncture", "side").values.ravel()
    return np.concatenate([[0.0], np.insert(dataset[name].values.astype(float), np.searchsorted(depths, at), own)])


def _stack(ax: Axes, dataset: xr.Dataset, names: Sequence[str]) -> None:
    depth, *parts = (with_puncture(dataset, name) for name in ("depth", *names))
    parts = [1e3 * part for part in parts]
    ax.stackplot(1e3 * depth, parts, labels=_LABELS, colors=COLOURS[1:4], alpha=0.5, linewidth=0)


def _name_phases(ax: Axes, dataset: xr.Dataset) -> None:
    """Shade indentations, name the phases, and mark the punctures with their error bars."""
    low, top = ax.get_ylim()
    ax.set_ylim(low if low < -_LOW * top else 0, _HEAD * top)
    end, pierced = 1e3 * float(dataset["depth"][-1]), punctures(dataset)
    for phase, start, stop in _phases(dataset):
        if phase == INDENTATION:
            ax.axvspan(start, stop, color=COLOURS[3], alpha=0.12, linewidth=0)
        middle = (max(start, 0.0) + min(stop, end)) / 2
        turned = {"rotation": 90, "va": "top"} if stop - start < _WIDE * end else {"va": "bottom"}
        height = 0.98 if turned["va"] == "top" else 0.93
        ax.text(middle, height, phase, ha="center", transform=ax.get_xaxis_transform(), **turned)
    at = {name: 1e3 * pierced[f"puncture_{name}"].values for name in _BARRED}
    ax.errorbar(*(at[name] for name in _BARRED), color=LINE, marker="o", linestyle="none", label="puncture", **BARS)


def _phases(dataset: xr.Dataset) -> Iterator[tuple[str, float, float]]:
    """Yield the phases of the way in, and the depths (mm) between which they are."""
    depths, names = 1e3 * dataset["depth"].values, [PHASES[int(phase)] for phase in dataset["phase"]]
    pierced, start = 1e3 * punctures(dataset)["puncture_depth"].values, 0.0
    found = [(names[0], start)]
    if len(pierced) and pierced[0] < depths[0]:
        found = [(INDENTATION, 0.0), (names[0], pierced[0])]
    for number in range(1, len(names)):
        low, high = depths[number - 1 : number + 1]
        inside = [depth for depth in pierced if low <= depth < high]
        if names[number] != names[number - 1]:
            found.append((names[number], inside[-1] if inside else (low + high) / 2))
    ends = [start for _, start in found[1:]] + [float(depths[-1])]
    for (name, start), stop in zip(found, ends, strict=True):
        if name != ENDED:
            yield name, start, stop
