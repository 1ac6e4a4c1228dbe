"""The force against everything that a study sweeps, and what there is to say where no case has one."""

import textwrap
from collections import Counter

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.figures.layout import arrange
from pipeline.report.figures.panels import Panel, draw_curves
from pipeline.report.figures.style import FAILED, QUIET, finish, look, new_figure
from pipeline.report.figures.text import width_of, wrapped
from pipeline.report.words import choices, heading

_COLUMNS, _MOST_PANELS, _MOST_CURVES = 3, 6, 4
_LEGEND_ROW = 0.1  # of a panel's height
_HANDLE = 0.6  # inches
_AT, _NAMES = 7.0, 6.5  # points


def force(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """The force with its error bar, one panel for each swept quantity, the others at the values that it names."""
    swept = [str(dim) for dim in dataset["force"].dims if dataset.sizes[dim] > 1]
    dims = swept[:_MOST_PANELS] or [str(dim) for dim in dataset["force"].dims[:1]]
    columns = 2 if len(dims) == 4 else min(max(len(dims), 1), _COLUMNS)
    rows = -(-max(len(dims), 1) // columns)
    figure = new_figure({1: 4.8, 2: 6.4}.get(columns, 8.4), 2.6 * rows + 0.7)
    axes = figure.subplots(rows, columns, squeeze=False)
    for ax in axes.ravel()[max(len(dims), 1) :]:
        ax.remove()
    width = figure.get_figwidth() / columns - 0.6
    parts = [_draw_against(ax, dataset, dim, width) for dim, ax in zip(dims, axes.ravel(), strict=False)]
    drawn = axes.ravel()[: len(dims)]
    top = max((ax.get_ylim()[1] for ax in drawn), default=0.0)
    for ax in drawn:  # a glance compares panels
        ax.set_ylim(min(ax.get_ylim()[0] for ax in drawn), top)
    if not dims:
        _draw_one(axes[0, 0], dataset)
    for ax in axes[:, 0]:
        ax.set_ylabel(heading(dataset["force"]))
    known = dict.fromkeys(words for part in parts for words in part)
    left_out = [f"curves: {', '.join(known)}"] if known else []
    left_out += [f"not shown: against {', '.join(swept[_MOST_PANELS:])}"] if swept[_MOST_PANELS:] else []
    finish(figure, title, "; ".join(("bars: 95 % error bars", *left_out)), warning, legend=False)
    return figure


def _draw_against(ax: Axes, dataset: xr.Dataset, dim: str, width: float) -> tuple[str, ...]:
    """Draw the force against one dimension; return which values of the curves' are left out, in words."""
    layout = arrange(dataset, ("force",), dim, most=(_MOST_CURVES, 1, 1))
    panel = Panel(ax, dataset.sel(layout.at), "force", "", width, column=0, is_last=True)
    draw_curves(panel, layout, factor=1e3, errors="force_error")
    if layout.fixed:
        words = f"at {choices(dataset, layout.fixed).removeprefix('at ')}"
        ax.set_title(wrapped(words, width, _AT, most=3), fontsize=_AT, color=QUIET)
    _from_zero(ax)
    if len(layout.curves) > 1:
        _write_legend(ax, width)
    return layout.part


def _write_legend(ax: Axes, width: float) -> None:
    """Name the curves above them, in two columns where two fit ``width`` inches."""
    handles, texts = ax.get_legend_handles_labels()
    texts = [wrapped(text, width - _HANDLE, _NAMES, most=1) for text in texts]
    columns = 2 if 2 * (_HANDLE + max((width_of(text, _NAMES) for text in texts), default=0.0)) < width else 1
    rows = -(-len(texts) // columns)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + (high - low) * _LEGEND_ROW * rows / (1 - _LEGEND_ROW * rows))
    look_of = {"fontsize": _NAMES, "frameon": False, "handlelength": 1.6, "columnspacing": 1.0}
    ax.legend(handles, texts, loc="upper center", ncol=columns, **look_of)


def _draw_one(ax: Axes, dataset: xr.Dataset) -> None:
    value = 1e3 * float(dataset["force"])
    bar = np.nan_to_num(abs(value) * float(dataset["force_error"]))
    ax.errorbar([0], [value], [bar], capsize=3, linestyle="none", **look(0))
    ax.set_xticks([0], [f"{value:.4g} mN ± {100 * float(dataset['force_error']):.2g} %"])
    _from_zero(ax)


def _from_zero(ax: Axes) -> None:
    """Let the axis begin at zero, where forces are positive: a small change then looks small."""
    low, high = ax.get_ylim()
    if high > 0 and low > -0.05 * high:
        ax.set_ylim(0, 1.02 * high)


def nothing(dataset: xr.Dataset, title: str, warning: str) -> Figure:
    """Say, where no case has a force, how many failed and of what."""
    states = Counter(map(str, dataset["status"].values.ravel()))
    messages = Counter(str(m) for m in dataset["message"].values.ravel() if m)
    lines = [f"No case has a force: {', '.join(f'{count} {state}' for state, count in states.items())}."]
    lines += [f"{count} ×  {message}" for message, count in messages.most_common(4)]
    text = "\n".join(textwrap.fill(line, 62, subsequent_indent="      ") for line in lines)
    figure = new_figure(4.8, 1.0 + 0.17 * text.count("\n"))
    figure.text(0.04, 0.5, text, va="center", color=FAILED)
    finish(figure, title)
    return figure
