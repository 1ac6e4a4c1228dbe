"""A disc."""

from math import pi, sin, sqrt
from typing import Annotated, Literal, Self

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.probes._edge import Edge
from epsmesh.shapes.probes._flat_needle import FlatNeedle
from epsmesh.shapes.round import RoundPunch
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.units import Length

# Edge that is suggested, in radii.
_ROUNDED = 0.2


class Disc(FlatNeedle, RoundPunch):
    """A flat round punch, such as the tip of a blunt needle; inserted, it is the end of a shaft of its radius."""

    REALTIME = ("frictionless", "bonded")
    EXPECTED_ERROR = 1.0

    shape: Literal["disc"]
    radius: Annotated[Length, Words("Radius of the disc.", '"2 mm"', is_used=True)]
    edge: Edge = 0.0

    @property
    def is_rounded(self) -> bool:
        """Whether contact is found on its rounded edge."""
        return self.edge > 0 and self.is_unilateral

    @property
    def limit(self) -> float:
        """The radius (m)."""
        return self.radius

    @property
    def semi_axes(self) -> tuple[float, float]:
        """The radius (m), twice."""
        return self.radius, self.radius

    @property
    def perimeter(self) -> float:
        """Length of the circle (m)."""
        return 2 * pi * self.radius

    def gap(self, body: Body, frame: Frame) -> float:
        """Return the distance (m) from the circle to the edge of the face."""
        return body.gap(frame.point) - self.radius

    def inscribed(self, edges: int) -> Self:
        """Return the larger disc whose inscribed regular polygon has this one's area."""
        angle = 2 * pi / edges
        return self.model_copy(update={"radius": self.radius * sqrt(angle / sin(angle))})

    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the circle as text."""
        return f"Sqrt((Sqrt({along}^2+{across}^2)-{unit * self.radius:.12g})^2+{height}^2)"

    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the points moved radially onto the circle."""
        return self.radius * points / np.linalg.norm(points, axis=1, keepdims=True)

    def check(self, problems: Problems) -> None:
        """Report an insertion with a sharp edge."""
        if self.insertion is not None and not self.edge:
            problems.error(
                "probe.edge",
                in_mm(self.edge),
                "tissue turns inside out at a sharp edge, at large displacements: an insertion needs a rounded edge, "
                f"such as {in_mm(_ROUNDED * self.radius)}",
            )
            return
        super().check(problems)
