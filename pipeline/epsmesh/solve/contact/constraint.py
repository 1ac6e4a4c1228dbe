"""The constraint of a Newton step at the nodes of a contact."""

from dataclasses import dataclass

from epsmesh.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Constraint:
    """Constraint of one Newton step at n nodes, in d coordinates.

    ``frames`` (n, d, d) have the tangents and, in the last column, the tool's normal. ``held`` (n, d) are the slots of
    the frames whose displacement is prescribed, to ``values`` (n, d), m. ``turning`` (n, d, d), N/m, is λ H, which is
    subtracted from the tangent. ``forces`` (n, d), N, act on the nodes besides the reactions.
    """

    frames: FloatArray
    held: BoolArray
    values: FloatArray
    turning: FloatArray
    forces: FloatArray
