"""Curves over a sweep: F/F_max, the error of F, and F with what goes with it, against what a study varies."""

import textwrap
from collections import Counter
from dataclasses import replace
from itertools import islice

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from epsmesh.quantities import MESH_DIMENSIONS, symbol
from epsmesh.report.figures.curves import BARS, Panel, draw, grid, positions, share, write_ticks
from epsmesh.report.figures.facets import Facets, arrange, main_dimension, swept, with_error
from epsmesh.report.figures.style import CLAIM, FAILED, LINE, QUIET, finish, log_scale, new_figure, write_above
from epsmesh.report.pareto import front
from epsmesh.report.study import study_of
from epsmesh.report.times import doubtful, spreads
from epsmesh.report.values import answer_of, by_case, relative
from epsmesh.report.words import at_most, choices, is_numeric
from epsmesh.study.sweep import Study

# The paper's claims: 80 % of F_max at ε = 10 mm, 50 times faster.
CLAIM_EPSILON, CLAIM_RATIO, CLAIM_SPEEDUP = 10e-3, 0.8, 50.0
_LEAST = 0.99  # a panel reaches from here to as far above 1, at least: smaller differences do not matter
_FAR = 3.0  # from such a ratio on, the axis is logarithmic
_TELLS = {
    "force_ratio": "F/F_max: force of the ε-mesh over that of the full-order mesh; 1 is no difference.",
    "energy_release_ratio": "G/G_max: the same of the energy release.",
    "speedup": "Speed-up: how many times faster than the full-order mesh.",
}
_OF_PATH = "What a path is judged by, over the same of the full-order mesh; 1 is no difference."
_COSTS = ("dofs", "time_total")
_BARS = "bars are 95\N{NO-BREAK SPACE}% error bars."
_MOST_PANELS, _MOST_CURVES = 4, 4
_PANEL, _LEGEND_LINE, _LETTERS = 2.9, 0.17, 34  # inches: of a panel with its legend above, and of a line of that
# What is drawn below the force where a study has it; those that are shares of something have a line at 1. What a
# second jaw has is drawn where it differs from what the first has by more than this share.
_OF_JAW, _DIFFERS = "jaw_", 1e-3
_WITH_FORCE = (
    *("pull_force", "jaw_force", "jaw_pull_force", "contact_area", "jaw_contact_area", "lift_off_area"),
    *("load_force", "sag", "linear_ratio", "force_exact_ratio"),
)
_SHARES = ("linear_ratio", "force_exact_ratio")
_NOUGHT = {"sag": 1e-9}  # m: what the solver leaves of none
# What is drawn below the force over time, and what is a curve first.
_OVER_TIME = ("tool_depth", "dissipated_energy")
_OF_HISTORY = ("ramp", "hold", "frequency", "amplitude", "probe", "material")


