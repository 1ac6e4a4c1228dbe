"""The region of a face that a model covers."""

from dataclasses import dataclass

import numpy as np

from pipeline.shapes.body import Layered

# A coordinate this small, in units of the body, is 0.
_SAME = 1e-9


@dataclass(frozen=True)
class Region:
    """A tabulated region: half extents (m) of region (``reach``) and face (``sides``), or their radii twice.

    ``thickness`` (m) is the depth of the support or of other tissue. ``even`` says in which directions the body is its
    own mirror image, ``is_square`` whether exchanging x and y leaves it unchanged. A round region may have a body that
    is not: ``is_axial`` says whether the body is axisymmetric.
    """

    reach: tuple[float, float]
    sides: tuple[float, float]
    thickness: float
    is_round: bool
    even: tuple[bool, bool] = (True, True)
    is_square: bool = False
    is_axial: bool = False

    @staticmethod
    def of(body: Layered, share: float) -> "Region":
        """Return the region with a margin: a ``share`` of the smaller of half the width and the height."""
        sides, height = body.half_sides, body.heights[1] - body.heights[0]
        left = share * min(*sides, height)
        even = tuple(
            all(abs(piece.at[axis]) <= _SAME * height for piece in body.inclusion) and not body.region
            for axis in range(2)
        )
        is_square = sides[0] == sides[1] and body.holds_round
        reach = (sides[0] - left, sides[1] - left)
        is_round, is_axial = body.has_round_top, body.is_round
        return Region(reach, sides, body.depth_of_tissue, is_round, (even[0], even[1]), is_square, is_axial)

    @property
    def margin(self) -> float:
        """The distance (m) from the region to the sides."""
        return self.sides[0] - self.reach[0]

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) from a place to the nearest side, or the depth of the bottom or other tissue."""
        if self.is_round:
            return min(self.sides[0] - float(np.hypot(x, y)), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)
