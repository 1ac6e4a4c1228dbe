"""Withdrawal: the slit stays, its front where cutting ended, and the friction on the flanks acts against the motion.

Below the tip the slit closes. With its front at a distance a from the tip, U is the energy of cutting at that depth
less what the front releases from its own distance there to a. The field near the tip gives it, with an error bar that
was measured on solved slits (docs/howto/insertion.md).
"""

from dataclasses import dataclass

import numpy as np

from pipeline.insertion.cutting import Cutting
from pipeline.insertion.friction import rub
from pipeline.insertion.states import Scene
from pipeline.insertion.steps import WITHDRAWAL, Step

# Relative error of the energy, and of the force, that a front far below the tip takes from those of cutting.
_FAR_ERROR = 0.15
# Relative error of the force by the change of the field with the depth, from differences of states.
_CHANGE_ERROR = 0.3


@dataclass(frozen=True)
class _Open:
    """A blade at rest in a slit: ``ahead`` (m) of its tip, energy (J), and force and friction (N) with bars.

    ``steady`` (N) is the force without that of the front at a fixed field.
    """

    state: Cutting
    ahead: float
    stored: float
    steady: float
    elastic: float
    elastic_error: float
    friction: float
    friction_error: float


def withdrawn(scene: Scene, states: list[Cutting], last: Step) -> list[Step]:
    """Return the steps of a withdrawal after the ``last`` step, through states of cutting from that depth up."""
    bends = np.gradient([state.field.bend for state in states], [state.depth for state in states])
    opened = [_open(scene, *each, last.crack_depth) for each in zip(states, bends.tolist(), strict=True)]
    length = scene.blade.length
    work, rubbed, found = last.work, last.rubbed, []
    for number, one in enumerate(opened):
        if number:
            before = opened[number - 1]
            moved = before.state.depth - one.state.depth
            rubs = (one.friction + before.friction) / 2 * moved
            released = sum(side.state.field.per_length(before.ahead, one.ahead) for side in (before, one)) / 2
            rubbed += rubs
            work += rubs - length * released - (one.steady + before.steady) / 2 * moved
        found.append(
            Step(
                phase=WITHDRAWAL,
                depth=one.state.depth,
                elastic=one.elastic,
                friction=-one.friction,
                error=one.elastic_error + one.friction_error,
                stored=one.stored,
                fracture=last.fracture,
                rubbed=rubbed,
                work=work,
                crack_depth=last.crack_depth,
            )
        )
    return found


def _open(scene: Scene, state: Cutting, bending: float, front: float) -> _Open:
    """Return the blade at the depth of a ``state`` of cutting, where κ changes by ``bending`` (1/m²) with the depth."""
    ahead, length, width, field = front - state.depth, scene.blade.length, scene.blade.width, state.field
    stored = state.stored - length * field.per_length(state.ahead, ahead)
    stored_error = state.stored_error + _FAR_ERROR * length * max(field.per_length(width, ahead), 0.0)
    pushed, changed = length * field.release(ahead), length * bending * field.by_bend(state.ahead, ahead)
    friction = rub(scene.blade, state.depth, 2 * stored / width, 2 * stored_error / width, inwards=False)
    far_error = _FAR_ERROR * pushed if ahead > width else 0.0
    return _Open(
        state=state,
        ahead=ahead,
        stored=stored,
        steady=state.elastic + changed,
        elastic=state.elastic + changed + pushed,
        elastic_error=state.elastic_error + far_error + _CHANGE_ERROR * abs(changed),
        friction=friction[0],
        friction_error=friction[1],
    )
