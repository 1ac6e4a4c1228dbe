"""Tougher layers: each is indented before it is cut.

The front of the slit stays at its interface, and the blade presses on the layers below. The stiffness is at least that
of these layers alone, which is solved. The tissue above is bonded to them, and adds that of a half-space of it at most.
Half of that is added, and is the error bar. Blades at the bottom of notches are between these bounds
(benchmarks/results/insertion.md).
"""

from collections.abc import Sequence

from epsmesh.insertion.cutting import Cutting
from epsmesh.insertion.indentation import Indentation
from epsmesh.insertion.states import Scene
from epsmesh.insertion.steps import Puncture


def through_layers(
    scene: Scene, states: Sequence[Cutting]
) -> tuple[list[Cutting], list[Puncture[Cutting] | None], str]:
    """Return the states of a path in which the blade indents tougher layers, the punctures of these, and a message.

    ``states`` are those of cutting from the first puncture on. The punctures are those of the layers below the first,
    None for a layer that is not pierced. The message says why the path ends early, if it does.
    """
    found, punctures = list(states), list[Puncture[Cutting] | None]()
    for number, end in enumerate(scene.interfaces, start=1):
        above = [one for one in found if one.depth < end]
        below = found[len(above) :]
        if not below:
            break
        punctures.append(None)
        if not above or above[-1].is_indentation or not scene.tougher(number):
            continue
        alone = scene.stiffness(number)
        if isinstance(alone, str):
            return above, punctures[:-1], f"{1e3 * end:.4g} mm: {alone}"
        stiffness, error = alone
        half = scene.layers[number - 1].plane_modulus * scene.blade.half_space_stiffness / 2
        arrived = above[-1].moved(end - above[-1].ahead)
        layer = Indentation(arrived, stiffness + half, error + half)
        count = next((n for n, one in enumerate(below) if layer.at(one.depth).energy >= one.energy), len(below))
        pressed = [layer.at(arrived.depth), *(layer.at(one.depth) for one in below[:count])]
        if count == len(below):
            found = [*above, *pressed]
        elif one := layer.pierced(below[count - 1] if count else None, below[count]):
            punctures[-1] = one
            found = [*above, *pressed, one.before, one.after, *below[count:]]
    return found, punctures, ""
