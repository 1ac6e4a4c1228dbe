"""What times are worth: whether others were using the machine, how far repeats are apart, and what was slower."""

import numpy as np
import xarray as xr

from epsmesh.printable import counted
from epsmesh.report.words import choices

# Processes for each core above which some of them wait: times are then longer than what was done.
LOADED = 1.1
# Repeats that differ by more than this share of their median say no more than the order of a time.
_SPREAD = 0.2


def doubts(dataset: xr.Dataset) -> list[str]:
    """Return what makes times and speed-ups of ``dataset`` doubtful, a sentence each, none if nothing does."""
    return [text for text in (_of_load(dataset), _of_spread(dataset), slower(dataset)) if text]


def doubtful(dataset: xr.Dataset) -> list[str]:
    """Return what makes times doubtful as whole sentences, for the caption of a figure of times."""
    return [f"{text[0].upper()}{text[1:]}." for text in doubts(dataset)]


def spreads(dataset: xr.Dataset, name: str) -> xr.DataArray | None:
    """Return the factor by which bars reach above and below ``time_total`` or ``speedup``: how far repeats are apart.

    That of a speed-up holds the full order's repeats as well, but for the full order itself. None where no case was
    repeated.
    """
    if "time_spread" not in dataset or not (dataset["time_spread"] > 0).any():
        return None
    factor = 1 + dataset["time_spread"].fillna(0.0) / 2
    if name == "time_total":
        return factor
    is_full = np.isinf(dataset["epsilon"])
    return (factor * factor.where(is_full).max("epsilon").fillna(1.0)).where(~is_full, 1.0)


def slower(dataset: xr.Dataset) -> str:
    """Say which cases took longer than the full order in spite of fewer unknowns, if any did."""
    if not {"speedup", "dofs", "epsilon"} <= {str(name) for name in (*dataset.data_vars, *dataset.dims)}:
        return ""
    full = np.isinf(dataset["epsilon"])
    if not bool(full.any()):
        return ""
    fewer = (dataset["dofs"] > 0) & (dataset["dofs"] < dataset["dofs"].where(full).max("epsilon"))
    found = dataset["speedup"].where(fewer & (dataset["speedup"] < 1))
    count = int(found.notnull().sum())
    if not count:
        return ""
    worst = found.where(found == found.min(), drop=True)
    case = choices(dataset, {str(dim): worst[dim].values[0] for dim in dataset["speedup"].dims})
    most = f"{'most of all ' * (count > 1)}{case}, {float(found.min()):.2g} ×"
    return f"fewer unknowns were slower than the full order: {counted(count, 'case')}, {most}"


def _of_load(dataset: xr.Dataset) -> str:
    """Say how many times were taken while more processes wanted to run than there are cores."""
    taken = np.isfinite(dataset["time_total"].values)
    if "machine_load" not in dataset or not taken.any():
        return ""
    load = dataset["machine_load"].values
    busy = taken & (load > LOADED)
    if not busy.any():
        return ""
    which = "all times were" if busy.sum() == taken.sum() else f"{busy.sum()} of {taken.sum()} times were"
    return f"{which} taken on a loaded machine (up to {load[busy].max():.1f} processes a core): speed-ups may be noise"


def _of_spread(dataset: xr.Dataset) -> str:
    if "time_spread" not in dataset or not (dataset["time_spread"] > _SPREAD).any():
        return ""
    return f"repeats of a case are up to {100 * float(dataset['time_spread'].max()):.0f} % apart"
