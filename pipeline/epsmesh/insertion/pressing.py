"""A needle that presses on tissue which it does not cut: the surface of the body, or that of layers below an interface.

At an interface the crack ends, and the needle arrives there with the force F₀ at which it cut the layer above. Tissue
below bears that force: the needle goes on along the curve F(d) of these layers alone, from the depth d₀ at which
F(d₀) = F₀. The tissue above is bonded to them, and adds the stiffness of a half-space of it at most. Half of that is
added, and is the error bar. At the surface of the body, F₀ and d₀ are zero.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Self

import numpy as np
import scipy

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.insertion.curve import Curve
from epsmesh.insertion.states import Solved
from epsmesh.insertion.steps import INDENTATION, Step

_TINY = 1e-6


@dataclass(frozen=True)
class Solves:
    """Tissue on which a needle was pressed to ``depths`` (n) in m: energies (J), forces (N), and their relative bar."""

    depths: FloatArray
    energies: FloatArray
    forces: FloatArray
    bar: float

    @classmethod
    def of(cls, found: dict[float, Solved]) -> Self:
        """Return the tissue of solved depths (m).

        The last one that was solved tells how well energies and forces are interpolated between the others.
        """
        depths, energies, forces = np.array([(at, found[at].energy, found[at].force) for at in sorted(found)]).T
        own, last = cls(depths, energies, forces, max(one.force_error for one in found.values())), list(found)[-1]
        if last == depths[-1]:
            return replace(own, bar=own.bar + fitted.INTERPOLATED) if len(depths) > 1 else own
        others = depths != last
        energy, force = cls(depths[others], energies[others], forces[others], 0.0).at(last)
        missed = max(abs(energy / found[last].energy - 1), abs(force / found[last].force - 1))
        return replace(own, bar=own.bar + missed)

    @property
    def deepest(self) -> float:
        """The last depth (m)."""
        return float(self.depths[-1])

    @cached_property
    def _logarithm(self) -> "scipy.interpolate.CubicHermiteSpline | None":
        if len(self.depths) < 2:
            return None
        return scipy.interpolate.CubicHermiteSpline(np.log(self.depths), np.log(self.energies), self._exponents)

    @property
    def _exponents(self) -> FloatArray:
        return self.depths * self.forces / self.energies

    def at(self, depth: float) -> tuple[float, float]:
        """Return energy (J) and force (N) at a depth (m): powers of it below the first depth, and beyond the last."""
        end = 0 if depth <= self.depths[0] else -1
        if self._logarithm is None or not self.depths[0] < depth < self.deepest:
            exponent = float(self._exponents[end])
            energy = float(self.energies[end]) * (depth / float(self.depths[end])) ** exponent
            return energy, exponent * energy / max(depth, np.finfo(float).tiny)
        energy = float(np.exp(self._logarithm(np.log(depth))))
        return energy, float(self._logarithm(np.log(depth), 1)) * energy / depth

    def depth_of(self, force: float) -> float:
        """Return the depth (m) at which it has a force (N), infinite if it is not solved so far."""
        if force <= 0:
            return 0.0
        if force >= self.forces[-1]:
            return inf
        return float(
            scipy.optimize.brentq(lambda depth: self.at(depth)[1] - force, _TINY * self.depths[0], self.deepest)
        )


@dataclass(frozen=True)
class Press(Curve):
    """A needle that presses on ``tissue`` from the step on at which it has ``arrived``.

    Tissue above adds the stiffness ``added`` (N/m), give or take as much.
    """

    tissue: Solves
    arrived: Step
    added: float = 0.0

    @cached_property
    def _first(self) -> float:
        """The depth (m) on the tissue's curve at which its force is that on arrival."""
        return self.tissue.depth_of(self._force)

    @property
    def _force(self) -> float:
        return self.arrived.elastic + self.arrived.cutting

    @property
    def is_reached(self) -> bool:
        """Whether the tissue is solved to where it bears the force on arrival."""
        return self._first < inf

    def own_depth(self, depth: float) -> float:
        """Return the depth (m) on the tissue's curve, of a depth (m) of the tip."""
        return self._first + depth - self.arrived.depth

    def depth_of(self, own: float) -> float:
        """Return the depth (m) of the tip, of one on the tissue's curve."""
        return self.arrived.depth + own - self._first

    @property
    def deepest(self) -> float:
        """The depth (m) of the tip to which it is solved."""
        return self.depth_of(self.tissue.deepest) if self.is_reached else self.arrived.depth

    def _stored(self, depth: float) -> tuple[float, float]:
        """Return the energy (J) since the arrival that the tissue stores, and what is above it."""
        own = self.tissue.at(self.own_depth(depth))[0] - self.tissue.at(self._first)[0]
        return own, self.added * (depth - self.arrived.depth) ** 2 / 2

    def energy(self, depth: float) -> float:
        """Return the energy (J) that is stored since the arrival, with the tip at a depth (m)."""
        return sum(self._stored(depth))

    def at(self, depth: float, phase: str = INDENTATION) -> Step:
        """Return the step at a depth (m); the shaft rubs as on arrival, pulled out against its motion."""
        bar, (own, above), moved = self.tissue.bar, self._stored(depth), depth - self.arrived.depth
        _, force = self.tissue.at(self.own_depth(depth))
        more, rubbed = self.added * moved, self.arrived.friction * moved
        return replace(
            self.arrived,
            phase=phase,
            depth=depth,
            elastic=force + more,
            cutting=0.0,
            friction=self.arrived.friction if phase == INDENTATION else -self.arrived.friction,
            error=self.arrived.error + (bar * force + more),
            stored=self.arrived.stored + (own + above),
            energy_error=bar * own + above,
            rubbed=self.arrived.rubbed + rubbed,
            work=self.arrived.work + (own + above) + rubbed,
        )
