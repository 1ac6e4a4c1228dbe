"""Which places of a face a model is made for."""

from dataclasses import dataclass
from math import inf

import numpy as np

from pipeline.shapes.bodies.box import Box
from pipeline.shapes.bodies.cylinder import Cylinder
from pipeline.shapes.body import Body

# A coordinate this small, in units of the body, is 0.
_SAME = 1e-9


@dataclass(frozen=True)
class Region:
    """What is tabulated of a face: half extents (m) of both, or radii twice, and the thickness (m) below.

    The thickness ends where other tissue begins. ``even`` tells in which directions the body is its own mirror image,
    ``is_square`` whether it is where x and y are exchanged.
    """

    reach: tuple[float, float]
    sides: tuple[float, float]
    thickness: float
    is_round: bool
    even: tuple[bool, bool] = (True, True)
    is_square: bool = False

    @staticmethod
    def of(body: Box | Cylinder, share: float) -> "Region":
        """Return the region that leaves out the ``share`` of the smaller of half the width and the height."""
        sides, height = half_sides(body), body.heights[1] - body.heights[0]
        left = share * min(*sides, height)
        even = tuple(all(abs(piece.at[axis]) <= _SAME * height for piece in body.inclusion) for axis in range(2))
        is_square = sides[0] == sides[1] and _is_round_within(body)
        reach = (sides[0] - left, sides[1] - left)
        return Region(reach, sides, tissue_depth(body), is_round(body), (even[0], even[1]), is_square)

    @property
    def margin(self) -> float:
        """The way (m) from the region to the sides."""
        return self.sides[0] - self.reach[0]

    def room(self, x: float, y: float) -> float:
        """Return the way (m) from a place to the nearest side, or to the bottom or other tissue."""
        if self.is_round:
            return min(self.sides[0] - float(np.hypot(x, y)), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)


def half_sides(body: Body) -> tuple[float, float]:
    """Return half extents of the face of a box, or the radius of a cylinder twice (m)."""
    if isinstance(body, Cylinder):
        return body.radius, body.radius
    assert isinstance(body, Box)
    return body.size[0] / 2, body.size[1] / 2


def is_round(body: Body) -> bool:
    """Whether a body is the same all round its axis, what is in it included."""
    return isinstance(body, Cylinder) and _is_round_within(body)


def _is_round_within(body: Body) -> bool:
    """Whether all that is in a body is the same all round its axis."""
    return all(
        max(map(abs, piece.at[:2])) <= _SAME * body.extent and piece.surface.axes[0] == piece.surface.axes[1]
        for piece in body.inclusion
    )


def tissue_depth(body: Body) -> float:
    """Return how far (m) below the top the first other tissue lies, or the bottom."""
    low, top = body.heights
    ends = [top - end for end in body.interfaces]
    ends += [top - (piece.at[2] + piece.surface.axes[2]) for piece in body.inclusion]
    return min([top - low, *ends], default=inf)
