"""One unknown more: how much of the far field (:mod:`pipeline.solve.far_field`) a cut face is moved by.

With K the stiffness of a unit of the tool's movement (0) and a unit of the far field (1), that of what is beyond the
cut added to K₁₁, the energy is stationary where the share s of the field is -K₁₀ / K₁₁; the force is K₀₀ + s K₀₁. The
work of the tool is then that of both sides of the cut together, F d = 2 (U within + U beyond).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.linear import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.reaction import Response
from pipeline.solve.solution import check_balance

# The work of both sides of a cut balances where each motion's does to this share of what is asked of it.
TWO_SIDED = 0.1


def energy_beyond(loads: Loads, mu: float, mirrored: Sequence[int]) -> FloatArray | float:
    """Return twice the strain energies (n, n), by pairs of motions, beyond the cut face of the part modelled."""
    if loads.far is None:
        return 0.0
    return np.outer(loads.shares, loads.shares) * loads.far.stiffness(mu) / 2.0 ** len(mirrored)


def far_share(response: Response) -> float:
    """Return how much of the far field goes with a unit of the tool's movement.

    Raises:
        SolveError: if the tool's movement has none.
    """
    share = -float(response.stiffness[1, 0] / response.stiffness[1, 1])
    if not np.isfinite(share):
        raise SolveError("the far field is not a number")
    return share


def balanced(response: Response) -> Response:
    """Return the response of tool and far field together, its balance with F d = 2 (U within + U beyond).

    Raises:
        SolveError: if that does not hold.
    """
    force, taken = float(response.forces[0, 2]), float(response.stiffness[0, 0])
    balance = max(response.balance, abs(force - taken) / taken)
    check_balance(balance)
    return replace(response, balance=balance)
