"""The excess of a force over that on a healthy body, and the centre that was found of it."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from pipeline.report.figures.map import draw_map
from pipeline.report.figures.style import CLAIM, LINE, look


def draw_excess(ax: Axes, excess: xr.DataArray, bar: xr.DataArray, point: tuple[float, float, float]) -> Any:
    """Draw the ``excess`` (%) on ``ax``: a map of a raster, with a dot where it is beyond its ``bar``, or a curve.

    ``point`` (m) is marked. Return what has colours, None of a curve.
    """
    if excess.ndim == 1:
        (dim,) = excess.dims
        ax.errorbar(1e3 * excess[dim], 100 * excess, 100 * bar, capsize=2, elinewidth=0.8, **look(1))
        ax.axhline(0.0, color=LINE, linewidth=0.7)
        ax.set_xlabel("length along the path, mm")
        ax.set_ylabel("excess of F, %")
        return None
    seen = excess.transpose("y", "x")
    beyond = (excess > bar).transpose("y", "x")
    status = xr.where(np.isfinite(seen), "ok", "failed").rename("status")
    drawn = draw_map(ax, xr.Dataset({"status": status}), 100 * seen.values)
    rows, columns = np.nonzero(beyond.values)
    x, y = 1e3 * seen["x"].values, 1e3 * seen["y"].values
    ax.plot(x[columns], y[rows], ".", color="white", markersize=3, label="beyond the error bars")
    ax.plot(1e3 * point[0], 1e3 * point[1], "+", color=CLAIM, markersize=12, markeredgewidth=2, label="centre")
    ax.set_xlabel("x, mm")
    ax.set_ylabel("y, mm")
    return drawn
