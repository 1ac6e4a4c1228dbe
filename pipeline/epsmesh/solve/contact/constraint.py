"""The constraint of a Newton step at the nodes of a contact."""

from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray

# Free residual at equilibrium, in units of the contact forces.
LEFT = 1e-8


@dataclass(frozen=True, eq=False)
class Sliding:
    """Friction of the ``nodes`` (n) that slide, linearised: ``slope`` λ + ``turning`` T.

    λ (N) is the normal reaction, and T = R − c s the trial traction with the reaction R, the ``penalty`` c (n), N/m,
    and the slip s, now ``slips`` (n, d), m. ``slope`` (n, d) and ``turning`` (n, d, d) are along the tangents.
    """

    nodes: BoolArray
    slope: FloatArray
    turning: FloatArray
    penalty: FloatArray
    slips: FloatArray


@dataclass(frozen=True, eq=False)
class Constraint:
    """Constraint of one Newton step at n nodes, in d coordinates.

    ``frames`` (n, d, d) have the tangents and, in the last column, the tool's normal. ``held`` (n, d) are the slots of
    the frames whose displacement is prescribed, to ``values`` (n, d), m. ``turning`` (n, d, d), N/m, is λ H, which is
    subtracted from the tangent. ``forces`` (n, d), N, act on the nodes besides the reactions; where they are friction,
    ``sliding`` is how they follow the reactions, for tissue that can solve for both. ``is_there``: held slots are next
    to where they are held. ``resting`` (n) are the nodes above a bed: None if there is none. ``is_tried``: the set of
    held nodes still changes. A residual of the share ``left`` of the forces is enough in the end.
    """

    frames: FloatArray
    held: BoolArray
    values: FloatArray
    turning: FloatArray
    forces: FloatArray
    sliding: Sliding | None = None
    is_there: bool = False
    resting: BoolArray | None = None
    is_tried: bool = False
    left: float = LEFT

    @property
    def is_turned(self) -> bool:
        """Whether frames or turns change the operator."""
        return bool(self.turning.any() or (self.frames != np.eye(self.frames.shape[-1])).any())

    @property
    def firm(self) -> BoolArray | None:
        """The nodes (n) above a bed that are held along all axes: where nothing else holds the body, these do."""
        if self.resting is None:
            return None
        return np.asarray(self.resting & self.held.all(axis=1))

    def sticking(self, nodes: BoolArray, moves: FloatArray) -> "Constraint":
        """Return it with the tangents of ``nodes`` (n) held, too: they go along them by their parts of ``moves``
        (n, d), m."""
        held, values = self.held.copy(), self.values.copy()
        along = np.einsum("nji,nj->ni", self.frames, moves)
        held[nodes, :-1] = True
        values[nodes, :-1] = along[nodes, :-1]
        return replace(self, held=held, values=values)
