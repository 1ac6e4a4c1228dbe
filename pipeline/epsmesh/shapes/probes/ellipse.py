"""An ellipse."""

from math import pi, sqrt
from typing import Annotated, Literal, Self

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.round import RoundPunch
from epsmesh.shapes.section import Words
from epsmesh.units import Length

# Points along the edge for its division into equal lengths.
_FINE = 20_000
# Newton's iterations to the nearest point; the initial guess is within a few degrees, and digits double.
_ITERATIONS = 12


class Ellipse(RoundPunch):
    """A flat elliptical punch with its first semi-axis along ``direction``."""

    # Also for the distance to the edge of a face: to 1e-6 of the ellipse's size.
    OUTLINE = 2000
    EXPECTED_ERROR = 0.9

    shape: Literal["ellipse"]
    axes: Annotated[
        tuple[Length, Length], Words("Semi-axes of the ellipse: along `direction` and across it.", '["3 mm", "1.5 mm"]')
    ]
    direction: Annotated[
        tuple[float, float, float],
        Words("Direction of the first semi-axis: this vector, projected normal to the axis.", "[1.0, 0.0, 0.0]"),
    ] = (1.0, 0.0, 0.0)

    @property
    def semi_axes(self) -> tuple[float, float]:
        """The two semi-axes (m)."""
        return self.axes

    @property
    def perimeter(self) -> float:
        """Length of the edge (m), to 1e-4 up to axes of 10:1 (S. Ramanujan, Q. J. Math. 45, 350, 1914)."""
        a, b = self.axes
        h = 3 * ((a - b) / (a + b)) ** 2
        return pi * (a + b) * (1 + h / (10 + sqrt(4 - h)))

    def inscribed(self, edges: int) -> Self:
        """Return the larger ellipse whose inscribed polygon of equal edges, from a vertex on, has this one's area."""
        angle = np.linspace(0.0, 2 * pi, _FINE + 1)
        ellipse = self.points_at(angle)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ellipse, axis=0), axis=1))])
        x, y = self.points_at(np.interp(np.linspace(0.0, length[-1], edges + 1), length, angle)).T
        polygon = float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2
        larger = sqrt(pi * self.axes[0] * self.axes[1] / polygon)
        return self.model_copy(update={"axes": (larger * self.axes[0], larger * self.axes[1])})

    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return a distance to the ellipse as text: exact at the edge and on the shorter axis, else up to 40 % low.

        Let ρ² = x²/a² + y²/b² and n² = x²/a⁴ + y²/b⁴. In the plane, the distance outside is ρ (ρ - 1) / n, or that to
        the circumscribed circle if larger. Inside it is b² ((n² + (1 - ρ²) / b²)^½ - n), with b the shorter axis:
        1 - ρ², with second derivatives of at most 2 / b², cannot vanish at a smaller distance. A first-order estimate
        alone would put the middle of a slender footprint half its length from the edge, and mesh it too coarsely.
        """
        a, b = (unit * axis for axis in self.axes)
        short, long = min(a, b), max(a, b)
        square = f"({along}^2*({1 / a**2:.12g})+{across}^2*({1 / b**2:.12g}))"
        slope = f"Sqrt({along}^2*({1 / a**4:.12g})+{across}^2*({1 / b**4:.12g}))"
        within = f"({short**2:.12g}*(Sqrt({slope}^2+Max(1-{square},0)*({1 / short**2:.12g}))-{slope}))"
        first = f"Sqrt({square})*(Sqrt({square})-1)/Max({slope},{1e-6 / long:.12g})"
        beyond = f"Max(Max({first},Sqrt({along}^2+{across}^2)-{long:.12g}),0)"
        return f"Sqrt(({within}+{beyond})^2+{height}^2)"

    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the nearest points of the ellipse."""
        a, b = self.axes
        x, y = points[:, 0], points[:, 1]
        angle = np.arctan2(y / b, x / a)
        for _ in range(_ITERATIONS):
            sine, cosine = np.sin(angle), np.cos(angle)
            # The offset is normal to the ellipse where the derivative of half its square vanishes.
            slope = (x - a * cosine) * a * sine - (y - b * sine) * b * cosine
            curvature = a * cosine * x + b * sine * y + (a**2 - b**2) * (sine**2 - cosine**2)
            angle = angle - slope / curvature
        return self.points_at(angle)
