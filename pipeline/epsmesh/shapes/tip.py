"""The part of a round tool that deforms: its section, as it is drawn on a plane surface, and as it is.

Contact is found between nodes of tool and tissue above each other. The tool is therefore meshed with a flat lower face,
which is that part of the surface which it may touch; its nodes are then moved to the tool's true surface.
"""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.contour import Contour
from epsmesh.shapes.distance import Distance, revolved
from epsmesh.shapes.rounded import Rounded

# Largest part of a rounding, of its radius, that may touch tissue: the sine of the slope there, 45°.
STEEPEST = 0.7
# Least height of a mount above what may touch tissue, in units of its radius.
_CLEAR = 0.25


@dataclass(frozen=True)
class Tip:
    """A tool up to a ``height`` (m) above its lowest point, with its ``section`` up to the radius ``limit`` (m).

    It is drawn flat up to the radius ``face`` (m): all of it is lower by its height there, the ``rise``.
    """

    section: Rounded
    limit: float
    height: float
    face: float

    @property
    def rise(self) -> float:
        """Its height (m) at the edge of the face."""
        return float(self.section.height(np.array([self.face]))[0])

    @property
    def least_height(self) -> float:
        """The least height (m) of a mount that is clear of the contact."""
        return self.rise + _CLEAR * self.face

    @property
    def top(self) -> float:
        """The radius (m) of its upper end."""
        return min(self.section.reach(self.height), self.limit)

    @property
    def profile(self) -> tuple[tuple[float, float], ...]:
        """Radii and heights (m) of the corners of its section, as drawn, from the edge of the face upwards."""
        section, top = self.section, self.top
        radii = [self.face, *([section.tangent] if self.face < section.tangent < top else []), top]
        corners = [(r, float(section.height(np.array([r]))[0]) - self.rise) for r in radii]
        end = self.height - self.rise
        return (*corners, *([(top, end)] if corners[-1][1] < end else []))

    @property
    def centre(self) -> tuple[float, float]:
        """Radius and height (m) of the centre of its rounding, as drawn."""
        return self.section.flat, self.section.tip - self.rise

    @property
    def rounding_ends(self) -> float:
        """The radius (m) at which its rounding ends."""
        return min(self.section.tangent, self.top)

    def bulged(self, points: FloatArray) -> FloatArray:
        """Return the places of points (n, 3), m, of the tool as it is drawn: moved along the axis.

        The face moves to the tool's surface, and what is above it the less, the higher it is.
        """
        beside, reach = np.hypot(points[:, 0], points[:, 1]), min(self.face, self.height - self.rise)
        lower = self.rise - self.section.height(np.minimum(beside, self.face))
        share = np.clip(1 - points[:, 2] / reach, 0.0, 1.0) ** 2
        moved = points.copy()
        moved[:, 2] += self.rise - lower * share
        return moved

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to its surface, and to that of its shaft, of points (n, 3) in the tool's coordinates."""
        return revolved(Contour(self.section, self.limit), points)
