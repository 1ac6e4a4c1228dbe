"""Indentation: the blade presses on tissue that it has not cut, the surface of the body or that of a tougher layer.

The front stays, and the force grows from what it was at the first touch, F₀, with a stiffness k: U = U₀ + F₀ δ +
k δ²/2 at a distance δ below. The layer is pierced at the depth where a state in which the blade cuts it has less
energy. At the body's surface F₀ and U₀ are zero. At an interface F₀ is the force that cut the layer above.
"""

from dataclasses import dataclass, replace
from typing import Self

import scipy

from epsmesh.insertion.cutting import Cutting, between
from epsmesh.insertion.near_tip import NearTip
from epsmesh.insertion.steps import INDENTATION

_TINY = 1e-9


@dataclass(frozen=True)
class Pierced:
    """A puncture: the blade ``before`` it and ``after`` it, at one depth; 95 % bars of the depth (m) and force (N)."""

    before: Cutting
    after: Cutting
    depth_error: float
    force_error: float


@dataclass(frozen=True)
class Indentation:
    """A layer that a blade presses on: the blade that has ``arrived`` there, and the layer's stiffness (N/m)."""

    arrived: Cutting
    stiffness: float
    stiffness_error: float

    @classmethod
    def of_surface(cls, stiffness: float, error: float) -> Self:
        """Return the indentation of the intact body."""
        return cls(Cutting(0.0, 0.0, NearTip(0.0, 0.0), phase=INDENTATION), stiffness, error)

    def at(self, depth: float) -> Cutting:
        """Return the blade at a depth (m)."""
        first, below = self.arrived, depth - self.arrived.depth
        return replace(
            first,
            phase=INDENTATION,
            depth=depth,
            ahead=first.crack_depth - depth,
            stored=first.stored + first.slope * below + self.stiffness * below**2 / 2,
            stored_error=first.stored_error + first.elastic_error * below + self.stiffness_error * below**2 / 2,
            elastic=first.slope + self.stiffness * below,
            elastic_error=first.elastic_error + self.stiffness_error * below,
            cutting=0.0,
        )

    def pierced(self, before: Cutting | None, after: Cutting) -> Pierced | None:
        """Return the puncture between two states of cutting; None if the first already has less energy.

        Without a state ``before``, that with the front where it stays follows from the one ``after``.
        """

        def cut(depth: float) -> Cutting:
            return after.moved(depth) if before is None else between(before, after, depth)

        def excess(depth: float) -> float:
            return self.at(depth).energy - cut(depth).energy

        first = self.arrived
        low = max(first.depth, first.crack_depth - after.ahead) if before is None else before.depth
        if excess(low) >= 0:
            return None
        depth = float(scipy.optimize.brentq(excess, low, after.depth, xtol=1e-9))
        intact, torn = self.at(depth), cut(depth)
        missed = before.defect(after) * (after.depth - before.depth) if before else 0.0
        error = intact.stored_error + torn.stored_error + missed
        return self.pierced_at(torn, error / max(intact.slope - torn.slope, _TINY * intact.slope))

    def pierced_at(self, after: Cutting, error: float) -> Pierced:
        """Return the puncture at the depth of a state of cutting, with an ``error`` (m) of this depth."""
        before = self.at(after.depth)
        return Pierced(before, after, error, before.elastic_error + self.stiffness * error)
