"""An insertion in words: its punctures, the force while cutting, and the balance of energies."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from epsmesh.insertion.steps import INDENTATION, PHASES
from epsmesh.quantities import write
from epsmesh.report.values import punctures
from epsmesh.report.words import barred, decimals


def answer(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the lines that tell of each insertion of a dataset."""
    dims = list(dataset["status"].dims)
    for index in np.ndindex(*dataset["status"].shape):
        one = dataset.isel(dict(zip(dims, index, strict=True)))
        where = ", ".join(f"{dim} = {write(str(dim), one[dim].item(), one[dim].attrs.get('units'))}" for dim in dims)
        yield from (f"{where}: {line}" if where else line for line in _lines(one))


def _lines(dataset: xr.Dataset) -> Iterator[str]:
    back = dataset.isel(stroke=-1) if "stroke" in dataset.dims else None
    whole, dataset = dataset, dataset.isel(stroke=0) if back is not None else dataset
    reached = dataset.isel(depth=np.flatnonzero(np.isfinite(dataset["force"].values)))
    if message := str(dataset["message"].values):
        yield f"the path ends early, at {message}" if reached.sizes["depth"] else f"no path: {message}"
    if not reached.sizes["depth"]:
        return
    last = reached.isel(depth=-1)
    pierced = punctures(dataset)
    for number in pierced["puncture"].values:
        one = pierced.sel(puncture=number)
        depth, bar, force, of_force = (
            1e3 * float(one[f"puncture_{name}{end}"]) for name in ("depth", "force") for end in ("", "_error")
        )
        where = f" of layer {number}" if number > 1 else ""
        yield f"puncture{where} at {barred(depth, bar, 'mm')}, F = {barred(force, of_force, 'mN')}"
    if not pierced.sizes["puncture"]:
        yield f"the tissue stays whole down to {write('depth', float(last['depth']))}: F is {_last(last)}"
    elif PHASES[int(last["phase"])] == INDENTATION:
        yield f"a tougher layer is indented down to {write('depth', float(last['depth']))}: F is {_last(last)}"
    else:
        places = decimals(*(1e3 * float(last[name]) for name in ("force", "force_error")))
        parts = ", ".join(
            f"{part} {1e3 * float(last[f'force_{part}']):.{places}f}" for part in ("elastic", "cutting", "friction")
        )
        yield f"cutting at {write('depth', float(last['depth']))}: F = {_force(last)} (in mN: {parts})"
    if back is not None and bool(np.isfinite(back["force"]).any()):
        pulled = back.isel(depth=np.flatnonzero(np.isfinite(back["force"].values)))
        first, end, least = (_force(pulled.isel(depth=at)) for at in (-1, 0, int(pulled["force"].argmin())))
        further = "" if least in (first, end) else f"; its least value is {least}"
        yield f"withdrawal: F begins at {first} and ends at {end}{further}"
    worst = float(np.nanmax(np.abs(whole["energy_balance"].values)))
    yield f"work is stored energy + fracture + friction within {100 * worst:.2g} %"


def _last(step: xr.Dataset) -> str:
    """Return the force at the last step, and where load steps ended beyond it."""
    depth, force = (float(step[f"{name}_reached"]) for name in ("depth", "force"))
    further = f", and {1e3 * force:.4g} mN at {1e3 * depth:.4g} mm, the last depth solved" if np.isfinite(depth) else ""
    return f"{_force(step)} there{further}"


def _force(step: xr.Dataset) -> str:
    return barred(1e3 * float(step["force"]), 1e3 * float(step["force_error"]), "mN")
