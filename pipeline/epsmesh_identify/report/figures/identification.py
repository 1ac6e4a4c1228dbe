"""Figures of an identification: curves with their fit, residuals, and how well each unknown is known."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epsmesh.files import FIGURE_FORMATS
from epsmesh.report.figures.style import COLOURS, FAILED, LINE, QUIET, STYLE, finish, new_figure, save
from epsmesh.study.identified import FITS
from epsmesh_identify.report.identified import answer, bar, if_undeclared, readable, title, wanted

_WIDTH, _CURVES, _RESIDUALS, _PROFILES, _BESIDE = 4.8, 2.4, 1.2, 1.9, 1.4  # inches
_WIDER = 1.6  # as wide, of more than two curves side by side
# Curves and unknowns that are shown; all are in the dataset.
_MOST_CURVES, _MOST_PROFILES = 3, 4
_MEASURED, _FIT, _HIDDEN = COLOURS[1], COLOURS[4], COLOURS[3]
_MOST_POINTS = 400
_LINES = 300  # points of lines beside one another that fill a figure
_HELD = 0.02  # share of the depth within which a tool is held
_NORMAL = 3.84  # fall of the likelihood at the ends of a 95 % interval
_HIGHEST = 6.0
# Error bars, on both sides of the estimate, that a profile shows, and so many at most of the outer one.
_NEAR, _FAR = 1.3, 3.0
_LETTERS, _ROW = 30, 2  # letters of a line below a row of profiles, and how many are in one


def identification(dataset: xr.Dataset, name: str, *, answered: bool = True) -> Figure:
    """Measured forces, their fit, what is left, and profiles of the unknowns; the caption has the answer, too."""
    lines = answer(dataset) if answered else []
    return _of_files(dataset, name, lines) if "file" in dataset.dims else _of_curves(dataset, name, lines)


def draw(dataset: xr.Dataset, stem: Path, formats: Sequence[str] = FIGURE_FORMATS) -> list[Path]:
    """Draw the figure of an identification to ``<stem>.png`` and ``.svg``; return the files written."""
    with mpl.rc_context(STYLE):
        drawn = identification(dataset, str(dataset.attrs.get("title", "")).replace("$", r"\$"))
        return [save(drawn, stem.with_name(f"{stem.name}.{ending}")) for ending in formats]


def _of_curves(dataset: xr.Dataset, name: str, lines: Sequence[str]) -> Figure:
    shown = wanted(dataset)[:_MOST_PROFILES]
    shown = [one for one in shown if bool(np.isfinite(dataset["low"].sel(unknown=one)))]
    count = min(dataset.sizes["measurement"], _MOST_CURVES)
    rows = -(-len(shown) // _ROW)
    heights = [_CURVES + _RESIDUALS, *[_PROFILES] * rows]
    figure = new_figure(_WIDTH * (_WIDER if count > _ROW else 1), sum(heights) + _BESIDE)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    curves = grid[0].subgridspec(2, count, height_ratios=(_CURVES, _RESIDUALS))
    for number in range(count):
        one = dataset.isel(measurement=number)
        upper = figure.add_subplot(curves[0, number])
        lower = figure.add_subplot(curves[1, number], sharex=upper)
        _draw_curve(upper, lower, one, is_first=number == 0, fits=dataset.attrs["verdict"] == FITS)
        if count > 1:
            upper.set_title(str(one["measurement"].values))
    for number in range(rows):
        own = shown[_ROW * number : _ROW * (number + 1)]
        places = grid[1 + number].subgridspec(1, len(own))
        for column, unknown in enumerate(own):
            _draw_profile(figure.add_subplot(places[column]), dataset, unknown, len(own), is_first=column == 0)
    finish(figure, name, _caption(dataset, lines, count, bool(shown)), legend=False)
    figure.axes[0].legend(loc="best", frameon=False)
    return figure


def _draw_curve(upper: Axes, lower: Axes, one: xr.Dataset, *, is_first: bool, fits: bool) -> None:
    """Draw a curve and its fit in the ``upper`` axes, what is left in the ``lower``; over time if the tool holds."""
    known = np.flatnonzero(np.isfinite(one["force"].values))
    known = known[:: max(1, len(known) // _MOST_POINTS)]
    one = one.isel(sample=known)
    over_time = _holds(one)
    along = one["time" if over_time else "depth"].values
    to_unit, of_along = _unit(along, "s" if over_time else "m")
    along = to_unit * along
    factor, of_force = _unit(one["force"].values, "N")
    force, fit, band, residual = (factor * one[key].values for key in ("force", "fit", "band", "residual"))
    order = np.argsort(along)
    upper.plot(along, force, ".", color=_MEASURED, markersize=3, label="measured")
    upper.plot(along[order], fit[order], color=_FIT, label="fit")
    if fits:
        ends = (along[order], (fit - band)[order], (fit + band)[order])
        upper.fill_between(*ends, color=_FIT, alpha=0.25, linewidth=0, label="its 95 %")
    upper.tick_params(labelbottom=False)
    lower.plot(along, residual, ".", color=_MEASURED, markersize=2)
    lower.axhline(0, color=_FIT)
    lower.set_xlabel(f"time, {of_along}" if over_time else f"depth of the tool, {of_along}")
    if is_first:
        upper.set_ylabel(f"force, {of_force}")
        lower.set_ylabel(f"residual, {of_force}")


def _holds(one: xr.Dataset) -> bool:
    """Tell whether the tool is at its largest depth for a quarter of the time."""
    if "time" not in one or not bool(one["time"].notnull().all()):
        return False
    time, depth = one["time"].values, one["depth"].values
    at_end = time[depth > depth.max() - _HELD * np.ptp(depth)]
    return bool(np.ptp(at_end) > np.ptp(time) / 4)


def _draw_profile(ax: Axes, dataset: xr.Dataset, unknown: str, shown: int, *, is_first: bool) -> None:
    """Draw how much worse the fit is at other values of an unknown, with both error bars.

    An outer bar that goes further than the axis ends in an arrow.
    """
    one, unit = dataset.sel(unknown=unknown), str(dataset["unit"].sel(unknown=unknown).values)
    estimate, low, high = (float(one[name]) for name in ("estimate", "low", "high"))
    values, fall = _profile(one)
    factor, word = _unit(np.array([low, high]), unit)
    for end, colour in (("_hidden", _HIDDEN), ("", _MEASURED)):
        ends = [factor * float(one[f"{side}{end}"]) for side in ("low", "high")]
        if np.isfinite(ends).all():
            ax.axvspan(ends[0], ends[1], color=colour, alpha=0.25, linewidth=0)
    ax.plot(factor * values, fall, color=LINE)
    ax.axhline(_NORMAL, color=QUIET, linestyle=":")
    ax.axvline(factor * estimate, color=_FIT)
    ax.set_ylim(0, _HIGHEST)
    for side, bound in (("low", low), ("high", high)):
        outer = (float(one[f"{side}_hidden"]) - estimate) / (bound - estimate)
        most = min(max(_NEAR, _NEAR * outer if np.isfinite(outer) else 0.0), _FAR)
        edge = factor * (estimate + most * (bound - estimate))
        ax.set_xlim(**{"left" if side == "low" else "right": edge})
        if outer > most:
            ax.plot(edge, _HIGHEST / 2, "<" if side == "low" else ">", color=_HIDDEN, clip_on=False)
    bars = [textwrap.fill(line, _LETTERS // shown) for line in _bars(dataset, unknown)]
    ax.set_xlabel("\n".join([f"{title(unknown)}{f', {word}' if word else ''}", *bars]))
    ax.locator_params(axis="x", nbins=4)
    if is_first:
        ax.set_ylabel("misfit, −2 ln L/L_max")
    else:
        ax.tick_params(labelleft=False)


def _profile(one: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return values of an unknown and the fall of the likelihood there: without a profile, that of its error bar."""
    if "profile" in one and bool(one["profile"].notnull().any()):
        known = np.isfinite(one["profile"].values)
        return one["profile_value"].values[known], one["profile"].values[known]
    estimate, low, high = (float(one[name]) for name in ("estimate", "low", "high"))
    shares = np.linspace(-_NEAR, _NEAR, 101)
    return estimate + np.where(shares < 0, estimate - low, high - estimate) * shares, _NORMAL * shares**2


