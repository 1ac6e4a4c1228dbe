"""What a needle takes as it cuts: per depth of its shaft, and of the sections of its tip, in one layer or in several.

Deep in tissue, an advance takes e = s + 2b Γ per depth: the energy that the shaft stores as it wedges a plane crack of
length 2b open, and the work of fracture (:mod:`epsmesh.solve.plane`). At a section of its tip with radius r < R, e
goes like a power of r, whose exponent is R N/e, since de/dr is the pressure N around the needle. The energy of all
sections down to a depth D is E(D), and its derivative the force of cutting. Coulomb's friction is μ N per depth.

Sections are those of an endless needle. What the surface and the tip change is in the bar of E: e over half a radius,
twice what tips change that widen holes (benchmarks/results/needle.md); over a radius for blunt ends, and for the change
of e at an interface. The bar of the force is as much of e at a distance of a radius, and falls with the square of the
distance.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import inf, pi
from typing import Self

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import FloatArray
from epsmesh.insertion.curve import Curve
from epsmesh.insertion.states import Solved, Tissue
from epsmesh.insertion.steps import CUTTING, Step
from epsmesh.shapes.insertion import Needle
from epsmesh.shapes.section import in_mm

# Free sides at a distance r take (b/r)² of e, s and N, within a part of that: solved for r/b from 5 to 60 and three
# toughnesses (benchmarks/results/needle.md). A fixed side adds 1/(1 − 2ν) times that: of a hole, at small strains. The
# longest crack, in units of r.
_LONGEST = 1 / 3


@dataclass(frozen=True)
class ShaftCut:
    """A needle that cuts one tissue: energies ``stored`` and ``torn`` per depth of its shaft (N), and pressure (N/m).

    The pressure ``squeeze`` is the change of both energies with the half width of the shaft, and Coulomb's friction for
    a coefficient of 1. ``bar`` is the relative 95 % bar of each. The crack is ``reach`` times as deep as the tip: ahead
    of a flat end, a ring crack contains a column that is compressed.
    """

    needle: Needle
    stored: float
    torn: float
    squeeze: float
    bar: float
    reach: float = 1.0

    @classmethod
    def of(
        cls, needle: Needle, deep: Solved, tissue: Tissue, beside: float, *, held: bool, is_ring: bool = False
    ) -> Self | str:
        """Return the cut of a needle that was solved ``deep`` in tissue, over half its width; or why it is not known.

        A free side at a distance ``beside`` (m) makes it softer. What one that is ``held`` does is in the bar; what any
        does to a ring crack, too. The faces of a ring touch the shaft, and the column ahead of it.
        """
        limit = needle.limit
        stored, squeeze = deep.energy / limit, deep.friction_force / limit
        half = limit if is_ring else (deep.force - stored) / (2 * tissue.toughness)
        if half > _LONGEST * beside:
            least = in_mm(half / _LONGEST)
            return f"its crack is {in_mm(half)} long to each side, beside which less than {least} are kept"
        ends = (half / beside) ** 2
        lost, unsure = ends, fitted.FREE_SIDES * ends
        if held:
            lost, unsure = 0.0, min(ends / max(1 - 2 * tissue.poisson, ends), 1.0)
        if is_ring and not held:
            lost, unsure = 0.0, ends
        stored, torn, squeeze = ((1 - lost) * one for one in (stored, deep.force - stored, squeeze))
        reach = deep.contact_area / (2 * pi * limit**2) if is_ring else 1.0
        return cls(needle, stored, torn, squeeze, deep.force_error + unsure, reach)

    @property
    def force(self) -> float:
        """The force (N) of the shaft without friction: the energy per depth."""
        return self.stored + self.torn

    @cached_property
    def heights(self) -> FloatArray:
        """Heights (n) in m of the tip, at equal steps of its half width."""
        return self.needle.tip_heights

    @cached_property
    def exponent(self) -> float:
        """The power of the half width with which the energies of a section grow; that of friction is 1 less."""
        return self.squeeze * self.needle.limit / self.force

    def share(self, height: float) -> float:
        """Return the energies of the section at a ``height`` (m) above the tip, over the shaft's; 0 below the tip."""
        if height <= 0:
            return 0.0
        return float(np.interp(height, self.heights, np.linspace(0.0, 1.0, len(self.heights)))) ** self.exponent

    def length(self, height: float, exponent: float) -> float:
        """Return the integral (m) of a power of the half width, over the shaft's, from the tip to a ``height`` (m)."""
        ends = np.clip(self.heights, 0.0, max(height, 0.0))
        middles = (np.arange(len(ends) - 1) + 0.5) / (len(ends) - 1)
        return float(np.diff(ends) @ middles**exponent) + max(height - self.heights[-1], 0.0)


