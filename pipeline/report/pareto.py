"""The Pareto front: what nothing else beats in both cost and error."""

import numpy as np
import numpy.typing as npt

from pipeline.arrays import IntArray


def front(cost: npt.ArrayLike, error: npt.ArrayLike) -> IntArray:
    """Return the indices of what nothing else beats in both ``cost`` and ``error``, the cheapest first.

    Of equals the first one counts; what is not a number, or infinite, is not on it.
    """
    cost, error = np.asarray(cost, dtype=float), np.asarray(error, dtype=float)
    order = np.lexsort((error, cost))
    order = order[np.isfinite(cost[order]) & np.isfinite(error[order])]
    before = np.concatenate([[np.inf], np.minimum.accumulate(error[order])[:-1]]) if order.size else error[order]
    return order[error[order] < before]
