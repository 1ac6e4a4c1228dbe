"""Figure of Sobol's indices: of each output, what each parameter makes alone, and with the others."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.files import FIGURE_FORMATS
from epsmesh.quantities import symbol
from epsmesh.report.figures.style import COLOURS, LINE, STYLE, WIDTH, finish, new_figure, save
from epsmesh_identify.report.sensitivity import ordered, range_of

# Inches: a panel without its bars, and the bars of a parameter.
_PANEL, _ROW = 1.1, 0.42
_BAR = 0.36
_CAPTION = (
    "Share of the variance over the ranges given: alone, what would vanish if only this parameter were known; in all, "
    "what would be left if all others were known. Black: 95 % error bars of sample and surrogate."
)


def draw(dataset: xr.Dataset, stem: Path, formats: Sequence[str] = FIGURE_FORMATS) -> list[Path]:
    """Draw the indices into ``<stem>.png`` and ``.svg``, and return the files."""
    with mpl.rc_context(STYLE):
        figure = sensitivity(dataset)
        return [save(figure, stem.with_name(f"{stem.name}.{suffix}")) for suffix in formats]


def sensitivity(dataset: xr.Dataset) -> Figure:
    """Sobol's indices of every output, a panel each, the parameter that matters most on top."""
    count = dataset.sizes["output"]
    figure = new_figure(WIDTH, count * (_PANEL + _ROW * dataset.sizes["parameter"]))
    for number, ax in enumerate(np.ravel(figure.subplots(count, 1, sharex=True))):
        _panel(ax, dataset.isel(output=number))
    figure.axes[-1].set_xlabel("share of the variance, %")
    finish(figure, str(dataset.attrs.get("title", "")).replace("$", r"\$"), _CAPTION)
    return figure


def _panel(ax: Axes, one: xr.Dataset) -> None:
    found = ordered(one)
    rows = np.arange(found.sizes["parameter"])
    for kind, label, side, colour in (("first", "alone", -1, COLOURS[1]), ("total", "in all", 1, COLOURS[0])):
        share, bar = 100 * found[kind].values, 100 * found[f"{kind}_error"].values
        ends = share - np.maximum(share - bar, 0), np.minimum(share + bar, 100) - share
        xerr = np.maximum(ends, 0)
        ax.barh(rows + side * _BAR / 2, share, _BAR, label=label, color=colour, xerr=xerr, ecolor=LINE)
    names = [found.isel(parameter=row) for row in rows]
    ax.set_yticks(rows, [f"{name['parameter'].values}\n{range_of(name)}" for name in names])
    ax.invert_yaxis()
    ax.set_xlim(0, 105)
    ax.set_ylabel(f"parameters of {symbol(str(one['output'].values))}")
