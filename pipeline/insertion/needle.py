"""The path of a round needle: indentation until the cut tissue has less energy than the intact body, then cutting.

Deep in tissue, an advance takes e = s + 2b Γ per depth: the energy that the shaft stores as it wedges a plane crack of
length 2b open, and the work of fracture (:mod:`pipeline.solve.plane`). At a section of its tip with radius r < R, e
goes like a power of r, whose exponent is R N/e, since de/dr is the pressure N around the needle. The energy of all
sections down to a depth D is E(D), and its derivative the force of cutting. Tissue is pierced at the depth at which
the intact body stores E. No threshold is fitted. Coulomb's friction is μ N per depth.

Sections are those of an endless needle. What the surface and the tip change is not computed: the bar of E is what one
radius of depth takes, and that of the force falls with the square of the depth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from pipeline.arrays import FloatArray
from pipeline.insertion.path import Path, Puncture
from pipeline.insertion.states import Solved
from pipeline.insertion.steps import CUTTING, INDENTATION, WITHDRAWAL, Step
from pipeline.states import OK

if TYPE_CHECKING:
    from pipeline.shapes.probes._round import RoundIndenter

# Depths at which the needle is pressed on the intact body, in radii: the first, and the factor to the next one.
_FIRST, _FACTOR = 0.5, 2.0
_TINY = 1e-6


class SolvedNeedle(Solved, Protocol):
    """A solved state of a needle, with the sum of its tangential forces (N)."""

    @property
    def friction_force(self) -> float: ...  # noqa: D102


class NeedleStates(Protocol):
    """What has the solved states of a needle: None for one that is still to be solved."""

    def cutting(self) -> SolvedNeedle | None:
        """Return the needle deep in tissue that it cuts, over a depth of one radius, with a coefficient of 1."""
        ...

    def pressed(self, depth: float) -> Solved | None:
        """Return the needle at a depth (m) on the intact body."""
        ...


@dataclass(frozen=True)
class _Cut:
    """The cut of a needle: per depth, energies ``stored`` and ``torn`` (N), and pressure ``squeeze`` (N/m).

    ``bar`` is the relative 95 % bar of each.
    """

    needle: "RoundIndenter"
    stored: float
    torn: float
    squeeze: float
    bar: float

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


class NeedleScene:
    """A needle that is inserted, the depths (m) of its steps, and its solved states.

    ``is_pending`` tells whether a state was asked for that is still to be solved.
    """

    def __init__(self, needle: "RoundIndenter", *, depths: Sequence[float], states: NeedleStates):
        assert needle.insertion is not None
        self.needle, self.insertion, self.depths, self._states = needle, needle.insertion, tuple(depths), states
        self.is_pending = False

    def follow(self) -> Path:
        """Return the path, as far as its states are solved."""
        path = self._follow()
        return replace(path, is_pending=True) if self.is_pending else path

    def _follow(self) -> Path:
        solved = self._states.cutting()
        if why := self._why_not(solved):
            return Path(message=f"the needle deep in tissue: {why}")
        assert solved is not None
        radius = self.needle.limit
        stored = solved.energy / radius
        cut = _Cut(self.needle, stored, solved.force - stored, solved.friction_force / radius, solved.force_error)
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
        depth, message = _FIRST * self.needle.limit, ""
        while True:
            depth = min(depth, self.insertion.to)
            solved = self._states.pressed(depth)
            if why := self._why_not(solved):
                message = f"{1e3 * depth:.4g} mm: {why}"
                break
            assert solved is not None
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
        worked = _with_work([replace(after, work=before.work), *deeper])
        back: list[Step] = []
        if self.insertion.withdraw:
            last = worked[-1]
            steps = [cut.step(each, WITHDRAWAL) for each in reversed(self.depths)]
            first = replace(steps[0], work=last.work, rubbed=last.rubbed)
            back = [replace(one, fracture=last.fracture) for one in _with_work([first, *steps[1:]])][::-1]
        error = cut.energy_error(depth) + whole.bar * before.stored
        depth_error = error / max(before.force - after.elastic - after.cutting, _TINY * before.force)
        slope = before.force / depth  # at least; the force grows faster than the depth
        force_error = whole.bar * before.force + slope * depth_error
        steps = [*(whole.step(each) for each in self.depths if each <= depth), *worked[1:]]
        return Path(tuple(steps), Puncture(before, worked[0], depth_error, force_error), "", tuple(back))

    def _why_not(self, found: Solved | None) -> str:
        """Return why a state has no force, "" if it has."""
        if found is None:
            self.is_pending = True
            return "not yet solved"
        return "" if found.status == OK else found.message or found.status


def _with_work(steps: list[Step]) -> list[Step]:
    """Return steps with the work of the tool (J) and that of friction, from those of the first on."""
    found = steps[:1]
    for step in steps[1:]:
        before = found[-1]
        moved = (step.depth - before.depth) / 2
        work = before.work + moved * (step.force + before.force)
        rubbed = before.rubbed + moved * (step.friction + before.friction)
        found.append(replace(step, work=work, rubbed=rubbed))
    return found
