"""Figures of an identification: curves with their fit, residuals, and how well each unknown is known."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.files import FIGURE_FORMATS
from pipeline.report.figures.style import COLOURS, FAILED, LINE, QUIET, STYLE, finish, new_figure, save
from pipeline.report.identified import answer, bar, engineering, hidden_words, title, wanted
from pipeline.study.identified import FITS

_WIDTH, _CURVES, _RESIDUALS, _PROFILES, _BESIDE = 7.6, 2.4, 1.2, 1.9, 1.4  # inches
# Curves and unknowns that are shown; all are in the dataset.
_MOST_CURVES, _MOST_PROFILES = 3, 4
_MEASURED, _FIT, _HIDDEN = COLOURS[1], COLOURS[4], COLOURS[3]
_MOST_POINTS = 400
_NORMAL = 3.84  # fall of the likelihood at the ends of a 95 % interval
_HIGHEST = 12.0


def identification(dataset: xr.Dataset, name: str) -> Figure:
    """Measured forces and their fit, what is left, and the profiles of the unknowns."""
    return _of_files(dataset, name) if "file" in dataset.dims else _of_curves(dataset, name)


def draw(dataset: xr.Dataset, stem: Path, formats: Sequence[str] = FIGURE_FORMATS) -> list[Path]:
    """Draw the figure of an identification to ``<stem>.png`` and ``.svg``; return the files written."""
    with mpl.rc_context(STYLE):
        drawn = identification(dataset, str(dataset.attrs.get("title", "")).replace("$", r"\$"))
        return [save(drawn, stem.with_name(f"{stem.name}.{ending}")) for ending in formats]


def _of_curves(dataset: xr.Dataset, name: str) -> Figure:
    shown = wanted(dataset)[:_MOST_PROFILES]
    shown = [one for one in shown if "profile" in dataset and dataset["profile"].sel(unknown=one).notnull().any()]
    count = min(dataset.sizes["measurement"], _MOST_CURVES)
    heights = [_CURVES, _RESIDUALS, *([_PROFILES] if shown else [])]
    figure = new_figure(_WIDTH, sum(heights) + _BESIDE)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    curves, residuals = grid[0].subgridspec(1, count), grid[1].subgridspec(1, count)
    for number in range(count):
        one = dataset.isel(measurement=number)
        upper = figure.add_subplot(curves[number])
        lower = figure.add_subplot(residuals[number], sharex=upper)
        _draw_curve(upper, lower, one, is_first=number == 0)
        if count > 1:
            upper.set_title(str(one["measurement"].values))
    if shown:
        row = grid[2].subgridspec(1, len(shown))
        for number, unknown in enumerate(shown):
            _draw_profile(figure.add_subplot(row[number]), dataset, unknown, is_first=number == 0)
    finish(figure, name, _caption(dataset, count, bool(shown)), legend=False)
    figure.axes[0].legend(loc="upper left", frameon=False)
    return figure


def _draw_curve(upper: Axes, lower: Axes, one: xr.Dataset, *, is_first: bool) -> None:
    """Draw a curve and its fit in the ``upper`` axes, and what is left in the ``lower``."""
    known = np.flatnonzero(np.isfinite(one["force"].values))
    known = known[:: max(1, len(known) // _MOST_POINTS)]
    one = one.isel(sample=known)
    depth, of_depth = _scaled(one["depth"].values, "m")
    largest, of_force = _scaled(one["force"].values, "N")
    factor = float(largest[-1] / one["force"].values[-1]) if one["force"].values[-1] else 1.0
    fit, band, residual = (factor * one[key].values for key in ("fit", "band", "residual"))
    order = np.argsort(depth)
    upper.plot(depth, largest, ".", color=_MEASURED, markersize=3, label="measured")
    upper.plot(depth[order], fit[order], color=_FIT, label="fit")
    upper.fill_between(
        depth[order], (fit - band)[order], (fit + band)[order], color=_FIT, alpha=0.25, linewidth=0, label="its 95 %"
    )
    upper.tick_params(labelbottom=False)
    lower.plot(depth, residual, ".", color=_MEASURED, markersize=2)
    lower.axhline(0, color=_FIT)
    lower.set_xlabel(f"depth of the tool, {of_depth}")
    if is_first:
        upper.set_ylabel(f"force, {of_force}")
        lower.set_ylabel(f"residual, {of_force}")


def _draw_profile(ax: Axes, dataset: xr.Dataset, unknown: str, *, is_first: bool) -> None:
    """Draw how much worse the fit is at other values of an unknown, with both error bars."""
    one = dataset.sel(unknown=unknown)
    known = np.isfinite(one["profile"].values)
    values, unit = _scaled(one["profile_value"].values[known], str(one["unit"].values))
    factor = _factor(one["profile_value"].values[known], str(one["unit"].values))
    for end, colour in (("_hidden", _HIDDEN), ("", _MEASURED)):
        low, high = (factor * float(one[f"{side}{end}"]) for side in ("low", "high"))
        if np.isfinite(low) and np.isfinite(high):
            ax.axvspan(low, high, color=colour, alpha=0.25, linewidth=0)
    ax.plot(values, one["profile"].values[known], color=LINE)
    ax.axhline(_NORMAL, color=QUIET, linestyle=":")
    ax.axvline(factor * float(one["estimate"]), color=_FIT)
    ax.set_ylim(0, _HIGHEST)
    ax.set_xlabel(f"{title(unknown)}{f', {unit}' if unit else ''}")
    ax.set_title(bar(dataset, unknown) if bool(one["seen"]) else "not in the curves")
    ax.locator_params(axis="x", nbins=4)
    if is_first:
        ax.set_ylabel("misfit, −2 ln L/L_max")
    else:
        ax.tick_params(labelleft=False)


def _caption(dataset: xr.Dataset, count: int, has_profiles: bool) -> str:
    """Return the answer, and what the panels show."""
    parts = [*answer(dataset)[:2]]
    more = dataset.sizes["measurement"] - count
    parts += [f"The first {count} of {dataset.sizes['measurement']} curves are shown."] if more else []
    if has_profiles:
        hidden = hidden_words(dataset)
        bars = "inner band: its 95 % error bar if the body is as declared"
        bars += f"; outer band: if it may hide {hidden}" if hidden else ""
        parts.append(f"Below: how much worse the best fit is at other values of an unknown ({bars}).")
    return " ".join(parts)


def _of_files(dataset: xr.Dataset, name: str) -> Figure:
    """Draw each unknown of each file, in the order of their values, with both error bars."""
    shown = wanted(dataset)[:_MOST_PROFILES]
    figure = new_figure(_WIDTH, 2.4 * len(shown) + _BESIDE)
    axes = figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
    fits = (dataset["verdict"] == FITS).values
    order = np.argsort(dataset["estimate"].sel(unknown=shown[0]).values)
    place = np.arange(1, len(order) + 1)
    for ax, unknown in zip(axes, shown, strict=True):
        one = dataset.sel(unknown=unknown).isel(file=order)
        good = fits[order]
        values, unit = _scaled(one["estimate"].values, str(one["unit"].values))
        factor = _factor(one["estimate"].values, str(one["unit"].values))
        for end, colour in (("_hidden", _HIDDEN), ("", _MEASURED)):
            low, high = (factor * one[f"{side}{end}"].values for side in ("low", "high"))
            ax.vlines(place[good], low[good], high[good], color=colour, linewidth=1.5 if end else 2.5)
        ax.plot(place[good], values[good], ".", color=LINE)
        ax.plot(place[~good], values[~good], "x", color=FAILED)
        ax.set_ylabel(f"{title(unknown)}{f', {unit}' if unit else ''}")
    axes[-1].set_xlabel(f"files, in the order of {title(shown[0])}")
    hidden = hidden_words(dataset)
    bars = "Thick lines: 95 % error bars if the body is as declared"
    bars += f"; thin ones: if it may hide {hidden}." if hidden else "."
    failed = " Crosses: the law does not fit." if not fits.all() else ""
    finish(figure, name, f"{answer(dataset)[0]} {bars}{failed}", legend=False)
    return figure


def _factor(values: np.ndarray, unit: str) -> float:
    """Return the factor from SI to the unit with a prefix that suits the largest value."""
    if unit in ("", "1"):
        return 1.0
    largest = float(np.nanmax(np.abs(values)))
    word = engineering(largest, unit, 12).split(" ")[0]
    return float(word) / largest if largest else 1.0


def _scaled(values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """Return values in that unit, and its name."""
    if unit in ("", "1"):
        return values, ""
    word = engineering(float(np.nanmax(np.abs(values))), unit).split(" ")[1]
    return _factor(values, unit) * values, word
