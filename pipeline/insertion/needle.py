"""The path of a round needle: indentation until the cut tissue has less energy than the intact body, then cutting.

Deep in tissue, an advance takes e = s + 2b Γ per depth: the energy that the shaft stores as it wedges a plane crack of
length 2b open, and the work of fracture (:mod:`pipeline.solve.plane`). At a section of its tip with radius r < R, e
goes like a power of r, whose exponent is R N/e, since de/dr is the pressure N around the needle. The energy of all
sections down to a depth D is E(D), and its derivative the force of cutting. Tissue is pierced at the depth at which
the intact body stores E. No threshold is fitted. Coulomb's friction is μ N per depth.

Sections are those of an endless needle. What the surface and the tip change is not computed: the bar of E is what one
radius of depth takes, and that of the force falls with the square of the depth.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from pipeline.arrays import FloatArray
from pipeline.insertion.states import InsertionScene, Solved
from pipeline.insertion.steps import CUTTING, INDENTATION, WITHDRAWAL, Path, Puncture, Step, with_work
from pipeline.shapes.insertion import Needle

# Depths at which the needle is pressed on the intact body, in half widths: the first, and the factor to the next one.
_FIRST, _FACTOR = 0.5, 2.0
_TINY = 1e-6


@dataclass(frozen=True)
class _Cut:
    """The cut of a needle: per depth of its shaft, energies ``stored`` and ``torn`` (N), and pressure (N/m).

    The pressure is the change of both energies with the half width of the shaft, and Coulomb's friction for a
    coefficient of 1: ``squeeze``. ``bar`` is the relative 95 % bar of each.
    """

    needle: Needle
    stored: float
    torn: float
    squeeze: float
    bar: float

    @classmethod
    def of(cls, needle: Needle, deep: Solved) -> "_Cut":
        """Return the cut of a needle that was solved ``deep`` in tissue, over a depth of half its width."""
        stored = deep.energy / needle.limit
        return cls(needle, stored, deep.force - stored, deep.friction_force / needle.limit, deep.force_error)

    @property
    def force(self) -> float:
        """The force (N) of the shaft without friction: the energy per depth."""
        return self.stored + self.torn

    @cached_property
    def _heights(self) -> FloatArray:
        return self.needle.tip_heights

    @cached_property
    def _exponent(self) -> float:
        return self.squeeze * self.needle.limit / self.force

    def share(self, depth: float, exponent: float) -> float:
        """Return the radius at a height above the tip of this ``depth`` (m), over the shaft's, to a power."""
        radii = np.linspace(0.0, 1.0, len(self._heights))
        return float(np.interp(depth, self._heights, radii)) ** exponent

    def length(self, depth: float, exponent: float) -> float:
        """Return the integral (m) of :meth:`share` over the heights up to a ``depth`` (m)."""
        ends = np.minimum(self._heights, depth)
        middles = (np.arange(len(ends) - 1) + 0.5) / (len(ends) - 1)
        return float(np.diff(ends) @ middles**exponent) + max(depth - self._heights[-1], 0.0)

    def energy(self, depth: float) -> float:
        """Return stored energy and work of fracture (J) with the tip at a depth (m)."""
        return self.force * self.length(depth, self._exponent)

    def energy_error(self, depth: float) -> float:
        """Return the bar (J) of it: of the solve, and of one radius of depth at surface and tip."""
        return self.bar * self.energy(depth) + self.force * self.needle.limit

    def step(self, depth: float, phase: str = CUTTING) -> Step:
        """Return the step at a depth (m), without its work; pulled out, no tissue is cut."""
        share, length = self.share(depth, self._exponent), self.length(depth, self._exponent)
        rubs = self.needle.friction * self.squeeze * self.length(depth, self._exponent - 1)
        radius = self.needle.limit
        force = self.force if phase == CUTTING else self.stored
        ends = force * min(1.0, (radius / depth) ** 2) + rubs * min(1.0, radius / depth)
        return Step(
            phase=phase,
            depth=depth,
            elastic=self.stored * share,
            cutting=self.torn * share if phase == CUTTING else 0.0,
            friction=rubs if phase == CUTTING else -rubs,
            error=self.bar * (force * share + rubs) + ends,
            stored=self.stored * length,
            fracture=self.torn * length,
            crack_depth=depth,
        )


