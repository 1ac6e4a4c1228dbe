"""Curves over the depth of a tool: energy and force of tissue that it presses on, and of tissue that it cuts.

Tissue is pierced where both have the same energy.
"""

from abc import ABC, abstractmethod

import scipy  # which loads its parts when they are used: a run without an insertion uses none

from epsmesh.insertion.steps import Step

# A root is exact to this depth (m), or to a tolerance of its own.
_EXACT = 2e-12


class Curve(ABC):
    """Energies and forces of a tool over its depth (m), with their bars."""

    @abstractmethod
    def at(self, depth: float) -> Step:
        """Return its state at a depth (m), without the work of the tool."""

    def energy(self, depth: float) -> float:
        """Return the stored energy and work of fracture (J) at a depth (m)."""
        return self.at(depth).energy

    def excess(self, other: "Curve", depth: float) -> float:
        """Return by how much (J) its energy is more than that of another curve."""
        return self.energy(depth) - other.energy(depth)

    def crossing(
        self, other: "Curve", low: float, high: float, *, more: float = 0.0, tolerance: float = _EXACT
    ) -> float | None:
        """Return the depth (m) at which its energy is that of another curve, and ``more`` (J); None if it stays below.

        That is ``low`` if it is so much there already.
        """
        if high <= low or self.excess(other, high) - more < 0:
            return None
        if self.excess(other, low) - more >= 0:
            return low
        root = scipy.optimize.brentq(lambda at: self.excess(other, at) - more, low, high, xtol=tolerance)
        return float(root)
