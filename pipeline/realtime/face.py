"""The face that a tool presses on, flat or not: its height, its normal, and forces on a tool that moves over it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.contact import Contact
from pipeline.realtime.table import Table

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spot:
    """A place of the face: ``height`` (m), slopes (2,) of it and its second derivatives (2, 2), 1/m.

    ``bend`` (1/m) is the mean curvature, positive on a dome, with its slope.
    """

    height: float
    slope: Array
    second: Array
    bend: float
    slope_bend: Array

    @property
    def normal(self) -> Array:
        """The outward unit normal (3,)."""
        steep = np.array([-self.slope[0], -self.slope[1], 1.0])
        return np.asarray(steep / np.sqrt(steep @ steep))

    @property
    def turn(self) -> Array:
        """Two unit vectors along the face, the first one above x, and the outward normal, a row each."""
        normal = self.normal
        first = np.array([normal[2], 0.0, -normal[0]])
        first /= np.sqrt(first @ first)
        return np.array([first, _cross(normal, first), normal])

    def force(self, contact: Contact, depth: float) -> Array:
        """Return the force (3,) on a tool whose tip is at p - d n: its work is what the energy W(x, y, d) loses.

        Along the normal it is ∂W/∂d; f · (∂p/∂x - d ∂n/∂x) is ``aside``, the slope of -W at a fixed depth.
        """
        if not self.slope.any() and not self.second.any():
            return np.array([*contact.aside, contact.force])
        steep = np.sqrt(1 + self.slope @ self.slope)
        metric = np.eye(2) + np.outer(self.slope, self.slope) + depth / steep * self.second
        tangents = np.array([[1.0, 0.0, self.slope[0]], [0.0, 1.0, self.slope[1]]])
        return np.asarray(contact.force * self.normal + np.linalg.solve(metric, contact.aside) @ tangents)


@dataclass(frozen=True, eq=False)
class Face:
    """Chebyshev coefficients (v, u), as a table has them, of ``height`` (m) and of mean curvature ``bend`` (1/m)."""

    height: Array = field(default_factory=lambda: np.zeros((1, 1)))
    bend: Array = field(default_factory=lambda: np.zeros((1, 1)))

    @property
    def is_flat(self) -> bool:
        """Whether it is the plane z = 0."""
        return not (self.height.any() or self.bend.any())

    def at(self, table: Table, x: float, y: float) -> Spot:
        """Return what it is at a place (m) of a table's region."""
        if self.is_flat:
            return Spot(0.0, np.zeros(2), np.zeros((2, 2)), 0.0, np.zeros(2))
        (z, slope, (xx, xy, yy)), (bend, slope_bend, _) = table.local(np.stack([self.height, self.bend]), x, y)
        return Spot(z, slope, np.array([[xx, xy], [xy, yy]]), bend, slope_bend)


def _cross(a: Array, b: Array) -> Array:
    """np.cross takes 30 µs."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
