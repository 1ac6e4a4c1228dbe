"""The path of an insertion: indentation until a slit takes less energy than the intact body, then cutting.

At equal depth, the intact body stores U = k d² / 2. With a slit of area A in which the blade is, it stores U_slit.
Tissue is pierced at the depth where U − U_slit = Γ A, at the slit for which that happens first: its front is where
G = Γ, as in cutting. No threshold is fitted. Friction μ N acts on both flanks, N from the field without friction.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import nan

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from pipeline.arrays import FloatArray
from pipeline.insertion.cutting import Cutting, cuttings
from pipeline.insertion.states import Scene
from pipeline.insertion.steps import CUTTING, INDENTATION, PUNCTURE, Step
from pipeline.insertion.withdrawal import withdrawn
from pipeline.study.sweep import Study
from pipeline.surrogate.cases import Solve, SurrogateError

# The least depth at which a slit is solved, in widths of the blade.
_LEAST = 0.25
# The state after the puncture is so much deeper (m) than the one before: depths of a dataset rise.
_AFTER = 1e-9
_TINY = 1e-9


@dataclass(frozen=True)
class Path:
    """Steps of an insertion; depth (m) and force (N) of the puncture with error bars, NaN if the tissue stays whole.

    The ``withdrawal``, if any, has a step for each depth, in the same order.
    ``message`` says at which depth the path ended early, and why.
    """

    steps: tuple[Step, ...]
    puncture: tuple[float, float] = (nan, nan)
    puncture_error: tuple[float, float] = (nan, nan)
    message: str = ""
    withdrawal: tuple[Step, ...] = ()


def follow(study: Study, solve: Solve) -> Path:
    """Return the path of the insertion of a study.

    Raises:
        StudyError: if the study has no insertion, or is not one scene.
        SurrogateError: if the intact body, or the first step, cannot be solved.
    """
    scene = Scene(study, solve)
    to, count = scene.insertion.to, scene.insertion.steps
    depths = np.unique([scene.clear(to * number / count) for number in range(1, count + 1)])
    stiffness, bar = scene.stiffness()
    whole = _Whole(stiffness, bar)
    # No slit is cheaper than its work of fracture alone: before, the tissue is whole.
    first = next((depth for depth in depths if whole.energy(depth) >= scene.blade.length * scene.tear(depth)), np.inf)
    withdraws = scene.insertion.withdraw and np.isfinite(first)  # through all depths, after the tissue is cut
    found, message = cuttings(scene, (depths if withdraws else depths[depths >= first]).tolist())
    pierced = (number for number, one in enumerate(found) if whole.energy(one.depth) >= one.energy)
    count = next(pierced, len(found))
    intact, cut = found[:count], found[count:]
    if not cut:
        deepest = intact[-1].depth if intact else max(depths[depths < first], default=0.0)
        steps = tuple(whole.step(depth) for depth in depths if depth <= deepest)
        if not steps:
            raise SurrogateError(f"{study.file}: the path ends at its first step, {message}")
        return Path(steps, message=message)
    puncture = _puncture(scene, whole, intact, cut[0], max(depths[depths < first], default=0.0))
    kept = [whole.step(depth) for depth in depths if depth < puncture.depth]
    steps = (*kept, *_steps(scene, whole, puncture, cut))
    back: list[Step] = []
    if withdraws:
        above = [one for one in found if one.depth < puncture.depth]
        below = [one for one in cut if one.depth > puncture.depth]
        states = [*above, puncture.after, *below][::-1]
        back = withdrawn(scene, states, steps[-1])[::-1]
        back.insert(len(above), replace(back[len(above)], depth=puncture.depth))  # the puncture has two steps
    return Path(steps, (puncture.depth, stiffness * puncture.depth), puncture.errors(whole), message, tuple(back))


@dataclass(frozen=True)
class _Whole:
    """The intact body: force over depth (N/m), with its error bar."""

    stiffness: float
    bar: float

    def energy(self, depth: float) -> float:
        return self.stiffness * depth**2 / 2

    def step(self, depth: float, phase: str = INDENTATION) -> Step:
        energy = self.energy(depth)
        return Step(phase, depth, self.stiffness * depth, error=self.bar * depth, stored=energy, work=energy)


@dataclass(frozen=True)
class _Puncture:
    """The puncture at a ``depth`` (m): the blade that cuts there, and the bar of the depth (m)."""

    depth: float
    after: Cutting
    bar: float

    @classmethod
    def between(cls, whole: _Whole, before: Cutting, after: Cutting) -> "_Puncture":
        """Return the puncture between two depths at which the energies of slits are known, with their slopes."""
        ends = np.array([before.depth, after.depth])
        energy = CubicHermiteSpline(ends, [before.energy, after.energy], [before.slope, after.slope])
        depth = float(brentq(lambda d: whole.energy(d) - float(energy(d)), *ends, xtol=1e-9))
        one = _between(before, after, depth)
        error = one.stored_error + whole.bar * depth**2 / 2 + _defect(before, after) * (after.depth - before.depth)
        return cls(depth, one, error / (whole.stiffness * depth - one.slope))

    @classmethod
    def at_touch(cls, first: Cutting) -> "_Puncture":
        """Return the puncture of tissue that is cut at the first touch, before a depth at which slits are solved."""
        return cls(first.depth, first, first.depth)

    def errors(self, whole: _Whole) -> tuple[float, float]:
        """Return the error bars of depth (m) and force (N)."""
        return self.bar, whole.bar * self.depth + whole.stiffness * self.bar


def _puncture(scene: Scene, whole: _Whole, intact: list[Cutting], after: Cutting, low: float) -> _Puncture:
    """Return the puncture above the first cut, and below the last ``intact`` state or a ``low`` depth (m)."""
    if not intact:
        # A slit that the intact body could just tear, without opening it.
        depth = max(_crossing(scene, whole, low, after.depth), _LEAST * scene.blade.width)
        found, _ = cuttings(scene, [scene.clear(depth)]) if depth < after.depth else ([], "")
        if found and whole.energy(depth) >= found[0].energy:
            return _Puncture.at_touch(found[0])
        intact = found
    return _Puncture.between(whole, intact[-1], after) if intact else _Puncture.at_touch(after)


def _crossing(scene: Scene, whole: _Whole, low: float, high: float) -> float:
    """Return the depth (m) at which the intact body stores the work of fracture of a slit alone."""

    def lacks(depth: float) -> float:
        return whole.energy(depth) - scene.blade.length * scene.tear(depth)

    return float(brentq(lacks, max(low, _TINY * high), high)) if lacks(max(low, _TINY * high)) < 0 else low


def _between(before: Cutting, after: Cutting, depth: float) -> Cutting:
    """Return the cutting blade at a depth (m) between two others."""
    share = (depth - before.depth) / (after.depth - before.depth)
    numbers = [name for name, value in vars(before).items() if isinstance(value, float)]
    mixed = {name: (1 - share) * getattr(before, name) + share * getattr(after, name) for name in numbers}
    ends = [before.depth, after.depth]
    stored = CubicHermiteSpline(ends, [before.stored, after.stored], [before.elastic, after.elastic])
    return replace(after, **(mixed | {"depth": depth, "stored": float(stored(depth))}))


def _steps(scene: Scene, whole: _Whole, puncture: _Puncture, cut: list[Cutting]) -> list[Step]:
    """Return the steps from the puncture on: the peak, the force after it, and cutting."""
    friction = 2 * scene.blade.friction
    states = [puncture.after, *(one for one in cut if one.depth > puncture.depth)]
    depths = np.array([one.depth for one in states])
    rubs = np.array([friction * one.squeeze for one in states])
    rubbed = _sums(depths, rubs)
    worked = _work(scene, states)
    found = [whole.step(puncture.depth, PUNCTURE)]
    start = puncture.after.energy
    missed = [0.0 if _crosses(scene, *pair) else _defect(*pair) for pair in pairwise(states)]
    missed = [max(pair) for pair in pairwise([0.0, *missed, 0.0])]
    for number, one in enumerate(states):
        found.append(
            Step(
                phase=CUTTING,
                depth=one.depth if number else one.depth + _AFTER,
                elastic=one.elastic,
                cutting=one.cutting,
                friction=float(rubs[number]),
                error=one.elastic_error + friction * one.squeeze_error + missed[number],
                stored=one.stored,
                fracture=one.fracture,
                rubbed=float(rubbed[number]),
                work=start + float(worked[number] + rubbed[number]),
                crack_depth=one.crack_depth,
            )
        )
    return found


def _work(scene: Scene, states: list[Cutting]) -> FloatArray:
    """Return the work (J), but that of friction, since the first state; across an interface, the change of energies."""
    found = [0.0]
    for before, after in pairwise(states):
        if _crosses(scene, before, after):
            found.append(after.energy - before.energy)
        else:
            found.append((before.slope + after.slope) / 2 * (after.depth - before.depth))
    return np.cumsum(found)


def _crosses(scene: Scene, before: Cutting, after: Cutting) -> bool:
    return any(before.depth < end < after.depth for end in scene.interfaces)


def _defect(before: Cutting, after: Cutting) -> float:
    """Return by how much the mean force (N) between two depths differs from the change of the energies."""
    return abs((after.energy - before.energy) / (after.depth - before.depth) - (after.slope + before.slope) / 2)


def _sums(depths: FloatArray, forces: FloatArray) -> FloatArray:
    """Return the work (J) of forces (N) at depths (m) since the first, by the rule of trapezoids."""
    return np.concatenate([[0.0], np.cumsum(np.diff(depths) * (forces[1:] + forces[:-1]) / 2)])
