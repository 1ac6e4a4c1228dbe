"""The path of an insertion: indentation until a slit takes less energy than the intact body, then cutting.

At equal depth, the intact body stores U = k d² / 2. With a slit of area A in which the blade is, it stores U_slit.
Tissue is pierced at the depth where U − U_slit = Γ A, at the slit for which that happens first: its front is where
G = Γ, as in cutting. No threshold is fitted. Friction acts on both flanks.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy  # which loads its parts when they are used: a run without an insertion uses none

from pipeline.insertion.cutting import Cutting, cuttings
from pipeline.insertion.friction import rub
from pipeline.insertion.states import Scene
from pipeline.insertion.steps import CUTTING, INDENTATION, Path, Puncture, Step, with_work
from pipeline.insertion.withdrawal import withdrawn

# The least depth at which a slit is solved, in widths of the blade.
_LEAST = 0.25
_TINY = 1e-9


class BladeScene(Scene):
    """The scene of a blade, which follows its path."""

    def needed(self) -> tuple[float, ...]:
        """Return the depths (m) at which the path needs a slit: all of them until the intact body is solved."""
        return _needed(self)

    def _follow(self) -> Path:
        return _follow(self)


def _needed(scene: Scene) -> tuple[float, ...]:
    pressed = scene.stiffness()
    if isinstance(pressed, str):
        return scene.depths if scene.is_pending else ()
    first = _first(scene, _Whole(*pressed))
    through_all = scene.insertion.withdraw and np.isfinite(first)  # after the tissue is cut
    return tuple(depth for depth in scene.depths if through_all or depth >= first)


def _follow(scene: Scene) -> Path:
    pressed, depths = scene.stiffness(), np.array(scene.depths)
    if isinstance(pressed, str):
        return Path(message=pressed)
    whole = _Whole(*pressed)
    first = _first(scene, whole)
    found, message = cuttings(scene, list(_needed(scene)))
    pierced = (number for number, one in enumerate(found) if whole.energy(one.depth) >= one.energy)
    count = next(pierced, len(found))
    intact, cut = found[:count], found[count:]
    if not cut:
        deepest = intact[-1].depth if intact else max(depths[depths < first], default=0.0)
        return Path(tuple(whole.step(depth) for depth in depths if depth <= deepest), message=message)
    pierced_at = _puncture(scene, whole, intact, cut[0], max(depths[depths < first], default=0.0))
    states = [pierced_at.after, *(one for one in cut if one.depth > pierced_at.depth)]
    after = _steps(scene, states)
    steps = [whole.step(depth) for depth in depths if depth < pierced_at.depth] + [
        step for step in after if step.depth in scene.depths
    ]
    back: list[Step] = []
    if scene.insertion.withdraw:
        above = [one for one in found if one.depth < pierced_at.depth]
        back = [step for step in withdrawn(scene, [*above, *states][::-1], after[-1]) if step.depth in scene.depths]
    puncture = Puncture(whole.step(pierced_at.depth), after[0], *pierced_at.errors(whole))
    return Path(tuple(steps), puncture, message, tuple(back[::-1]))


def _first(scene: Scene, whole: "_Whole") -> float:
    """Return the first depth (m) at which tissue may be torn, infinite if there is none.

    No slit is cheaper than its work of fracture alone: before the intact body stores that, the tissue is whole.
    """
    least = (1 - _TINY) * scene.blade.length
    may = (depth for depth in scene.depths if whole.energy(depth) >= least * scene.tear(depth))
    return next(may, np.inf)


@dataclass(frozen=True)
class _Whole:
    """The intact body: force over depth (N/m), with its error bar."""

    stiffness: float
    bar: float

    def energy(self, depth: float) -> float:
        return self.stiffness * depth**2 / 2

    def step(self, depth: float) -> Step:
        energy = self.energy(depth)
        return Step(INDENTATION, depth, self.stiffness * depth, error=self.bar * depth, stored=energy, work=energy)


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
        energy = scipy.interpolate.CubicHermiteSpline(ends, [before.energy, after.energy], [before.slope, after.slope])
        depth = float(scipy.optimize.brentq(lambda d: whole.energy(d) - float(energy(d)), *ends, xtol=1e-9))
        one = _between(before, after, depth)
        error = one.stored_error + whole.bar * depth**2 / 2 + _defect(before, after) * (after.depth - before.depth)
        force = whole.stiffness * depth
        return cls(depth, one, error / max(force - one.slope, _TINY * force))

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

    return (
        float(scipy.optimize.brentq(lacks, max(low, _TINY * high), high)) if lacks(max(low, _TINY * high)) < 0 else low
    )


def _between(before: Cutting, after: Cutting, depth: float) -> Cutting:
    """Return the cutting blade at a depth (m) between two others."""
    share = (depth - before.depth) / (after.depth - before.depth)
    numbers = [name for name, value in vars(before).items() if isinstance(value, float)]
    mixed = {name: (1 - share) * getattr(before, name) + share * getattr(after, name) for name in numbers}
    ends = [before.depth, after.depth]
    stored = scipy.interpolate.CubicHermiteSpline(ends, [before.stored, after.stored], [before.elastic, after.elastic])
    return replace(after, **(mixed | {"depth": depth, "stored": float(stored(depth))}))


def _steps(scene: Scene, states: list[Cutting]) -> list[Step]:
    """Return the steps through ``states`` of cutting, the first of which is that after the puncture."""
    found = [rub(scene.blade, one.depth, one.squeeze, one.squeeze_error, inwards=True) for one in states]
    missed = [0.0 if _crosses(scene, *pair) else _defect(*pair) for pair in pairwise(states)]
    missed = [max(pair) for pair in pairwise([0.0, *missed, 0.0])]
    steps = [
        Step(
            phase=CUTTING,
            depth=one.depth,
            elastic=one.elastic,
            cutting=one.cutting,
            friction=rubs,
            error=one.elastic_error + uncertain + missed[number],
            stored=one.stored,
            fracture=one.fracture,
            work=one.energy,
            crack_depth=one.crack_depth,
        )
        for number, (one, (rubs, uncertain)) in enumerate(zip(states, found, strict=True))
    ]
    return with_work(steps, scene.interfaces)


def _crosses(scene: Scene, before: Cutting, after: Cutting) -> bool:
    return any(before.depth < end < after.depth for end in scene.interfaces)


def _defect(before: Cutting, after: Cutting) -> float:
    """Return by how much the mean force (N) between two depths differs from the change of the energies."""
    return abs((after.energy - before.energy) / (after.depth - before.depth) - (after.slope + before.slope) / 2)
