"""The active set of found contact: which nodes touch, by the primal-dual method.

    u_z <= b,    r <= 0,    r (u_z - b) = 0    at each candidate,

with b the height of the pressed-in probe above the node, and r the reaction (K u along z). Active nodes are held at b.
Nodes with a tensile reaction leave the set, nodes that penetrate the probe enter it, until the set does not change
(M. Hintermüller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 865, 2002).

An even pressure on quadratic facets loads their mid nodes alone, on cubic ones hardly their corners. The sign of a
corner's reaction then means nothing: a corner is active if all nodes beside it on its edges are.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve import SolveError
from pipeline.solve.contact.elements import ContactElements, State
from pipeline.solve.contact.surface import Candidates
from pipeline.stages import stage

# A pull below this share of the mean reaction, and a way through below this share of the depth, are the solver's error.
SLACK = 1e-6
# The most that was seen is 14, and no set came back but by the error of a solver that was stopped early.
_MOST_SETS = 60


class ContactError(SolveError):
    """Contact that was not found, or is not one: no other linear solver mends that."""


@dataclass(frozen=True, eq=False)
class Found:
    """A set that stays as it is, and its solution; ``sets`` were solved for it, with all their ``iterations``."""

    active: BoolArray
    state: State
    sets: int
    iterations: int


@dataclass(frozen=True, eq=False)
class Obstacle:
    """What is in the way of the ``candidates``: their ``bounds`` (n, m) with the probe pushed in by ``depth`` (m)."""

    candidates: Candidates
    bounds: FloatArray
    depth: float


@stage("contact sets")
def find_set(
    elements: ContactElements,
    obstacle: Obstacle,
    active: BoolArray,
    tolerances: Sequence[float],
    energy: float | None = None,
    *,
    roughly: bool = False,
) -> Found:
    """Return the set that ``active`` (n) leads to, solved to the last of the ``tolerances``; collective.

    Each of them is of the energy norm, relative to the root of an ``energy`` (J), known roughly. A set that is wanted
    ``roughly`` may be one of several that come back.

    Raises:
        SolveError: if the linear solver fails.
        ContactError: if sets come back, or become empty.
    """
    count = iterations = 0
    elements.hold(active)
    for number, tolerance in enumerate(tolerances, start=1):
        seen = set[bytes]()
        while True:
            iterations += elements.improve(obstacle.bounds, tolerance, energy)
            count += 1
            state = elements.state()
            energy = state.energy
            following = next_set(obstacle, active, state)
            following |= obstacle.candidates.enclosed(following)
            if np.array_equal(following, active):
                break
            seen.add(active.tobytes())
            if count >= _MOST_SETS or following.tobytes() in seen:
                if roughly or number < len(tolerances):
                    break
                raise ContactError(f"the contact area does not settle: {count} sets of nodes were tried")
            if not following.any():
                raise ContactError("the probe does not touch a single node: use smaller elements below it")
            active = following
            elements.hold(active)
    return Found(active, state, count, iterations)


def next_set(obstacle: Obstacle, active: BoolArray, state: State) -> BoolArray:
    """Return the nodes to hold next: the active ones that are pressed, the others that came through."""
    pull = SLACK * float(np.abs(state.reactions[active]).mean())
    through = SLACK * obstacle.depth
    return np.where(active, state.reactions < pull, state.moved - obstacle.bounds > through)
