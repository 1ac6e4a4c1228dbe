"""The Pareto front: what nothing else beats in both cost and error, and which errors are small by chance alone."""

import numpy as np
import numpy.typing as npt
import xarray as xr

from epsmesh.arrays import IntArray
from epsmesh.quantities import QUANTITIES

# An error is one of chance where a finer mesh has one so many times as large: two errors cancel, or F passes F_exact.
_CHANCE = 1.5


def front(cost: npt.ArrayLike, error: npt.ArrayLike) -> IntArray:
    """Return the indices of what nothing else beats in both ``cost`` and ``error``, the cheapest first.

    Of equals the first one counts; what is not a number, or infinite, is not on it.
    """
    cost, error = np.asarray(cost, dtype=float), np.asarray(error, dtype=float)
    order = np.lexsort((error, cost))
    order = order[np.isfinite(cost[order]) & np.isfinite(error[order])]
    before = np.concatenate([[np.inf], np.minimum.accumulate(error[order])[:-1]]) if order.size else error[order]
    return order[error[order] < before]


def is_by_chance(error: xr.DataArray) -> xr.DataArray:
    """Tell of each relative ``error`` whether a mesh that is finer in some dimension, else the same, has a larger one.

    Such an error promises nothing for another scene, and has no place on a front.
    """
    kept = error
    for dim in map(str, error.dims):
        finest = QUANTITIES[dim].finest if dim in QUANTITIES else ""
        if finest:
            ordered = kept.sortby(dim, ascending=finest == "smallest")
            largest = np.fmax.accumulate(ordered.values, axis=ordered.get_axis_num(dim))
            kept = ordered.copy(data=largest).reindex_like(error)
    return kept > _CHANCE * error
