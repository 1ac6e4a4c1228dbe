"""The error bars of an identified material, passed on to forces: `force_uncertainty`, beside `force_error`."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from pipeline.plan.plan import Plan
from pipeline.quantities import attributes
from pipeline.report.words import percent

NAME = "force_uncertainty"


def force_uncertainty(plan: Plan, force: xr.DataArray, force_of: Callable[[Plan], xr.DataArray]) -> xr.DataArray:
    """Return half the 95 % interval (N) of each force by the bars of the material.

    Each parameter moves F by half of what lies between the ends of its bar. These parts add up as correlated errors
    do: U² = Σ c_ij p_i p_j. Where an end could not be computed, the other one counts twice. ``force_of`` returns the
    forces of a plan.
    """
    found, parts = plan.study.identified, []
    for end in plan.ends:
        low, high = (_like(force_of(one), force) if one else force for one in (end.low, end.high))
        once = (high - low) / 2
        parts.append(once if end.low and end.high else 2 * once)
    stacked = np.stack([part.transpose(*force.dims).values for part in parts])
    squares = np.einsum("i...,ij,j...->...", stacked, np.array(found.correlation), stacked)
    bar = force.copy(data=np.sqrt(np.maximum(squares, 0)))
    comment = f"{', '.join(found.unknown)} from {found.file}"
    return bar.assign_attrs(attributes(NAME) | {"comment": comment}).rename(NAME)


def _like(force: xr.DataArray, other: xr.DataArray) -> xr.DataArray:
    """Return a force at the times of another: those of a history depend on how the tissue relaxes."""
    return force.interp(time=other["time"]) if "time" in other.dims else force


def tissue(dataset: xr.Dataset) -> str:
    """Say how the mesh's error compares with what is not known of the tissue; "" if its material was not identified."""
    if NAME not in dataset:
        return ""
    force, bar, mesh = (abs(dataset[name]).values for name in ("force", NAME, "force_error"))
    known = np.isfinite(bar) & np.isfinite(mesh) & (force > 0) & (bar > 0)
    if not known.any():
        return "The bars of the tissue's parameters are not computed: run the study."
    share = float(np.max(mesh[known] / bar[known]))
    what = f"F is ± {percent(float(np.max(bar[known] / force[known])))} by the tissue ({dataset[NAME].comment})"
    if share < 1:
        return f"{what}: the mesh is {percent(share)} of what you do not know."
    return f"{what}, which is less than the mesh: its error bar is {share:.2g} times as large."