@dataclass(frozen=True)
class NeedleCut(Curve):
    """A needle that cuts layers, each from a depth (m) of ``tops`` on; its energy counts from a depth ``since`` (m)."""

    needle: Needle
    tops: tuple[float, ...]
    layers: tuple[ShaftCut, ...]
    since: float = 0.0

    def _parts(self, depth: float) -> Iterator[tuple[ShaftCut, float, float]]:
        """Yield each layer, and the heights (m) of its top and bottom above a tip at a depth (m)."""
        for layer, top, end in zip(self.layers, self.tops, (*self.tops[1:], inf), strict=False):
            yield layer, depth - top, depth - end

    def _jumps(self) -> Iterator[tuple[float, float]]:
        """Yield the depth (m) of each layer's top, and what is not known there of the force of the shaft (N)."""
        forces = [layer.force for layer in self.layers]
        is_pointed = self.needle.tip_heights[-1] >= self.needle.limit
        shares = [fitted.POINTED if is_pointed else 1.0, *(1.0 for _ in forces[1:])]
        yield from zip(self.tops, (np.abs(np.diff([0.0, *forces])) * shares).tolist(), strict=False)

    def takes_more(self, number: int) -> bool:
        """Return whether a layer below another takes more per depth than that."""
        return self.layers[number].force > self.layers[number - 1].force

    def energy(self, depth: float) -> float:
        """Return the stored energy and work of fracture (J) that an advance to a depth (m) takes."""
        return self.at(depth).energy - self.at(self.since).energy

    def energy_error(self, depth: float) -> float:
        """Return the bar of that (J).

        It has those of the solves, and what is not known of the force of the shaft at each top, over one radius.
        """
        bar = max(layer.bar for layer in self.layers)
        ends = sum(jump for top, jump in self._jumps() if self.since <= top < depth)
        return bar * self.energy(depth) + ends * self.needle.limit

    def at(self, depth: float, phase: str = CUTTING) -> Step:
        """Return the step at a depth (m), without its work; pulled out, no tissue is cut."""
        cuts, limit = phase == CUTTING, self.needle.limit
        stored = torn = rubs = elastic = cutting = error = 0.0
        for layer, top, end in self._parts(depth):
            share = layer.share(top) - layer.share(end)
            length = layer.length(top, layer.exponent) - layer.length(end, layer.exponent)
            rub = layer.length(top, layer.exponent - 1) - layer.length(end, layer.exponent - 1)
            stored, torn = stored + layer.stored * length, torn + layer.torn * length
            elastic, cutting = elastic + layer.stored * share, cutting + layer.torn * share * cuts
            rubs += self.needle.friction * layer.squeeze * rub
            error += layer.bar * (layer.stored + layer.torn * cuts) * share
        bar = max(layer.bar for layer in self.layers)
        ends = sum(jump * (limit / max(abs(depth - top), limit)) ** 2 for top, jump in self._jumps())
        return Step(
            phase=phase,
            depth=depth,
            elastic=elastic,
            cutting=cutting,
            friction=rubs if cuts else -rubs,
            error=error + bar * rubs + ends + rubs * limit / max(depth, limit),
            stored=stored,
            fracture=torn,
            crack_depth=depth * self.layers[-1].reach,
        )
