"""The path of an insertion: indentation until a slit takes less energy than the intact body, then cutting.

At equal depth, the intact body stores U = k d² / 2. With a slit of area A in which the blade is, it stores U_slit.
Tissue is pierced at the depth where U − U_slit = Γ A, at the slit for which that happens first: its front is where
G = Γ, as in cutting. No threshold is fitted. Friction acts on both flanks.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile

import numpy as np

from epsmesh.insertion.curve import Curve
from epsmesh.insertion.cutting import Cutting, cuttings
from epsmesh.insertion.friction import rub
from epsmesh.insertion.indentation import Indentation
from epsmesh.insertion.layers import through_layers
from epsmesh.insertion.states import Scene
from epsmesh.insertion.steps import CUTTING, Path, Puncture, Step, with_work
from epsmesh.insertion.withdrawal import withdrawn

# The least depth at which a slit is solved, in widths of the blade.
_LEAST = 0.25
_TINY = 1e-9


class BladeScene(Scene):
    """The scene of a blade, which follows its path."""

    def needed(self) -> tuple[float, ...]:
        """Return the depths (m) at which the path needs a slit: all of them until the intact body is solved."""
        pressed = self.stiffness()
        if isinstance(pressed, str):
            return self.depths if self.is_pending else ()
        first = _first(self, Indentation.of_surface(*pressed))
        through_all = self.insertion.withdraw and np.isfinite(first)  # after the tissue is cut
        return tuple(depth for depth in self.depths if through_all or depth >= first)

    def _follow(self) -> Path:
        intact_body, depths = self.stiffness(), np.array(self.depths)
        if isinstance(intact_body, str):
            return Path(message=intact_body)
        whole = Indentation.of_surface(*intact_body)
        first = _first(self, whole)
        found, message = cuttings(self, list(self.needed()))
        pierced = (number for number, one in enumerate(found) if whole.energy(one.depth) >= one.energy)
        count = next(pierced, len(found))
        intact, cut = found[:count], found[count:]
        if not cut:
            deepest = intact[-1].depth if intact else max(depths[depths < first], default=0.0)
            return Path(tuple(_steps(self, [whole.at(one) for one in depths if one <= deepest])), message=message)
        surface = _puncture(self, whole, intact, cut[0], max(depths[depths < first], default=0.0))
        deeper = [surface.after, *(one for one in cut if one.depth > surface.after.depth)]
        states, punctures, ended = through_layers(self, deeper)
        states = [*(whole.at(one) for one in depths if one < surface.after.depth), surface.before, *states]
        steps = {id(state): step for state, step in zip(states, _steps(self, states), strict=True)}
        last, pierces = steps[id(states[-1])], [one for one in (surface, *punctures) if one]
        peaks = tuple(one and _of(one, steps) for one in (surface, *punctures))
        peaked = {id(one.before) for one in pierces}
        own = [step for key, step in steps.items() if key not in peaked and step.depth in self.depths]
        back, message = list[Step](), ended or message
        if self.insertion.withdraw and not self.is_pending:  # its slits depend on where the path ended
            pressed = list(takewhile(lambda one: one.is_indentation, states[::-1]))
            back, stuck = withdrawn(self, pressed, found[::-1], last)
            message = message or stuck
        return Path(tuple(own), peaks, message, tuple(step for step in back[::-1] if step.depth in self.depths))


@dataclass(frozen=True)
class Torn(Curve):
    """A slit that the intact body could just tear, without opening it: its work of fracture alone."""

    scene: Scene

    def at(self, depth: float) -> Step:
        """Return what a slit down to a depth (m) takes."""
        return Step(CUTTING, depth, 0.0, fracture=self.scene.blade.length * self.scene.tear(depth))


def _of(one: Puncture[Cutting], steps: Mapping[int, Step]) -> Puncture[Step]:
    """Return a puncture by the steps of its states."""
    return Puncture(steps[id(one.before)], steps[id(one.after)], one.depth_error, one.force_error)


def _first(scene: Scene, whole: Indentation) -> float:
    """Return the first depth (m) at which tissue may be torn, infinite if there is none.

    No slit is cheaper than its work of fracture alone: before the intact body stores that, the tissue is whole.
    """
    least = (1 - _TINY) * scene.blade.length
    may = (depth for depth in scene.depths if whole.at(depth).energy >= least * scene.tear(depth))
    return next(may, np.inf)


def _puncture(scene: Scene, whole: Indentation, intact: list[Cutting], after: Cutting, low: float) -> Puncture[Cutting]:
    """Return the puncture above the first cut, and below the last ``intact`` state or a ``low`` depth (m)."""
    if not intact:
        depth = whole.crossing(Torn(scene), max(low, _TINY * after.depth), after.depth)
        depth = max(after.depth if depth is None else depth, _LEAST * scene.blade.width)
        intact, _ = cuttings(scene, [scene.clear(depth)]) if depth < after.depth else ([], "")
    found = whole.pierced(intact[-1], after) if intact else None
    # Tissue that is cut at the first touch, before a depth at which slits are solved.
    return found or whole.pierced_at(one := (intact or [after])[0], one.depth)


def _steps(scene: Scene, states: list[Cutting]) -> list[Step]:
    """Return the steps through the ``states`` of a path."""
    found = [rub(scene.blade, one.flank, one.squeeze, one.squeeze_error, inwards=True) for one in states]
    missed = [0.0 if scene.crosses(one.depth, other.depth) else one.defect(other) for one, other in pairwise(states)]
    missed = [max(pair) for pair in pairwise([0.0, *missed, 0.0])]
    steps = [
        replace(
            one, friction=rubs, error=one.error + uncertain + missed[number], work=one.energy, crack_depth=one.front
        )
        for number, (one, (rubs, uncertain)) in enumerate(zip(states, found, strict=True))
    ]
    return with_work(steps, scene.interfaces)
