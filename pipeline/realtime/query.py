"""A query of a model: tool, place, depth, and tissue if it is not the study's."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, isfinite, nan, pi

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.blade import blade
from pipeline.realtime.contact import Bonded, Disc, ball, cone
from pipeline.realtime.place import Tool

# The smallest tool (m).
_SMALLEST = 1e-6
# The allowed contacts of each tool.
_CONTACTS = {
    "disc": ("frictionless", "bonded"),
    "blade": ("frictionless",),
    "sphere": ("unilateral",),
    "cone": ("unilateral",),
}


@dataclass(frozen=True)
class Query:
    """A ``tool`` with its sizes, pressed in by ``depth`` (m) along the inward normal ``at`` x, y, z (m).

    - ``radius`` (m): of a disc, a sphere, or the end of a cone; ``angle`` (rad): a cone's half angle to its axis.
    - ``length``, ``width`` (m): of a blade; ``along``: the direction of its edge, by default the face's x.
    - ``axis``: the tool's direction; if given, it must be the inward normal.
    - ``young`` (Pa), ``poisson``: by default the study's.
    - ``contact``: "frictionless" for disc and blade, "unilateral" for sphere and cone, or "bonded" for a disc.
    """

    tool: str
    at: Sequence[float]
    depth: float
    radius: float = nan
    angle: float = nan
    young: float | None = None
    poisson: float | None = None
    axis: Sequence[float] | None = None
    length: float = nan
    width: float = nan
    along: Sequence[float] | None = None
    contact: str | None = None

    def shape(self, axes: NDArray[np.float64], *, has_tensors: bool) -> Tool | str:
        """Return the tool on a face with ``axes`` (3, 3), or the status of an invalid one.

        Blades and bonded discs need tables that some models lack: ``has_tensors``.
        """
        if self.tool not in _CONTACTS or self.contact not in (None, *_CONTACTS[self.tool]):
            return "tool"
        sticks = self.contact == "bonded"
        if (self.tool == "blade" or sticks) and not has_tensors:
            return "tool"
        lengths = (self.length, self.width) if self.tool == "blade" else (self.radius,)
        angles = (self.angle,) if self.tool == "cone" else ()
        if not all(map(isfinite, (*lengths, *angles))):
            return "tool"
        if min(lengths) < _SMALLEST or not all(0.01 <= angle <= pi / 2 - 0.001 for angle in angles):
            return "input"
        if self.tool == "blade":
            turn = self._turn(axes)
            return "input" if turn is None else blade(self.length, self.width, turn) or "tool"
        if self.tool == "disc":
            return Bonded(self.radius) if sticks else Disc(self.radius)
        return ball(self.radius) if self.tool == "sphere" else cone(self.angle, self.radius)

    def _turn(self, axes: NDArray[np.float64]) -> float | None:
        """Return the angle (rad) of a blade to the face's x; None if its direction is not in the face."""
        if self.along is None:
            return 0.0
        given = np.asarray(self.along, dtype=float)
        if given.shape != (3,) or not np.isfinite(given).all():
            return None
        x, y, _ = (axes @ given).tolist()
        return atan2(y, x) if hypot(x, y) > 0 else None
