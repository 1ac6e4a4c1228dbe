"""A support that lets go: a rigid surface on which a body rests, and off which it may lift."""

from math import inf
from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from epsmesh.shapes.friction import Friction
from epsmesh.shapes.section import Section, Words


def _smooth_or_rough(friction: float) -> float:
    if 0 < friction < inf:
        raise PydanticCustomError(
            "not_supported",
            'must be 0 or "stick": how tissue slides while the body settles and is pressed is not computed',
        )
    return friction


class Resting(Section):
    """The table ``[body.support]``: the part of the boundary that rests on a rigid plane, and how it touches."""

    # Its own name begins the dimensions of its sweeps.
    name: Annotated[str, Field(exclude=True), Words("Name in dimensions of sweeps.", '"support"')] = "support"
    on: Annotated[
        Literal["bottom"],
        Words("Part of the body that rests on a rigid plane: the bottom of a box or a cylinder.", '"bottom"'),
    ]
    contact: Annotated[
        Literal["unilateral"],
        Words("Contact: tissue presses on the support, and may lift off.", '"unilateral"'),
    ] = "unilateral"
    friction: Annotated[
        Friction,
        AfterValidator(_smooth_or_rough),
        Words(
            "Friction between tissue and support: 0, or stick: tissue that touches it does not slide. The dataset "
            "writes stick as infinity.",
            '"stick"',
            takes='0 | "stick"',
        ),
    ] = 0.0
