"""Checks of contact at equilibrium that are independent of the loop that finds it, in two and in three dimensions."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve.balance import check_work
from epsmesh.solve.contact.active_set import ContactError
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.touching import ContactSolution, SteppedTissue
from epsmesh.solve.newton import LargeError


class StoringTissue(SteppedTissue, Protocol):
    """Tissue with ``displacements`` (n, d) of its nodes, and with its ``energy``; NaN if J <= 0."""

    def displacements(self) -> FloatArray: ...  # noqa: D102
    @property
    def energy(self) -> float: ...  # noqa: D102


def force_of(touched: ContactSolution) -> float:
    """Return the force on the tool along its axis, from the modelled part."""
    return -float(touched.forces[:, -1].sum())


def check_edge(ends_at: Callable[[FloatArray], BoolArray], candidates: Candidates, active: BoolArray) -> None:
    """Check that the contact of ``active`` nodes (n) ends within the candidates, or where the tool does: ``ends_at``.

    Raises:
        ContactError: if it reaches their edge elsewhere.
    """
    if not np.all(ends_at(candidates.points[active & candidates.is_edge])):
        raise ContactError(
            "the contact reaches the edge of the surface region that is searched for contact: "
            "use a smaller depth, or align the probe's axis with the surface normal"
        )


def check_support(fixed: BoolArray, gap: FloatArray) -> None:
    """Check that the tool does not reach the support, by its ``gap`` (n) above nodes, of which (n, d) are ``fixed``.

    Raises:
        ContactError: if it does.
    """
    if np.any(gap[fixed.all(axis=1)] < 0):
        raise ContactError("the probe reaches the fixed part of the body: no displacement satisfies both")


def check_energy(tissue: StoringTissue, touched: ContactSolution, change: float, rounding: float = 0.0) -> None:
    """Check that reactions do the work in a small ``change`` of the displacement, a share of it, that tissue stores.

    ``rounding`` is the error of energies. Collective.

    Raises:
        LargeError: if they do not.
    """
    state, work = tissue.state, float((touched.forces * tissue.displacements()).sum())
    energies = []
    for share in (1 + change, 1 - change):
        tissue.state = share * state
        energies.append(tissue.energy)
    tissue.state = state
    check_work(work, (energies[0], energies[1]), change, LargeError, rounding)
