"""The path of a needle: indentation until the cut tissue has less energy than the intact one, then cutting.

Tissue is pierced at the depth at which it stores what a cut to that depth takes, E(D) (:mod:`.shaft`). No threshold is
fitted. At the interface to a layer that takes more per depth, the needle indents again (:mod:`.pressing`).
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from epsmesh.insertion.pressing import Press, Solves
from epsmesh.insertion.shaft import NeedleCut, ShaftCut
from epsmesh.insertion.states import InsertionScene, Solved, Tissue
from epsmesh.insertion.steps import INDENTATION, WITHDRAWAL, Path, Puncture, Step, with_work
from epsmesh.shapes.insertion import Needle
from epsmesh.units import canonical

# The factor from one depth at which the needle is pressed to the next one.
_FACTOR = 2.0
# Tissue that may be cut after so many half widths of the shaft is cut at the first touch.
_TOUCH = 1e-3
_TINY = 1e-6
# Share of the last depth at which a puncture is expected: what is solved there costs about the same anywhere.
_SOMEWHERE = 0.7
# Load steps that ended reach this share of their depth again.
_NEARLY = 0.99
# The bar of a puncture's depth is sought in so many doublings of half a width.
_DOUBLINGS = 12


class NeedleScene(InsertionScene[Needle]):
    """A needle that is inserted, and its body."""

    def needed(self) -> tuple[float, ...]:
        """Return all depths: the stages of a needle are one state."""
        return self.depths

    def possible(self) -> Iterator[tuple[Needle, int]]:
        """Yield the needle deep in each layer, and pressed on it: to the last depth, and to that of a puncture."""
        for number, layer in enumerate(self.layers):
            if (end := self.insertion.to - layer.top) <= 0:
                break
            yield from ((state, number) for state in self.tool.cuts(layer.toughness))
            depth = self.tool.first_depth
            while depth < end:
                yield self.tool.pressed_to(depth), number
                depth *= _FACTOR
            yield from ((self.tool.pressed_to(share * end), number) for share in (_SOMEWHERE, 1.0))

    def _follow(self) -> Path:
        cut, end, message = self._cut()
        if cut is None:
            return Path(message=message)
        steps, punctures, press = [Step(INDENTATION, 0.0, 0.0)], list[Puncture[Step] | None](), None
        reached: Step | None = None
        for number, top in enumerate(cut.tops):
            punctures.append(None)
            if number:
                steps += self._cuts(cut, steps[-1], top)
                if steps[-1].depth > top or not cut.takes_more(number):  # or it was pierced with the layer above
                    continue
            press, why = self._press(cut, number, steps[-1], end)
            if press is None:
                message = why
                break
            pierced = self._pierced(cut, press, end)
            if pierced is None:
                message = why or message
                steps += self._presses(press, end)
                reached = press.at(min(press.deepest, end)) if message else None
                break
            if number and pierced == self._touch(press):
                continue
            steps += self._presses(press, pierced)
            punctures[-1] = found = _puncture(cut, press, pierced)
            steps.append(found.after)
        else:
            steps += self._cuts(cut, steps[-1], end)
        back = self._withdrawn(cut, press, steps[-1]) if any(punctures) and not message else []
        return Path(self._own(steps), tuple(punctures), message, self._own(back), reached=reached)

    def _own(self, steps: list[Step]) -> tuple[Step, ...]:
        """Return the steps at the depths of the path, from the surface down."""
        return tuple(sorted((step for step in steps if step.depth in self.depths), key=lambda step: step.depth))

    # ---- cutting --------------------------------------------------------------------------------------

    def _cut(self) -> tuple[NeedleCut | None, float, str]:
        """Return the cut, as far as its layers are solved, the depth (m) to which it is, and why no deeper."""
        layers = [layer for layer in self.layers if layer.top < self.insertion.to]
        deep = [self._deep(layer, number) for number, layer in enumerate(layers)]
        found, end, message = list[ShaftCut](), self.insertion.to, ""
        for layer, shaft in zip(layers, deep, strict=True):
            if isinstance(shaft, str):
                where = f"{1e3 * layer.top:.4g} mm: " if found else ""
                end, message = layer.top, f"{where}the needle deep in tissue: {shaft}"
                break
            found.append(shaft)
            room, words = self.tool.insertion_room
            if canonical(end * shaft.reach) > canonical(self.bottom - room):
                deepest = (self.bottom - room) / shaft.reach
                ring = f"the ring crack, {shaft.reach:.3g} times as deep as the tool, ends {words} above"
                end, message = deepest, f"{1e3 * deepest:.4g} mm: {ring} the bottom or the support"
        tops = tuple(layer.top for layer in layers[: len(found)])
        return (NeedleCut(self.tool, tops, tuple(found)) if found else None), end, message

    def _deep(self, layer: Tissue, below: int) -> ShaftCut | str:
        """Return the cut of a layer ``below`` so many, in the crack of least force, or why there is none."""
        found = []
        for state in self.tool.cuts(layer.toughness):
            one = self.solved(state, below)
            shaft = (
                one
                if isinstance(one, str)
                else self._shaft(layer, one, is_ring=bool(state.crack and state.crack.is_ring))
            )
            if isinstance(shaft, str):
                return shaft
            found.append(shaft)
        return min(found, key=lambda cut: cut.force)

    def _shaft(self, layer: Tissue, deep: Solved, *, is_ring: bool) -> ShaftCut | str:
        return ShaftCut.of(self.tool, deep, layer, self.beside, held=self.is_held, is_ring=is_ring)

    def _cuts(self, cut: NeedleCut, last: Step, end: float) -> list[Step]:
        """Return the steps of cutting after the ``last`` one, down to a depth (m)."""
        depths = sorted({depth for depth in (*self.depths, end) if last.depth < depth <= end})
        return with_work([last, *map(cut.at, depths)], self.interfaces)[1:]

    def _withdrawn(self, cut: NeedleCut, press: Press | None, last: Step) -> list[Step]:
        """Return the steps of the withdrawal after the ``last`` step: from the layer that is pressed, and the cut."""
        if not self.insertion.withdraw:
            return []
        pressed = press if press and last.phase == INDENTATION else None
        steps = [
            pressed.at(depth, WITHDRAWAL) if pressed and depth > last.crack_depth else cut.at(depth, WITHDRAWAL)
            for depth in reversed(self.depths)
        ]
        steps = [replace(step, fracture=last.fracture, crack_depth=last.crack_depth) for step in steps]
        return with_work([replace(steps[0], work=last.work, rubbed=last.rubbed), *steps[1:]], self.interfaces)

    # ---- indentation ----------------------------------------------------------------------------------

    def _press(self, cut: NeedleCut, number: int, arrived: Step, end: float) -> tuple[Press | None, str]:
        """Return the needle that presses on what is below a ``number`` of layers, and why it is solved no deeper.

        It is solved until the tissue is pierced, and there, or to a depth ``end`` (m) of the tip. Where load steps end,
        it is solved to the last depth that they reached.
        """
        found, press, depth, why = dict[float, Solved](), None, self.tool.first_depth, ""
        # Half of 2 R E', which a half-space of the tissue above would add round the shaft.
        added = self.layers[number - 1].plane_modulus * self.tool.limit if number else 0.0
        while True:
            one = self.solved(self.tool.pressed_to(depth), number)
            if isinstance(one, str):
                at = press.depth_of(depth) if press and press.is_reached else arrived.depth + (0.0 if number else depth)
                if why or not (reached := self.reached(self.tool.pressed_to(depth), number)) > max(found, default=0.0):
                    return press, why or f"{1e3 * at:.4g} mm: {one}"
                depth, why = canonical(_NEARLY * reached), f"{1e3 * at:.4g} mm: {one}"
                continue
            found[depth] = one
            press = Press(Solves.of(found), arrived, added)
            if (pierced := self._pierced(cut, press, end)) or press.deepest >= end or why:
                break
            # On the curve of layers, a depth of the tip is known to the tolerance of a root.
            last = press.own_depth(end) * (1 + _TINY if number else 1)
            depth = min(_FACTOR * depth, last) if press.is_reached else _FACTOR * depth
        if pierced:
            depth = float(f"{press.own_depth(pierced):.3g}")
            one = self.solved(self.tool.pressed_to(depth), number)
            if not isinstance(one, str):
                press = Press(Solves.of(found | {depth: one}), arrived, added)
            why = ""
        elif why and press.is_reached:
            why = self._too_tough(cut, press, number)
        return press, why

    def _too_tough(self, cut: NeedleCut, press: Press, number: int) -> str:
        """Return why tissue below a ``number`` of layers is not pierced where load steps end, and what would be.

        What a cut takes goes like a power of the toughness Γ. Its exponent is the share of the work of fracture, since
        the length of the crack makes the energy least. By dimensions, half of Γ is as good as twice the radius.
        """
        depth, layer = press.deepest, cut.layers[number]
        has, takes = press.energy(depth), replace(cut, since=press.arrived.depth).energy(depth)
        share = (has / takes) ** (layer.force / layer.torn)
        toughness = self.layers[number].toughness
        return (
            f"{1e3 * depth:.3g} mm: the tissue folds before it is pierced: too tough for this law and tool. It stores "
            f"{1e3 * has:.3g} mJ, and a cut takes {1e3 * takes:.3g} mJ. Tissue of about {share * toughness:.2g} J/m² "
            f"would be pierced (here {toughness:.4g} J/m²), or by a tool {1 / share:.2g} times as wide. With a law "
            "that stiffens more (Ogden: a larger alpha) the tool can be pressed deeper"
        )

    def _touch(self, press: Press) -> float:
        return press.arrived.depth + _TOUCH * self.tool.limit

    def _pierced(self, cut: NeedleCut, press: Press, end: float) -> float | None:
        """Return the depth (m) at which tissue is pierced; None if it is not, down to ``end`` (m)."""
        taken, deepest = replace(cut, since=press.arrived.depth), min(press.deepest, end)
        return press.crossing(taken, self._touch(press), deepest, tolerance=_TINY * self.tool.limit)

    def _presses(self, press: Press, end: float) -> list[Step]:
        """Return the steps of indentation down to a depth (m)."""
        end = min(end, press.deepest)
        return [press.at(depth) for depth in self.depths if press.arrived.depth < depth <= end]


def _puncture(cut: NeedleCut, press: Press, depth: float) -> Puncture[Step]:
    """Return the puncture at a depth (m).

    Its bar reaches to where the excess of energy is the bar of both energies, at most up to the first touch.
    """
    before, low, taken = press.at(depth), press.arrived.depth, replace(cut, since=press.arrived.depth)
    after = replace(cut.at(depth), work=before.work, rubbed=before.rubbed)
    error = taken.energy_error(depth) + before.energy_error
    gap = before.elastic - after.elastic - after.cutting
    # The tissue's force grows, that of the cut does not: the excess reaches any error.
    far = (depth + cut.needle.limit * 2.0 ** np.arange(_DOUBLINGS)).tolist()
    end = next((at for at in far if press.excess(taken, at) >= error), far[-1])
    reached = press.crossing(taken, depth, end, more=error)
    below = (end if reached is None else reached) - depth
    bar = max(below, min(error / max(gap, _TINY * before.elastic), depth - low))
    return Puncture(before, after, bar, before.error + press.at(depth + bar).elastic - before.elastic)
