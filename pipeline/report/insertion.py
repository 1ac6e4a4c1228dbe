"""An insertion in words: its puncture, the force while cutting, and the balance of energies."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from pipeline.quantities import write


def answer(dataset: xr.Dataset) -> list[str]:
    """Return the lines that tell of an insertion."""
    return list(_lines(dataset))


def _lines(dataset: xr.Dataset) -> Iterator[str]:
    back = dataset.isel(direction=-1, depth=-1) if "direction" in dataset.dims else None
    whole, dataset = dataset, dataset.isel(direction=0) if back is not None else dataset
    last = dataset.isel(depth=-1)
    if np.isnan(float(dataset["puncture_depth"])):
        yield f"the tissue stays whole down to {write('depth', float(last['depth']))}: F is {_force(last)} there"
    else:
        depth, bar = (write("depth", round(float(dataset[f"puncture_depth{end}"]), 8)) for end in ("", "_error"))
        force, of_force = (1e3 * float(dataset[f"puncture_force{end}"]) for end in ("", "_error"))
        yield f"puncture at {depth} ± {bar}, F = {force:.4g} ± {of_force:.2g} mN"
        parts = ", ".join(
            f"{part} {1e3 * float(last[f'force_{part}']):.4g}" for part in ("elastic", "cutting", "friction")
        )
        yield f"cutting at {write('depth', float(last['depth']))}: F = {_force(last)} (in mN: {parts})"
    if back is not None:
        pulled = whole.isel(direction=-1)["force"]
        yield (
            f"withdrawal: F from {1e3 * float(pulled[-1]):.4g} to {1e3 * float(pulled[0]):.4g} mN, at least "
            f"{1e3 * float(pulled.values.min()):.4g} mN"
        )
    worst = float(np.abs(whole["balance"].values).max())
    yield f"work is stored energy + fracture + friction within {100 * worst:.2g} %"
    if message := str(dataset.attrs["message"]):
        yield f"the path ends early, at {message}"


def _force(step: xr.Dataset) -> str:
    return f"{1e3 * float(step['force']):.4g} ± {1e3 * float(step['force_error']):.2g} mN"
