"""Indentation: the blade presses on tissue that it has not cut, the surface of the body or that of a tougher layer.

The front stays, and the force grows from what it was at the first touch, F₀, with a stiffness k: U = U₀ + F₀ δ +
k δ²/2 at a distance δ below. The layer is pierced at the depth where a state in which the blade cuts it has less
energy. At the body's surface F₀ and U₀ are zero. At an interface F₀ is the force that cut the layer above.
"""

from dataclasses import dataclass, replace
from typing import Self

from epsmesh.insertion.curve import Curve
from epsmesh.insertion.cutting import Cuts, Cutting
from epsmesh.insertion.near_tip import NearTip
from epsmesh.insertion.steps import INDENTATION, Puncture

_TINY, _TOLERANCE = 1e-9, 1e-9


@dataclass(frozen=True)
class Indentation(Curve):
    """A layer that a blade presses on: the blade that has ``arrived`` there, and the layer's stiffness (N/m)."""

    arrived: Cutting
    stiffness: float
    stiffness_error: float

    @classmethod
    def of_surface(cls, stiffness: float, error: float) -> Self:
        """Return the indentation of the intact body."""
        touch = Cutting(phase=INDENTATION, depth=0.0, elastic=0.0, ahead=0.0, field=NearTip(0.0, 0.0))
        return cls(touch, stiffness, error)

    def at(self, depth: float) -> Cutting:
        """Return the blade at a depth (m)."""
        first, below = self.arrived, depth - self.arrived.depth
        return replace(
            first,
            phase=INDENTATION,
            depth=depth,
            ahead=first.front - depth,
            stored=first.stored + first.slope * below + self.stiffness * below**2 / 2,
            energy_error=first.energy_error + first.error * below + self.stiffness_error * below**2 / 2,
            elastic=first.slope + self.stiffness * below,
            error=first.error + self.stiffness_error * below,
            cutting=0.0,
        )

    def pierced(self, before: Cutting | None, after: Cutting) -> Puncture[Cutting] | None:
        """Return the puncture between two states of cutting; None if the first already has less energy.

        Without a state ``before``, that with the front where it stays follows from the one ``after``.
        """
        first, cut = self.arrived, Cuts(before, after)
        low = before.depth if before else max(first.depth, first.front - after.ahead)
        depth = self.crossing(cut, low, after.depth, tolerance=_TOLERANCE)
        if depth is None or depth == low:
            return None
        intact, torn = self.at(depth), cut.at(depth)
        missed = before.defect(after) * (after.depth - before.depth) if before else 0.0
        error = intact.energy_error + torn.energy_error + missed
        return self.pierced_at(torn, error / max(intact.slope - torn.slope, _TINY * intact.slope))

    def pierced_at(self, after: Cutting, error: float) -> Puncture[Cutting]:
        """Return the puncture at the depth of a state of cutting, with an ``error`` (m) of this depth."""
        before = self.at(after.depth)
        return Puncture(before, after, error, before.error + self.stiffness * error)
