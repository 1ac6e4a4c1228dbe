"""Relaxing tissue of any law, by history variables at quadrature points (quasi-linear viscoelasticity).

With the elastic stress S₀ of the law (second Piola–Kirchhoff; small strain: σ) and a Prony series of shares g and times
τ, the stress is S = (1 − Σ g) S₀ + Σ h, h' = g S₀' − h/τ (Y. C. Fung 1981; J. C. Simo, Comput. Methods Appl. Mech. Eng.
60, 153, 1987). Poisson's ratio is constant: pressures relax as all stresses do. Over a step Δt in which S₀ is linear in
time, exactly

    h(t + Δt) = e h(t) + g r (S₀(t + Δt) − S₀(t)),    e = exp(−Δt/τ),  r = (1 − e) τ/Δt.

S(t + Δt) is then A S₀(t + Δt) + H, with A = 1 − Σ g + Σ g r and the known H = Σ e h − g r S₀(t): the stress of the
energy A ψ + H : E. A step is one static solve of that energy.

Loads that have acted for long leave h = 0: the tissue that they have made creep has the elastic stress S₀ of a larger
strain, of which 1 − Σ g is left. A movement begins there as it does at rest.

Heat. The viscous strain of a term lags behind E as its stress does, to second order in the lag: with
ε' = E' − ε/τ a term dissipates h : ε/τ and stores h : ε/2. For linear laws this is exact. For others, the difference of
the work to both sums is the error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.elements.tangent import Prestress
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.point_law import SYMMETRIC
from epsmesh.viscoelastic import Terms, heat_of, kept_of

# Products of symmetric tensors count the components off the diagonal twice.
_TWICE = np.array([1.0 if row == column else 2.0 for row, column in SYMMETRIC])


@dataclass
class _Lag:
    """What the terms remember: their stress and strain (terms, 6, points), and stress and strain of the last step."""

    stress: FloatArray
    strain: FloatArray
    elastic: FloatArray
    deformation: FloatArray


class Points(Protocol):
    """The quadrature points of a body, by part: values are (batches, quadrature, size, lanes)."""

    def weights(self) -> list[FloatArray]:
        """Return their volumes, (batches, quadrature, lanes) by part; 0 of padding."""

    def by_region(self, values: Sequence[float]) -> list[FloatArray]:
        """Return the value of each point's region, by part, to be broadcast to the shape of volumes."""


class HistoryVariables:
    """History variables of a body whose regions have Prony ``terms``; stresses in the unit of the law.

    ``heat`` and ``stored`` are the energies (J in that unit) that this rank's terms have dissipated, and store.
    """

    def __init__(self, points: Points, terms: Sequence[Terms]):
        """Begin at rest; ``terms`` are those of each region."""
        count = max(map(len, terms))
        # A region with fewer terms has some without a share.
        table = [[*each, *[(0.0, 1.0)] * (count - len(each))] for each in terms]
        self._table = np.array(table).reshape(len(terms), count, 2)
        self._points, self._weights = points, points.weights()
        self._shapes = [weights.shape for weights in self._weights]
        self._volumes = np.concatenate([weights.ravel() for weights in self._weights])
        self._shares, self._times = ([self._at_points(self._table[:, i, k]) for i in range(count)] for k in range(2))
        size = len(SYMMETRIC), len(self._volumes)
        self._now = _Lag(np.zeros((count, *size)), np.zeros((count, *size)), np.zeros(size), np.zeros(size))
        self._coarse, self._since = np.zeros((count, *size)), 0.0
        self._before = np.zeros(size)
        self.heat = self.stored = 0.0

    def begin(self, stress: list[FloatArray], strain: list[FloatArray]) -> None:
        """Begin in tissue that has crept, whose elastic stress and strain are these, by part."""
        self._now.elastic, self._now.deformation = self._flat(stress), self._flat(strain)
        self._before = self._now.elastic

    def prestress(self, step: float) -> Prestress:
        """Return the change of the energy for a ``step`` of time (s); an infinite one leaves no stress of the terms."""
        shares, times = self._table[..., 0], self._table[..., 1]
        factors = 1 - (shares * (1 - kept_of(step / times)[1])).sum(axis=1)
        stress = np.zeros_like(self._now.elastic)
        for share, time, own in zip(self._shares, self._times, self._now.stress, strict=True):
            kept, rise = kept_of(step / time)
            stress += kept * own - share * rise * self._now.elastic
        return Prestress(tuple(map(float, factors)), self._parts(stress))

    @property
    def rest(self) -> tuple[float, ...]:
        """What is left of the modulus of each region after a long time."""
        return tuple(map(float, 1 - self._table[..., 0].sum(axis=1)))

    def advance(self, step: float, stress: list[FloatArray], strain: list[FloatArray]) -> None:
        """Follow a ``step`` (s) after which elastic stress and strain are these, by part."""
        now, found, deformed = self._now, self._flat(stress), self._flat(strain)
        rise_of_stress, rise_of_strain = found - now.elastic, deformed - now.deformation
        self._since += step
        self.stored = 0.0
        for number, (share, time) in enumerate(zip(self._shares, self._times, strict=True)):
            ratio = step / time
            kept, rise = kept_of(ratio)
            own, lag = now.stress[number], now.strain[number]
            if step:
                self.heat += self._sum(heat_of(ratio, (own, share * rise_of_stress), (lag, rise_of_strain)))
            own[:] = kept * own + rise * share * rise_of_stress
            lag[:] = kept * lag + rise * rise_of_strain
            self.stored += self._sum(own * lag) / 2
        now.elastic, now.deformation = found, deformed

    def advance_coarse(self) -> list[FloatArray]:
        """Follow all steps since the last call as one; return what that changes of the stress, by part."""
        change, error = self._now.elastic - self._before, np.zeros_like(self._before)
        for share, time, coarse, own in zip(self._shares, self._times, self._coarse, self._now.stress, strict=True):
            kept, rise = kept_of(self._since / time)
            coarse[:] = kept * coarse + share * rise * change
            error += coarse - own
        self._before, self._since = self._now.elastic, 0.0
        return self._parts(error)

    def _sum(self, products: FloatArray) -> float:
        return float((_TWICE @ products) @ self._volumes)

    def _at_points(self, values: FloatArray) -> FloatArray:
        """Return values of regions at the points."""
        found = self._points.by_region(values.tolist())
        return np.concatenate([np.broadcast_to(v, s).ravel() for v, s in zip(found, self._shapes, strict=True)])

    def _flat(self, parts: list[FloatArray]) -> FloatArray:
        """Return values by part, (batches, quadrature, 6, lanes), as (6, points)."""
        return np.concatenate(
            [np.moveaxis(part, 2, 0).reshape(part.shape[2], part[:, :, 0].size) for part in parts], axis=1
        )

    def _parts(self, values: FloatArray) -> list[FloatArray]:
        """Return the inverse of :meth:`_flat`."""
        ends = np.cumsum([np.prod(shape) for shape in self._shapes])[:-1]
        return [
            np.moveaxis(part.reshape(len(part), *shape), 0, 2)
            for part, shape in zip(np.split(values, ends, axis=1), self._shapes, strict=True)
        ]


def crept(points: Points, law: MaterialLaw) -> Prestress:
    """Return the change of the energy of a ``law`` a long time after the last movement."""
    return HistoryVariables(points, [each.relaxation for each in law.parameters]).prestress(inf)
