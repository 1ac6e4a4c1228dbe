"""A disc."""

from math import pi, sin, sqrt
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.shapes.body import Body
from pipeline.shapes.frame import Frame, Units, Vector
from pipeline.shapes.probe import ON_EDGE
from pipeline.shapes.punch import Straight
from pipeline.shapes.round import closed_ellipse, draw_ellipse
from pipeline.shapes.section import Problems, Words
from pipeline.units import Length

# Points of the edge in pictures.
_ROUND = 200


class Disc(Straight):
    """A flat round punch, such as the tip of a blunt needle."""

    # Any direction is as good: that of x.
    lies_along: ClassVar[Vector] = 1.0, 0.0, 0.0
    is_round: ClassVar[bool] = True
    is_curved: ClassVar[bool] = True

    REALTIME = ("frictionless", "bonded")
    EXPECTED_ERROR = 1.0

    shape: Literal["disc"]
    radius: Annotated[Length, Words("Radius of the footprint.", '"2 mm"', is_used=True)]

    @property
    def circumradius(self) -> float:
        """The radius (m)."""
        return self.radius

    @property
    def half_width(self) -> float:
        """The radius (m)."""
        return self.radius

    @property
    def perimeter(self) -> float:
        """Length of the circle (m)."""
        return 2 * pi * self.radius

    @property
    def mean_square(self) -> float:
        """Two thirds of the square of the radius (m²): its pressure goes like 1 / (a² - r²)^½."""
        return 2 / 3 * self.radius**2

    def gap(self, body: Body, frame: Frame) -> float:
        """Return the distance (m) from the circle to the edge of the face."""
        return body.gap(frame.point) - self.radius

    def is_mirrored(self, along: float, across: float) -> bool:
        """Tell that it is, in any line."""
        return True

    def draw(self, kernel: Any, frame: Frame, units: Units) -> int:
        """Add the disc."""
        return draw_ellipse(kernel, (self.radius, self.radius), frame, units)

    def inscribed(self, edges: int) -> Self:
        """Return the larger disc whose regular polygon has this one's area."""
        angle = 2 * pi / edges
        return self.model_copy(update={"radius": self.radius * sqrt(angle / sin(angle))})

    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Write the distance to the circle."""
        return f"Sqrt((Sqrt({along}^2+{across}^2)-{unit * self.radius:.12g})^2+{height}^2)"

    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the points moved along their radii onto the circle."""
        return self.radius * points / np.linalg.norm(points, axis=1, keepdims=True)

    def outline(self) -> FloatArray:
        """Return the circle."""
        return closed_ellipse((self.radius, self.radius), _ROUND)

    def covers(self, points: FloatArray) -> BoolArray:
        """Tell which points are within the circle."""
        within: BoolArray = np.linalg.norm(points, axis=1) <= (1 + ON_EDGE) * self.radius
        return within

    def check(self, problems: Problems) -> None:
        """Find nothing: each key says what it takes."""
