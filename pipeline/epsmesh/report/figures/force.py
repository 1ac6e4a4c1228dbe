"""The force, and what goes with it, against everything that a study sweeps."""

import textwrap
from collections import Counter

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.quantities import symbol
from epsmesh.report.figures.curves import Panel, draw
from epsmesh.report.figures.facets import arrange, swept
from epsmesh.report.figures.style import FAILED, LINE, QUIET, finish, look, new_figure, write_above
from epsmesh.report.values import answer_of, by_case, relative
from epsmesh.report.words import at_most, choices, heading, scale

_MOST_PANELS, _MOST_CURVES = 4, 4
_WIDTH, _HEIGHT, _LINE = 3.1, 2.2, 0.17  # inches: of a panel, and of a line of the legend above it
# What is drawn below the force where a study has it; those that are shares of something have a line at 1.
_WITH_FORCE = ("contact_area", "load_force", "sag", "linear_ratio", "force_exact_ratio")
# What is drawn below the force over time.
_OF_HISTORY = ("ramp", "hold", "frequency", "amplitude", "probe", "material")
_OVER_TIME = ("tool_depth", "dissipated_energy")
_SHARES = ("linear_ratio", "force_exact_ratio")


def force(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force, or the depth at a given one, and what a study has besides, against each swept quantity."""
    dims = swept(dataset)
    if not dims:
        return _one(dataset, title, warning)
    shown = sorted(dims, key="depth".__ne__)[:_MOST_PANELS]
    first = answer_of(dataset)
    tells = f"The {first} against each quantity that the study varies; bars are 95\N{NO-BREAK SPACE}% error bars."
    more = f"Not shown: against {', '.join(map(symbol, dims[_MOST_PANELS:]))}." if dims[_MOST_PANELS:] else ""
    quantities = [first, *(name for name in _WITH_FORCE if _varies(dataset, name))]
    return _columns(dataset, shown, quantities, (title, tells, more, warning))


def history(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force, the depth of the tool and the dissipated energy over time."""
    quantities = ["force", *(name for name in _OVER_TIME if _varies(dataset, name))]
    tells = "The force over time; bars are 95\N{NO-BREAK SPACE}% error bars."
    names = ("status", *quantities)
    dataset = dataset.assign({name: by_case(dataset, name) for name in names})
    return _columns(dataset, ["time"], quantities, (title, tells, "", warning))


def _columns(dataset: xr.Dataset, shown: list[str], quantities: list[str], words: tuple[str, str, str, str]) -> Figure:
    """Draw quantities against each dimension ``shown``; ``words`` are title, caption, what is not shown, warning."""
    title, tells, more, warning = words
    exact_bar = relative(dataset, "force_exact_error")
    of_ratio = abs(dataset["force_exact_ratio"]) * relative(dataset, "force_error")
    dataset = dataset.assign(force_exact_ratio_error=of_ratio, exact_bar=exact_bar)
    figure = new_figure(max(_WIDTH * len(shown), 4.6) + 0.6, _HEIGHT * len(quantities) + 1.6)
    axes = figure.subplots(len(quantities), len(shown), squeeze=False, sharex="col", sharey="row")
    left_out = [_draw_column(column, dataset, dim, quantities) for dim, column in zip(shown, axes.T, strict=True)]
    for row, name in zip(axes, quantities, strict=True):
        row[0].set_ylabel(textwrap.fill(heading(dataset[name]), 28))
        low, high = row[0].get_ylim()
        if name not in _SHARES and low * high > 0 and low > -0.05 * high:
            row[0].set_ylim(0, 1.05 * high)  # a small change then looks small
    band = f"Grey: error bar of F_exact{at_most(exact_bar)}." if "force_exact_ratio" in quantities else ""
    figure.set_figheight(figure.get_figheight() + _LINE * max(map(_legend_lines, axes[0])))
    part = dict.fromkeys(words for column in left_out for words in column)
    notes = (tells, band, f"Shown: {', '.join(part)}." if part else "", more)
    finish(figure, title, " ".join(filter(None, notes)), warning, legend=False)
    return figure


def _varies(dataset: xr.Dataset, name: str) -> bool:
    """Tell whether ``dataset`` has values of a quantity, other than nought."""
    if name not in dataset or (name == "linear_ratio" and "law" not in dataset.dims):
        return False
    return bool((np.isfinite(dataset[name]) & (dataset[name] != 0)).any())


def _draw_column(axes: np.ndarray, dataset: xr.Dataset, dim: str, quantities: list[str]) -> tuple[str, ...]:
    """Draw every quantity against one dimension; return what is left out, in words."""
    first: tuple[str, ...] = ("law", "probe") if "contact_area" in quantities else ("law", "poisson")
    first = _OF_HISTORY if dim == "time" else first
    facets = arrange(dataset, quantities, dim, most=(_MOST_CURVES, 1, 1), first=first)
    data = dataset.sel(facets.at)
    for ax, name in zip(axes, quantities, strict=True):
        draw(Panel(ax, data, name, 0), facets)
        if name in _SHARES:
            ax.axhline(1.0, color=LINE, linewidth=0.7)
        if name == "force_exact_ratio" and np.isfinite(bar := float(dataset["exact_bar"].max())):
            ax.axhspan(1 - bar, 1 + bar, color=QUIET, alpha=0.25, linewidth=0)
    axes[-1].set_xlabel(heading(dataset[dim]))
    at = textwrap.fill(choices(dataset, facets.fixed), 34)
    if len(facets.curves) > 1:
        longest = max(map(len, axes[0].get_legend_handles_labels()[1]), default=0)
        write_above(axes[0], at, 34, 2 if longest <= 12 else 1)
    else:
        axes[0].set_title(at, color=QUIET)
    return facets.part


def _legend_lines(ax: Axes) -> int:
    legend = ax.get_legend()
    return sum(text.get_text().count("\n") + 1 for text in legend.get_texts()) if legend else 0


def _one(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """Draw the force, or the depth, of the one case."""
    name = answer_of(dataset)
    factor, unit = scale(dataset[name])
    value, bar = (factor * float(dataset[one].squeeze()) for one in (name, f"{name}_error"))
    share = float(relative(dataset, f"{name}_error").squeeze())
    figure = new_figure(4.6, 3.3)
    ax = figure.subplots()
    ax.errorbar([0], [value], [np.nan_to_num(bar)], capsize=3, linestyle="none", **look(0))
    ax.set_xticks([0], [f"{value:.4g} {unit} ± {100 * share:.2g} %"])
    ax.set_ylim(min(0.0, 1.2 * value), max(0.0, 1.2 * value))
    ax.set_ylabel(heading(dataset[name]))
    finish(figure, title, f"The {name} of the one case, with its 95\N{NO-BREAK SPACE}% error bar.", warning)
    return figure


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
