"""The face below a tool, flat or curved: height, normal, and the forces on a tool that moves over it."""

from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.place import Contact, Pair, Square
from pipeline.realtime.table import Table, derived

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spot:
    """A place of the face: ``height`` (m), its gradient (2,) and second derivatives (2, 2), 1/m.

    ``bend`` (1/m) is the mean curvature, positive on a dome, with its gradient.
    """

    height: float
    slope: Pair
    second: Square
    bend: float
    slope_bend: Pair

    @property
    def normal(self) -> Array:
        """The outward unit normal (3,)."""
        return np.array(self.outward)

    @property
    def outward(self) -> tuple[float, float, float]:
        """The normal as a tuple."""
        steep = sqrt(1 + self.slope[0] ** 2 + self.slope[1] ** 2)
        return -self.slope[0] / steep, -self.slope[1] / steep, 1 / steep

    @property
    def turn(self) -> Array:
        """Rows: two unit tangents, the first one above x, and the outward normal."""
        normal = self.normal
        first = np.array([normal[2], 0.0, -normal[0]])
        first /= np.sqrt(first @ first)
        return np.array([first, _cross(normal, first), normal])

    def force(self, contact: Contact, depth: float) -> tuple[float, float, float]:
        """Return the force on a tool whose tip is at p - d n: its work is the decrease of the energy W(x, y, d).

        Along the normal it is ∂W/∂d; f · (∂p/∂x - d ∂n/∂x) is ``aside``, the derivative of -W at a fixed depth.
        """
        if self is FLAT:
            return (*contact.aside, contact.force)
        (x, y), ((xx, xy), (_, yy)), (aside_x, aside_y) = self.slope, self.second, contact.aside
        bent = depth / sqrt(1 + x**2 + y**2)
        along, mixed, across = 1 + x**2 + bent * xx, x * y + bent * xy, 1 + y**2 + bent * yy
        share = along * across - mixed**2
        to_x, to_y = (across * aside_x - mixed * aside_y) / share, (along * aside_y - mixed * aside_x) / share
        out_x, out_y, out_z = self.outward
        force = contact.force
        return force * out_x + to_x, force * out_y + to_y, force * out_z + to_x * x + to_y * y


FLAT = Spot(0.0, (0.0, 0.0), ((0.0, 0.0), (0.0, 0.0)), 0.0, (0.0, 0.0))


@dataclass(frozen=True, eq=False)
class Face:
    """Chebyshev coefficients (v, u), as a table has them, of ``height`` (m) and of mean curvature ``bend`` (1/m)."""

    height: Array = field(default_factory=lambda: np.zeros((1, 1)))
    bend: Array = field(default_factory=lambda: np.zeros((1, 1)))

    @cached_property
    def is_flat(self) -> bool:
        """Whether it is the plane z = 0."""
        return not (self.height.any() or self.bend.any())

    def at(self, table: Table, x: float, y: float) -> Spot:
        """Return the face at a place (m) of a table's region."""
        if self.is_flat:
            return FLAT
        (z, slope, (xx, xy, yy)), (bend, slope_bend, _) = table.local(self._derived, x, y)
        return Spot(z, slope, ((xx, xy), (xy, yy)), bend, slope_bend)

    @cached_property
    def _derived(self) -> Array:
        return derived(np.stack([self.height, self.bend])[:, None])


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product (np.cross takes 30 µs)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
