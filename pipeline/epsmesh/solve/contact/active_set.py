"""The active set of unilateral contact, by the primal-dual active-set method.

    u_z <= b,    r <= 0,    r (u_z - b) = 0    at each candidate node,

where b is the height of the pressed-in probe above the node, and r the reaction (K u along z). Active nodes have
u_z = b. A node with a tensile reaction leaves the set, a node that penetrates the probe enters it, until the set does
not change (M. Hintermüller, K. Ito and K. Kunisch, SIAM J. Optim. 13, 865, 2002).

A uniform pressure on quadratic facets has nodal forces at their mid nodes only, on cubic facets hardly any at their
corners. The sign of a corner's reaction then means nothing: a corner is active if all its neighbours along edges are.
Other corners follow the two conditions. (In :mod:`.deformed`, other corners of quadratic facets are inactive; F differs
by about 1e-4.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.contact.elements import ContactElements, State
from epsmesh.solve.contact.surface import Candidates
from epsmesh.stages import stage

# Tension below this share of the mean reaction, and penetration below this share of the depth, are solver error.
SLACK = 1e-6
# The largest number of sets seen is 14. Sets only repeated where the linear solver had been stopped early.
_MOST_SETS = 60


class ContactError(SolveError):
    """Contact not found, or not valid. Another linear solver does not help."""


@dataclass(frozen=True, eq=False)
class Found:
    """A converged active set and its solution; ``sets`` and ``iterations`` count the sets solved and all iterations."""

    active: BoolArray
    state: State
    sets: int
    iterations: int


@dataclass(frozen=True, eq=False)
class Obstacle:
    """The obstacle above the ``candidates``: their ``bounds`` (n, m) with the probe pressed in by ``depth`` (m)."""

    candidates: Candidates
    bounds: FloatArray
    depth: float

    def enclosed(self, active: BoolArray) -> BoolArray:
        """Return a mask of nodes below the tool with only ``active`` neighbours; beside it bounds are infinite."""
        return self.candidates.enclosed(active) & np.isfinite(self.bounds)


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
    """Return the converged active set from the initial guess ``active`` (n); collective.

    The ``tolerances`` are used in turn, the last one for the result. Each is an energy norm of the error, relative to
    the root of ``energy`` (J), of which an estimate will do. With ``roughly`` a set from a repeating cycle is accepted.

    Raises:
        SolveError: if the linear solver fails.
        ContactError: if sets repeat, or become empty.
    """
    count = iterations = 0
    active = active & np.isfinite(obstacle.bounds)  # guessed from larger elements, it may reach beside the tool
    elements.hold(active)
    for number, tolerance in enumerate(tolerances, start=1):
        seen = set[bytes]()
        while True:
            iterations += elements.improve(obstacle.bounds, tolerance, energy)
            count += 1
            state = elements.state()
            energy = state.energy
            following = next_set(obstacle, active, state)
            following |= obstacle.enclosed(following)
            if np.array_equal(following, active):
                break
            seen.add(active.tobytes())
            if count >= _MOST_SETS or following.tobytes() in seen:
                if roughly or number < len(tolerances):
                    break
                raise ContactError(f"the contact area does not settle: {count} active sets were tried")
            if not following.any():
                raise ContactError("the probe does not touch a single node: use smaller elements below it")
            active = following
            elements.hold(active)
    return Found(active, state, count, iterations)


def next_set(obstacle: Obstacle, active: BoolArray, state: State) -> BoolArray:
    """Return the next active set: active nodes under pressure, and inactive nodes that penetrate the probe."""
    pull = SLACK * float(np.abs(state.reactions[active]).mean())
    through = SLACK * obstacle.depth
    return np.where(active, state.reactions < pull, state.moved - obstacle.bounds > through)
