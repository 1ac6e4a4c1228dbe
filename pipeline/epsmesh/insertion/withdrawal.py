"""Withdrawal: the slit stays, its front where cutting ended, and the friction on the flanks acts against the motion.

Below the tip the slit closes. In the layer of the front, U with a front at a distance a from the tip is the energy of
cutting at that depth less what the front releases from its own distance there to a. The field near the tip gives it,
with an error bar that was measured on solved slits (benchmarks/results/insertion.md). That field has the modulus of one
layer: with the tip in layers above, the slit is solved with the front where cutting ended.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from epsmesh import fitted
from epsmesh.insertion.cutting import Cutting, sides
from epsmesh.insertion.friction import rub
from epsmesh.insertion.states import Scene
from epsmesh.insertion.steps import WITHDRAWAL, Step

_TINY = 1e-9


@dataclass(frozen=True, kw_only=True)
class _Open(Cutting):
    """A blade at rest in a slit.

    ``steady`` (N) is the force without that of the front at a fixed field; all of it where ``without_field``.
    """

    steady: float
    without_field: bool = True

    def work_from(self, before: "_Open", scene: Scene) -> float:
        """Return the work (J), but that of friction, since a state ``before`` in which the tip was deeper."""
        moved = before.depth - self.depth
        if before.without_field != self.without_field or scene.crosses(self.depth, before.depth):
            return self.stored - before.stored
        released = 0.0
        if not self.without_field:
            released = sum(side.field.per_length(before.ahead, self.ahead) for side in (before, self)) / 2
        return -scene.blade.length * released - (self.steady + before.steady) / 2 * moved


def withdrawn(
    scene: Scene, pressed: Sequence[Cutting], states: Sequence[Cutting], last: Step
) -> tuple[list[Step], str]:
    """Return the steps of a withdrawal after the ``last`` step, and why it ends early, if it does.

    A blade that indents a layer goes back through the ``pressed`` states, then through those of cutting above the
    front; both from the largest depth up.
    """
    front = last.crack_depth
    opened, message = [_pressed(scene, one) for one in pressed], ""
    states = [one for one in states if one.depth < front]
    bends = [0.0] * len(states)
    if len(states) > 1:
        bends = np.gradient([one.field.bend for one in states], [one.depth for one in states]).tolist()
    solved = [_above(scene, state, states[0], front) for state in states]  # all that are needed, at once
    for state, bending, one in zip(states, bends, solved, strict=True):
        if isinstance(one, str):
            message = f"withdrawal, {1e3 * state.depth:.4g} mm: {one}"
            break
        opened.append(one or _open(scene, state, bending, front))
    found: list[_Open] = []
    for one in opened:
        work, rubbed = last.work, last.rubbed
        if found:
            before = found[-1]
            rubs = -(one.friction + before.friction) / 2 * (before.depth - one.depth)
            rubbed = before.rubbed + rubs
            work = before.work + (rubs + one.work_from(before, scene))
        found.append(replace(one, fracture=last.fracture, rubbed=rubbed, work=work, crack_depth=front))
    return list(found), message


def _at_rest(scene: Scene, state: Cutting, ahead: float, **found: Any) -> _Open:
    """Return the blade at the depth of a ``state``, in a slit with the front ``ahead`` (m), and what is ``found``."""
    width = scene.blade.width
    squeeze, squeeze_error = 2 * found["stored"] / width, 2 * found["energy_error"] / width
    friction, error = rub(scene.blade, state.depth, squeeze, squeeze_error, inwards=False)
    found["error"] += error
    return _Open(phase=WITHDRAWAL, depth=state.depth, ahead=ahead, field=state.field, friction=-friction, **found)


def _pressed(scene: Scene, state: Cutting) -> _Open:
    """Return the blade in a ``state`` of indentation."""
    friction, error = rub(scene.blade, state.flank, state.squeeze, state.squeeze_error, inwards=False)
    changes = {"phase": WITHDRAWAL, "friction": -friction, "error": state.error + error, "cutting": 0.0}
    return _Open(**vars(state) | changes, steady=state.elastic)


def _above(scene: Scene, state: Cutting, deepest: Cutting, front: float) -> _Open | str | None:
    """Return the blade in a layer above that of the ``front`` (m), or why it is not solved; None in the same layer.

    The front that is solved is that of the ``deepest`` state of cutting, as for any toughness; near to where it is.
    """
    depth, length = state.depth, scene.blade.length
    if not scene.crosses(depth, (1 - _TINY) * front):
        return None
    _, solved, beside = place = scene.far(depth, deepest.depth)
    cut = scene.cut(*place)
    if isinstance(cut, str):
        return cut
    ahead, release = front - depth, cut.energy_release
    drive_error = cut.force_error * abs(cut.force)
    # Far from the tip, G falls with the square of the distance.
    nearer = solved / ahead
    shift, pull = length * release * solved * (nearer - 1), length * release * (nearer**2 - 1)
    corners = state.field.corners(state.ahead, beside) / 2
    added, widened = sides(scene, state.field, depth, beside) + corners, 2 * state.field.per_length(state.ahead, beside)
    stored = cut.energy + shift + added
    error = cut.force_error * cut.energy + fitted.SHIFT_OF_FRONT * abs(shift) + fitted.EXTENSION * abs(added)
    elastic = cut.force + pull + widened
    return _at_rest(
        scene,
        state,
        ahead,
        stored=stored,
        energy_error=error,
        steady=elastic,
        elastic=elastic,
        error=drive_error + fitted.SHIFT_OF_FRONT * abs(pull) + fitted.EXTENSION * abs(widened),
    )


def _open(scene: Scene, state: Cutting, bending: float, front: float) -> _Open:
    """Return the blade at the depth of a ``state`` of cutting, where κ changes by ``bending`` (1/m²) with the depth."""
    ahead, length, width, field = front - state.depth, scene.blade.length, scene.blade.width, state.field
    stored = state.stored - length * field.per_length(state.ahead, ahead)
    energy_error = state.energy_error + fitted.FAR_FRONT * length * max(field.per_length(width, ahead), 0.0)
    pushed, changed = length * field.release(ahead), length * bending * field.by_bend(state.ahead, ahead)
    far_error = fitted.FAR_FRONT * pushed if ahead > width else 0.0
    return _at_rest(
        scene,
        state,
        ahead,
        stored=stored,
        energy_error=energy_error,
        steady=state.elastic + changed,
        elastic=state.elastic + changed + pushed,
        error=state.error + far_error + fitted.CHANGE_OF_FIELD * abs(changed),
        without_field=False,
    )