def _bars(dataset: xr.Dataset, unknown: str) -> list[str]:
    """Write both error bars, a line each."""
    if not bool(dataset["seen"].sel(unknown=unknown)):
        return ["not in the curves"]
    first, second = bar(dataset, unknown), bar(dataset, unknown, hidden=True)
    return [first, f"undeclared: {second}"] if second and second != first else [first]


def _caption(dataset: xr.Dataset, lines: Sequence[str], count: int, has_profiles: bool) -> str:
    """Return the answer, and what the panels show."""
    parts = [*lines[:2]]
    more = dataset.sizes["measurement"] - count
    parts += [f"The first {count} of {dataset.sizes['measurement']} curves are shown."] if more else []
    if has_profiles:
        hidden = if_undeclared(dataset)
        bars = "inner band: its 95 % error bar if the body is as declared"
        bars += f"; outer band, with an arrow where it goes further: {hidden}" if hidden else ""
        parts.append(f"Below: how much worse the best fit is at other values of an unknown ({bars}).")
    return " ".join(parts)


def _of_files(dataset: xr.Dataset, name: str, lines: Sequence[str]) -> Figure:
    """Draw each unknown of each file, in the order of their values, with both error bars."""
    shown = wanted(dataset)[:_MOST_PROFILES]
    figure = new_figure(_WIDTH, 2.4 * len(shown) + _BESIDE)
    axes = figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
    fits = (dataset["verdict"] == FITS).values
    order = np.argsort(dataset["estimate"].sel(unknown=shown[0]).values)
    place = np.arange(1, len(order) + 1)
    thick = float(np.clip(_LINES / len(order), 0.8, 2.5))
    for ax, unknown in zip(axes, shown, strict=True):
        one = dataset.sel(unknown=unknown).isel(file=order)
        good = fits[order]
        factor, unit = _unit(one["estimate"].values, str(one["unit"].values))
        values = factor * one["estimate"].values
        for end, colour in (("_hidden", _HIDDEN), ("", _MEASURED)):
            low, high = (factor * one[f"{side}{end}"].values for side in ("low", "high"))
            ax.vlines(place[good], low[good], high[good], color=colour, linewidth=thick * (0.6 if end else 1.0))
        ax.plot(place[good], values[good], ".", color=LINE, markersize=1.2 * thick)
        ax.plot(place[~good], values[~good], "x", color=FAILED)
        ax.set_ylabel(f"{title(unknown)}{f', {unit}' if unit else ''}")
    axes[-1].set_xlabel(f"files, in the order of {title(shown[0])}")
    hidden = if_undeclared(dataset)
    bars = "Thick lines: 95 % error bars if the body is as declared"
    bars += f"; thin ones: {hidden}." if hidden else "."
    failed = " Crosses: the law does not fit." if not fits.all() else ""
    finish(figure, name, " ".join([*lines[:1], f"{bars}{failed}"]), legend=False)
    return figure


def _unit(values: np.ndarray, unit: str) -> tuple[float, str]:
    return readable(float(np.nanmax(np.abs(values))), unit)
