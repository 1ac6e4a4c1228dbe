"""From where a case is looked at: the plane that opens its body through the contact, and the direction of the eye."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Frame

_UP = np.array((0.0, 0.0, 1.0))
# The cut is y = 0 or x = 0, turned so that it holds the axis, unless that turns it by more; it is then vertical.
_NEARLY = 0.35
# From where the picture is taken: in front of the cut, beside it, out of the tissue.
_FROM = (1.0, 0.45, 0.6)
# Where the side would be seen from below by more than 30 degrees, the eye goes to the other one.
_BELOW = -0.5


@dataclass(frozen=True)
class Viewpoint:
    """Unit vectors (3,) in the body's coordinates.

    ``front`` is normal to the cut, which holds the probe's axis, and points to the eye; ``side`` lies in the cut,
    normal to the axis; ``outward`` points back along the axis.
    """

    front: FloatArray
    side: FloatArray
    outward: FloatArray

    @classmethod
    def of(cls, frame: Frame, planes: tuple[str, ...]) -> Self:
        """Return how a probe's place is looked at; a plane of symmetry ("x": x = 0) is the cut where there is one."""
        outward = np.array(frame.outward)
        if planes != ("x",) and (planes or abs(outward[1]) < _NEARLY):
            front = np.array((0.0, -1.0, 0.0))
        elif planes or abs(outward[0]) < _NEARLY:
            front = np.array((1.0, 0.0, 0.0))
        else:
            front = np.cross(outward, _UP)
            front *= 1.0 if front[1] < 0 else -1.0
        front = front - (front @ outward) * outward
        front /= np.linalg.norm(front)
        side = np.cross(outward, front)
        return cls(front, -side if side[2] < _BELOW else side, outward)

    @property
    def eye(self) -> FloatArray:
        """Unit vector from the body to the eye."""
        direction = sum(
            share * vector for share, vector in zip(_FROM, (self.front, self.side, self.outward), strict=True)
        )
        return np.asarray(direction / np.linalg.norm(direction))