def ratio(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """F/F_max, with a slit the energy released as well, and the speed-up, against ε."""
    facets, quantities = ratio_facets(dataset), _ratios(dataset)
    figure, panels = grid(dataset, [facets], quantities)
    study, spread = study_of(dataset), spreads(dataset, "speedup")
    paper, of_path = study if study and study.drawing.paper else None, "quantity" in dataset.dims
    for panel in panels:
        draw(panel)
    share(panels)
    for panel in panels:
        if of_path and panel.quantity == "force_ratio":
            panel.ax.set_ylabel("" if panel.column else "share of the full order's")
        if panel.quantity == "speedup":
            if spread is not None:
                _draw_spread(panel, spread)
            _mark_speedup(panel, claimed=paper is not None)
        else:
            _mark_ratio(panel, claimed=paper is not None and _shows_free(paper, panel.data))
    tells = _TELLS | ({"force_ratio": _OF_PATH} if of_path else {})
    notes = [*(tells[name] for name in quantities), facets.note, _repeats(spread), *doubtful(dataset)]
    finish(figure, title, " ".join(filter(None, notes)), warning)
    return figure


def ratio_facets(dataset: xr.Dataset) -> Facets:
    """Return the facets of the figure against ε."""
    return arrange(dataset, _ratios(dataset), "epsilon")


def error(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The error of F against what is swept of the mesh, the number of unknowns, and the run time of a case."""
    reference, data = with_error(dataset)
    spread = spreads(dataset, "time_total")
    data = data if spread is None else data.assign(spread=spread)
    between = "from the full order" if "quantity" in data.dims else f"of F from F_{reference}"
    facets = _error_facets(data)
    figure, panels = grid(data, [replace(facets, x=x) for x in (facets.x, *_COSTS)], ["error"])
    for panel in panels:
        _draw_errors(panel, str(facets.x))
        panel.ax.set_ylabel(f"distance{'' if panel.column else f' {between}'}, %")
        if panel.column == 0:
            write_ticks(panel.ax, panel.data[facets.x])
    share(panels)
    log_scale(panels[0].ax)
    floor, (low, high) = 100 * float(data["exact_bar"].max()), panels[0].ax.get_ylim()
    for panel in panels:
        bar = 100 * float(panel.data["exact_bar"].max())
        if np.isfinite(bar) and bar > 0:  # what it does not tell from none
            panel.ax.axhspan(1e-3 * bar, bar, color=QUIET, alpha=0.18, linewidth=0)
        if panel.column:
            log_scale(panel.ax, "x")
    panels[0].ax.set_ylim(max(low, floor / 10) if floor > 0 else low, high)
    of_bar = f"Grey: below the error bar of F_exact{at_most(data['exact_bar'])}."
    notes = [
        f"Distance {between}: lower is better.",
        "Unknowns and run time: the line joins cases that no other case beats in both."
        " Cases that a finer mesh does not confirm, since its error is larger, are left out.",
        of_bar if reference == "exact" and np.isfinite(floor) else "",
        facets.note,
        _repeats(spread),
        *doubtful(dataset),
    ]
    finish(figure, title, " ".join(filter(None, notes)), warning)
    return figure


def error_facets(dataset: xr.Dataset) -> Facets:
    """Return the facets of the figure of errors."""
    return _error_facets(with_error(dataset)[1])


def force(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force, or the depth at a given one, and what a study has besides, against each swept quantity."""
    dims = swept(dataset)
    shown, first = sorted(dims, key="depth".__ne__)[:_MOST_PANELS], answer_of(dataset)
    tells = f"The {first} against each quantity that the study varies; {_BARS}"
    more = f"Not shown: against {', '.join(map(symbol, dims[_MOST_PANELS:]))}." if dims[_MOST_PANELS:] else ""
    quantities = [first, *(name for name in _WITH_FORCE if _varies(dataset, name))]
    return _against(dataset, shown, quantities, (title, tells, more, warning))


def history(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force, the depth of the tool and the dissipated energy over time."""
    quantities = ["force", *(name for name in _OVER_TIME if _varies(dataset, name))]
    dataset = dataset.assign({name: by_case(dataset, name) for name in ("status", *quantities)})
    return _against(dataset, ["time"], quantities, (title, f"The force over time; bands and {_BARS}", "", warning))


def _against(dataset: xr.Dataset, shown: list[str], quantities: list[str], words: tuple[str, str, str, str]) -> Figure:
    """Draw quantities against each dimension ``shown``; ``words`` are title, caption, what is not shown, warning."""
    title, tells, more, warning = words
    exact_bar = relative(dataset, "force_exact_error")
    of_ratio = abs(dataset["force_exact_ratio"]) * relative(dataset, "force_error")
    dataset = dataset.assign(force_exact_ratio_error=of_ratio, exact_bar=exact_bar)
    first: tuple[str, ...] = ("law", "probe") if "contact_area" in quantities else ("law", "poisson")
    first = _OF_HISTORY if shown == ["time"] else first
    facets = [arrange(dataset, quantities, dim, most=(_MOST_CURVES, 1, 1), first=first) for dim in shown]
    figure, panels = grid(dataset, facets, quantities, _PANEL, 0.6)
    for panel in panels:
        draw(panel)
        if panel.quantity in _SHARES:
            panel.ax.axhline(1.0, color=LINE, linewidth=0.7)
        if panel.quantity == "force_exact_ratio" and np.isfinite(bar := float(exact_bar.max())):
            panel.ax.axhspan(1 - bar, 1 + bar, color=QUIET, alpha=0.25, linewidth=0)
    share(panels)
    for panel in panels:
        low, high = panel.ax.get_ylim()
        if panel.quantity not in _SHARES and low * high > 0 and low > -0.05 * high:
            panel.ax.set_ylim(0, 1.05 * high)  # a small change then looks small
    above = [panel for panel in panels if panel.quantity == quantities[0]]
    lines = max(_name_curves(panel, textwrap.fill(choices(dataset, panel.facets.fixed), _LETTERS)) for panel in above)
    figure.set_figheight(figure.get_figheight() + _LEGEND_LINE * lines)
    part = ", ".join(dict.fromkeys(words for one in facets for words in one.part))
    band = f"Grey: error bar of F_exact{at_most(exact_bar)}." if "force_exact_ratio" in quantities else ""
    notes = (tells, band, f"Shown: {part}." if part else "", more)
    finish(figure, title, " ".join(filter(None, notes)), warning, legend=False)
    return figure


def _repeats(spread: xr.DataArray | None) -> str:
    return "" if spread is None else "Bars: how far repeats are apart."


def _ratios(dataset: xr.Dataset) -> list[str]:
    return [name for name in _TELLS if name in dataset]


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


def _draw_spread(panel: Panel, spread: xr.DataArray) -> None:
    """Draw bars that reach above and below the speed-ups by the factor ``spread``."""
    x = positions(panel.data["epsilon"])
    spread = spread.sel({dim: panel.data[dim] for dim in spread.dims if dim in panel.data.coords})
    for (_, style, line), curve in zip(panel.curves, panel.facets.curves, strict=True):
        y, factor = line["speedup"].values, spread.sel(curve).values
        known = np.isfinite(y) & (factor > 1)
        bars = np.abs(np.stack([y / factor - y, y * factor - y]))[:, known]
        panel.ax.errorbar(x[known], y[known], bars, fmt="none", ecolor=style["color"], **BARS)


def _error_facets(data: xr.Dataset) -> Facets:
    return arrange(data, ("error",), main_dimension(data), most=(7, 1, 3))


def _draw_errors(panel: Panel, swept: str) -> None:
    """Draw the errors of a panel against what is ``swept``, or against a cost, with those on the front joined."""
    ax, name = panel.ax, str(panel.facets.x)
    for label, style, line in panel.curves:
        known = 100 * np.atleast_1d(line["error"].values)
        if not (known > 0).any():
            continue
        if name == swept:
            joined = {} if is_numeric(line[name]) and line[name].size > 1 else {"linestyle": "none"}
            ax.plot(positions(line[name]), known, label=label or None, **style | joined)
            continue
        cost = np.atleast_1d(line[name].values).astype(float)
        cost = np.where(cost > 0, cost, np.nan)
        best = front(cost, np.where(np.atleast_1d(line["is_by_chance"].values), np.nan, known))
        ax.plot(cost, known, **style | {"linestyle": "none"})
        if name == "time_total" and "spread" in line:
            share = np.atleast_1d(line["spread"].values)[best]
            bars = cost[best] * np.stack([1 - 1 / share, share - 1])
            ax.errorbar(cost[best], known[best], xerr=bars, fmt="none", ecolor=style["color"], **BARS)
        opacity = 1.0 if swept in MESH_DIMENSIONS else 0.0
        ax.plot(cost[best], known[best], color=style["color"], drawstyle="steps-post", alpha=opacity)


def _varies(dataset: xr.Dataset, name: str) -> bool:
    """Tell whether ``dataset`` has values of a quantity, other than nought."""
    if name not in dataset or (name == "linear_ratio" and "law" not in dataset.dims):
        return False
    if name.startswith(_OF_JAW):
        own, of_first = dataset[name], dataset[name.removeprefix(_OF_JAW)]
        return bool((abs(own - of_first) > _DIFFERS * abs(of_first).max()).any())
    return bool((abs(dataset[name]) > _NOUGHT.get(name, 0.0)).any())


def _name_curves(panel: Panel, at: str) -> int:
    """Name the curves of a panel above it, and what is the same for all; return how many lines that takes."""
    if len(panel.facets.curves) < 2:
        panel.ax.set_title(at, color=QUIET)
        return 0
    longest = max(map(len, panel.ax.get_legend_handles_labels()[1]), default=0)
    legend = write_above(panel.ax, at, _LETTERS, 2 if longest <= 12 else 1)
    return sum(text.get_text().count("\n") + 1 for text in legend.get_texts())


def nothing(dataset: xr.Dataset, title: str, _warning: str) -> Figure:
    """Say, where no case has a force, how many failed and of what."""
    states = Counter(map(str, dataset["status"].values.ravel()))
    messages = Counter(str(m) for m in dataset["message"].values.ravel() if m)
    lines = [f"No case has a force: {', '.join(f'{count} {state}' for state, count in states.items())}."]
    lines += [f"{count} ×  {message}" for message, count in messages.most_common(4)]
    text = "\n".join(textwrap.fill(line, 62, subsequent_indent="      ") for line in lines)
    figure = new_figure(5.4, 1.0 + 0.19 * text.count("\n"))
    figure.text(0.04, 0.5, text, va="center", color=FAILED)
    finish(figure, title)
    return figure