@dataclass(frozen=True)
class _Intact:
    """The intact body at ``depths`` (n) in m: energies (J), forces (N), and the relative bar of both."""

    depths: FloatArray
    energies: FloatArray
    forces: FloatArray
    bar: float

    @cached_property
    def _logarithm(self) -> CubicHermiteSpline | None:
        if len(self.depths) < 2:
            return None
        return CubicHermiteSpline(np.log(self.depths), np.log(self.energies), self._exponents)

    @property
    def _exponents(self) -> FloatArray:
        return self.depths * self.forces / self.energies

    def at(self, depth: float) -> tuple[float, float]:
        """Return energy (J) and force (N) at a depth (m) up to the last one; a power of it below the first."""
        first, exponent = self.depths[0], float(self._exponents[0])
        if depth <= first or self._logarithm is None:
            energy = float(self.energies[0]) * (depth / first) ** exponent
            return energy, exponent * energy / depth
        at = np.log(depth)
        energy = float(np.exp(self._logarithm(at)))
        return energy, float(self._logarithm(at, 1)) * energy / depth

    def step(self, depth: float) -> Step:
        """Return the step at a depth (m)."""
        energy, force = self.at(depth)
        return Step(INDENTATION, depth, force, error=self.bar * force, stored=energy, work=energy)


class NeedleScene(InsertionScene[Needle]):
    """A needle that is inserted, and its body."""

    def needed(self) -> tuple[float, ...]:
        """Return all depths: the stages of a needle are one state."""
        return self.depths

    def _follow(self) -> Path:
        deep = self.solved(self.tool.cutting())
        if isinstance(deep, str):
            return Path(message=f"the needle deep in tissue: {deep}")
        cut, radius = _Cut.of(self.tool, deep), self.tool.limit
        whole, message = self._intact(cut)
        if whole is None:
            return Path(message=message)
        deepest = float(whole.depths[-1])
        if whole.at(deepest)[0] < cut.energy(deepest):
            return Path(tuple(whole.step(depth) for depth in self.depths if depth <= deepest), message=message)
        pierced = float(
            brentq(lambda depth: whole.at(depth)[0] - cut.energy(depth), _TINY * radius, deepest, xtol=_TINY * radius)
        )
        return self._pierced(cut, whole, pierced)

    def _intact(self, cut: _Cut) -> tuple[_Intact | None, str]:
        """Return the intact body up to where the cut has less energy, or as deep as it is solved, and why no deeper."""
        found: list[tuple[float, Solved]] = []
        depth, message = _FIRST * self.tool.limit, ""
        while True:
            depth = min(depth, self.insertion.to)
            solved = self.solved(self.tool.pressed_to(depth))
            if isinstance(solved, str):
                message = f"{1e3 * depth:.4g} mm: {solved}"
                break
            found.append((depth, solved))
            if solved.energy >= cut.energy(depth) or depth >= self.insertion.to:
                break
            depth *= _FACTOR
        if not found:
            return None, message
        depths, energies, forces = np.array([(at, one.energy, one.force) for at, one in found]).T
        return _Intact(depths, energies, forces, max(one.force_error for _, one in found)), message

    def _pierced(self, cut: _Cut, whole: _Intact, depth: float) -> Path:
        before, after = whole.step(depth), cut.step(depth)
        deeper = [cut.step(each) for each in self.depths if each > depth]
        worked = with_work([replace(after, work=before.work), *deeper])
        back: list[Step] = []
        if self.insertion.withdraw:
            last = worked[-1]
            steps = [cut.step(each, WITHDRAWAL) for each in reversed(self.depths)]
            first = replace(steps[0], work=last.work, rubbed=last.rubbed)
            back = [replace(one, fracture=last.fracture) for one in with_work([first, *steps[1:]])][::-1]
        error = cut.energy_error(depth) + whole.bar * before.stored
        depth_error = error / max(before.force - after.elastic - after.cutting, _TINY * before.force)
        slope = before.force / depth  # at least; the force grows faster than the depth
        force_error = whole.bar * before.force + slope * depth_error
        steps = [*(whole.step(each) for each in self.depths if each <= depth), *worked[1:]]
        return Path(tuple(steps), (Puncture(before, worked[0], depth_error, force_error),), "", tuple(back))
