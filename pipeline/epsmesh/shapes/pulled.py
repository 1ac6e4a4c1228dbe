"""Keys of two jaws that, once closed, are pulled along the surface together."""

from typing import Annotated

from pydantic import Field

from epsmesh.shapes.frame import Vector, unit
from epsmesh.shapes.section import Section, Words
from epsmesh.units import Length


class Pulled(Section):
    """How far the jaws of a grasp move after they have closed, and where to."""

    # Tools that are not pulled have the records that they had before there were these keys: see plan/key.py.
    pull: Annotated[
        Length | None,
        Field(exclude=True),
        Words(
            "Distance by which both jaws of a grasp, once closed, move along their faces together. It needs friction, "
            "and a body that is fixed.",
            '"0.5 mm"',
            default="none: the jaws only close",
        ),
    ] = None
    pull_direction: Annotated[
        tuple[float, float, float],
        Field(exclude=True),
        Words("Direction of `pull`, a vector of any length across the axis.", "[0.0, 1.0, 0.0]"),
    ] = (1.0, 0.0, 0.0)

    @property
    def pulled(self) -> Vector | None:
        """How far (m) it is pulled, as a vector; None if it is not."""
        if self.pull is None:
            return None
        x, y, z = unit(self.pull_direction)
        return self.pull * x, self.pull * y, self.pull * z
