"""A needle with a flat end: the crack that it makes may be a ring along its edge, or a plane through its axis."""

from dataclasses import replace
from typing import Annotated, Literal, Self

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.crack import Crack
from epsmesh.shapes.insertion import Needle
from epsmesh.shapes.section import Words


class FlatNeedle(Needle):
    """A needle with a flat end."""

    crack_shape: Annotated[
        Literal["ring", "plane", "least"],
        Words(
            "Crack of an insertion: a ring along the edge, as observed under flat punches; a plane, as of sharp "
            "needles; or the one of both that needs less force (least).",
            '"ring"',
        ),
    ] = "ring"

    @property
    def tip_heights(self) -> FloatArray:
        """Heights (2) in m of the end: none."""
        return np.zeros(2)

    @property
    def crack(self) -> Crack | None:
        """The crack in which it is: None on the surface."""
        found = super().crack
        return found and replace(found, is_ring=self.crack_shape == "ring")

    def cuts(self, toughness: float) -> tuple[Self, ...]:
        """Return it deep in tissue that it cuts, in the crack that it makes, or in each of both."""
        shapes = ("ring", "plane") if self.crack_shape == "least" else (self.crack_shape,)
        return tuple(self.cutting(toughness, crack_shape=shape) for shape in shapes)
