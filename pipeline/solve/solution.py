"""What one solve gives, and what every kind of element needs to say it."""

from dataclasses import dataclass
from math import isfinite, nan
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from pipeline.mesh.distribute import BodyMesh
from pipeline.stages import stage

FloatArray = npt.NDArray[np.float64]

# F·d = 2U and F_probe + F_support = 0 hold for the exact solution of the discrete system, and are linear in the
# solver's error: what misses them by this much has not been solved.
BALANCE_LIMIT = 1e-6
# The energy norm of the solver's error, relative: F, which is quadratic in it, then has no error above 1e-9 up to
# ν = 0.49, and 1e-11 as a rule (docs/solvers.md).
TOLERANCE = 1e-6
# What a second round of iterations aims at, as a share of the limit, and the most by which it lowers the error.
_AIM, _MOST = 0.3, 1e-2


def rest(balance: float, tolerance: float) -> float:
    """Return the share of the solver's error that may remain where forces do not balance, 1 if it is small enough.

    It is, too, at a ``tolerance`` that was chosen loosely: that the forces do not balance is then no wonder.
    """
    if balance <= BALANCE_LIMIT or tolerance > TOLERANCE or not isfinite(balance):
        return 1.0
    return max(_AIM * BALANCE_LIMIT / balance, _MOST)


def needed_tolerance(travel: tuple[float, float, float], tolerance: float) -> float:
    """Return the tolerance to solve to: of a probe that slices, too, only the work is quadratic in the error."""
    return 1e-2 * tolerance if np.count_nonzero(travel) > 1 else tolerance


@dataclass(frozen=True)
class Solution:
    """What one solve gives; all values global and equal on every rank.

    ``reaction`` (N, xyz) is the force of the tissue on the probe, ``energy`` (J) the strain energy,
    ``balance`` the larger of the relative errors of F·d = 2U and of F_probe + F_support = 0. ``decrement`` is the
    share of the energy that one degree more takes away, s / F_p, and ``bar`` the relative 95 % error bar on F·d that
    comes of it, with ``plain``, the share of edges at the rim without quarter points (see :mod:`pipeline.solve.error`).
    """

    reaction: tuple[float, float, float]
    energy: float
    max_strain: float
    balance: float
    dofs: int
    iterations: int
    time_assemble: float
    time_setup: float
    time_solve: float
    decrement: float = nan
    bar: float = nan
    plain: float = nan
    estimate_iterations: int = 0
    time_estimate: float = 0.0


def global_sum(comm: MPI.Comm, values: FloatArray) -> FloatArray:
    """Return the sum of ``values`` over all ranks, entry by entry; collective."""
    total = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), total)
    return total


@stage("strain")
def principal_strains(mean_strain: tuple[Any, Any], body: BodyMesh) -> FloatArray:
    """Return the principal strains, ascending, of the strain averaged over each owned cell, shape (cells, 3).

    ``mean_strain`` are the forms of :func:`pipeline.solve.forms.mean_strain_form`. Collective.
    """
    integral, volume = (fem.assemble_vector(form) for form in mean_strain)
    tensors = [np.asarray(v.array).reshape(-1, 3, 3)[: body.owned_cells] for v in (integral, volume)]
    return np.asarray(np.linalg.eigvalsh(tensors[0] / tensors[1]))


def largest_strain(mean_strain: tuple[Any, Any], body: BodyMesh) -> float:
    """Return the largest of :func:`principal_strains`, by magnitude; collective."""
    local = float(np.abs(principal_strains(mean_strain, body)).max(initial=0.0))
    return float(body.comm.allreduce(local, op=MPI.MAX))
