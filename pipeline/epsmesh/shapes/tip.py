"""The part of a tool that deforms, round or with a straight edge: its section, as it is drawn on a plane, and as it is.

Contact is found between nodes of tool and tissue above each other. The tool is therefore meshed with a flat lower face,
which is that part of the surface which it may touch; its nodes are then moved to the tool's true surface.
"""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.contour import Contour
from epsmesh.shapes.distance import Distance, extruded, revolved
from epsmesh.shapes.rounded import Rounded

# Largest part of a rounding, of its radius, that may touch tissue: the sine of the slope there, 45°.
STEEPEST = 0.7
# Least height of a mount above what may touch tissue, in units of its radius.
_CLEAR = 0.25
# A point is at a flat end within this share of the edge, and at the mount within it of the height.
_AT_END = 1e-6


@dataclass(frozen=True)
class Tip:
    """A tool up to a ``height`` (m) above its lowest point, with its ``section`` up to the distance ``limit`` (m).

    It is a body of revolution, or has a straight edge of a ``length`` (m) with flat ends. It is drawn flat up to the
    distance ``face`` (m) from its axis or edge: all of it is lower by its height there, the ``rise``.
    """

    section: Rounded
    limit: float
    height: float
    face: float
    length: float = 0.0

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
        """The radius, or half the width (m), of its upper end."""
        return min(self.section.reach(self.height), self.limit)

    @property
    def profile(self) -> tuple[tuple[float, float], ...]:
        """Distances from the axis and heights (m) of the corners of its section, as drawn, from the face upwards."""
        section, top = self.section, self.top
        radii = [self.face, *([section.tangent] if self.face < section.tangent < top else []), top]
        corners = [(r, float(section.height(np.array([r]))[0]) - self.rise) for r in radii]
        end = self.height - self.rise
        if end - corners[-1][1] > _AT_END * self.height:
            return (*corners, (top, end))
        return (*corners[:-1], (top, end))  # its side reaches the mount, but for rounding

    @property
    def centre(self) -> tuple[float, float]:
        """Distance from the axis and height (m) of the centre of its rounding, as drawn."""
        return self.section.flat, self.section.tip - self.rise

    @property
    def rounding_ends(self) -> float:
        """The distance (m) from the axis at which its rounding ends."""
        return min(self.section.tangent, self.top)

    def bulged(self, points: FloatArray) -> FloatArray:
        """Return the places of points (n, 3), m, of the tool as it is drawn: moved along the axis.

        The face moves to the tool's surface, and what is above it the less, the higher it is.
        """
        beside, reach = self._beside(points), min(self.face, self.height - self.rise)
        lower = self.rise - self.section.height(np.minimum(beside, self.face))
        share = np.clip(1 - points[:, 2] / reach, 0.0, 1.0) ** 2
        moved = points.copy()
        moved[:, 2] += self.rise - lower * share
        return moved

    def distance(self, points: FloatArray) -> Distance:
        """Return the distance to its surface, and to that of its shaft, of points (n, 3) in the tool's coordinates.

        The flat ends of a straight edge are no part of it.
        """
        contour = Contour(self.section, self.limit)
        return extruded(contour, points) if self.length else revolved(contour, points)

    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return a mask of points (n, 3), in the tool's coordinates, at the flat ends of a straight edge."""
        if not self.length:
            return np.zeros(len(points), dtype=bool)
        return np.asarray(np.abs(points[:, 0]) >= (1 - _AT_END) * self.length / 2)

    def _beside(self, points: FloatArray) -> FloatArray:
        """Return the distances (n,), in m, of points (n, 3) from the axis, or from the plane of a straight edge."""
        return np.abs(points[:, 1]) if self.length else np.hypot(points[:, 0], points[:, 1])
