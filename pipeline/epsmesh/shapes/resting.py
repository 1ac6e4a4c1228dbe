"""A support that lets go: a rigid surface on which a body rests, and off which it may lift."""

from typing import Annotated, Literal

from pydantic import Field

from epsmesh.shapes.friction import Friction
from epsmesh.shapes.section import Section, Words


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
        Words(
            "Coulomb's coefficient of friction between tissue and support, or stick: tissue that touches it does not "
            "slide. The dataset writes stick as infinity.",
            '[0.0, 0.3, "stick"]',
        ),
    ] = 0.0
