"""A support that lets go: a rigid surface on which a body rests, and off which it may lift."""

from collections.abc import Callable
from math import sqrt
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray
from epsmesh.shapes.friction import Friction
from epsmesh.shapes.ground import Ground
from epsmesh.shapes.section import Problems, Section, Words, in_mm
from epsmesh.shapes.support import Below
from epsmesh.units import Length

# Least radius of a hollow support, in units of the distance at which the body touches it: its wall is then inclined by
# 30° to the bottom, and by 60° to the sides, which are not searched for contact.
_WIDE = 2.0
_PLANE = "plane"
_BOTTOM = "bottom"


def _on(value: Any) -> Any:
    if isinstance(value, dict):
        return Below.read(value)
    if value != _BOTTOM:
        raise PydanticCustomError(
            "not_supported",
            "must be 'bottom' of a box or a cylinder; {below = \"-15 mm\"} of a surface or an image",
        )
    return value


class Resting(Section):
    """The table ``[body.support]``: the part of the boundary that rests on a rigid surface, and how it touches."""

    # Its own name begins the dimensions of its sweeps.
    name: Annotated[str, Field(exclude=True), Words("Name in dimensions of sweeps.", '"support"')] = "support"
    on: Annotated[
        Literal["bottom"] | Below,
        BeforeValidator(_on),
        Words(
            "Part of the body that may touch the support: the bottom of a box or a cylinder; of an organ all of its "
            "surface below a height. The organ rests on its lowest point.",
            '{below = "-40 mm"}',
            takes='"bottom" | {below = length}',
        ),
    ]
    shape: Annotated[
        Literal["plane", "cylinder", "sphere"],
        Words("Surface of the support. A cylinder is horizontal. Its middle is below that of the body.", '"cylinder"'),
    ] = "plane"
    radius: Annotated[
        Length | None,
        Words("Radius of a support that is a cylinder or a sphere.", '"60 mm"', default="none"),
    ] = None
    hollow: Annotated[
        bool,
        Words("Whether the body rests in the cylinder or sphere, as in a cradle, and not on it.", "true"),
    ] = False
    direction: Annotated[
        tuple[float, float, float],
        Words("Direction of the axis of a cylinder, along x or y: a vector of any length.", "[0.0, 1.0, 0.0]"),
    ] = (1.0, 0.0, 0.0)
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

    @property
    def is_flat(self) -> bool:
        """Whether it is a plane."""
        return self.shape == _PLANE

    @property
    def fits(self) -> bool:
        """Whether the body at rest touches it with all of the part that may touch it."""
        return self.is_flat and self.on == _BOTTOM

    @property
    def across(self) -> tuple[tuple[float, float, float], ...]:
        """The horizontal directions in which it is curved."""
        along_x, along_y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
        match self.shape:
            case "sphere":
                return along_x, along_y
            case "cylinder":
                return (along_y if self.direction[0] else along_x,)
        return ()

    def ground(self, low: float, reach: Callable[[FloatArray], float]) -> Ground:
        """Return its surface, which a body at rest touches with its bottom, at the height ``low`` (m).

        ``reach`` is the largest distance (m) of a point of the bottom from the axis of the body, in the given
        horizontal directions (n, 3).
        """
        if self.radius is None:
            return Ground((0.0, 0.0, low), (0.0, 0.0, 1.0))
        if self.hollow:
            to_edge = reach(np.array(self.across))
            low -= to_edge**2 / (self.radius + sqrt(self.radius**2 - to_edge**2))
        return Ground((0.0, 0.0, low), (0.0, 0.0, 1.0), self.radius, self.across, self.hollow)

    def check(self, reach: Callable[[FloatArray], float], problems: Problems) -> None:
        """Report keys that its shape has not, or lacks, and a hollow support that is too narrow for a body."""
        shape, is_round = self.shape, not self.is_flat
        for key, has in (("radius", is_round), ("hollow", is_round), ("direction", shape == "cylinder")):
            if key in self.model_fields_set and not has:
                problems.error(f"body.support.{key}", getattr(self, key), f"a {shape} has no {key}: omit it")
        if sum(map(bool, self.direction)) != 1 or self.direction[2]:
            problems.error("body.support.direction", list(self.direction), "must be along x or y, such as [0, 1, 0]")
        elif is_round and self.radius is None:
            problems.error("body.support.radius", None, f"is required for a {shape}")
        elif self.radius is not None and self.hollow and self.radius < (least := _WIDE * reach(np.array(self.across))):
            problems.error(
                "body.support.radius",
                in_mm(self.radius),
                f"must be at least {in_mm(least)}: the wall of a narrower one would touch the sides of the body, where "
                "no contact is searched",
            )


def _of_face(rest: Resting | None) -> Resting | None:
    if rest is not None and isinstance(rest.on, Below):
        raise PydanticCustomError("not_supported", "`on` must be 'bottom': a box or a cylinder rests on that face")
    return rest


def _of_organ(rest: Resting | None) -> Resting | None:
    if rest is not None and not isinstance(rest.on, Below):
        what = '`on` must be a height, {below = "-40 mm"}: the surface of an organ has no names'
        raise PydanticCustomError("not_supported", what)
    if rest is not None and not rest.is_flat:
        raise PydanticCustomError("not_supported", "`shape` must be 'plane': an organ rests on a plane alone")
    return rest


_WORDS = Words("Support that lets go: a rigid surface on which the body rests.", "[body.support]", default="none")
# The table of a body with a bottom, and that of an organ.
OnBottom = Annotated[Resting | None, AfterValidator(_of_face), _WORDS]
OnLowest = Annotated[Resting | None, AfterValidator(_of_organ), _WORDS]
