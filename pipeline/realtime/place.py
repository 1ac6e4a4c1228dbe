"""The interface of tools: a place of a body, a contact there, and the base class of tools."""

from dataclasses import dataclass
from math import inf, nan
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Along x and y.
Pair = tuple[float, float]
Square = tuple[Pair, Pair]
# The mean of r² of a contact on a half-space, in units of the square of its radius, by its kind of pressure.
MOMENTS = {"disc": 2 / 3, "sphere": 2 / 5, "cone": 1 / 3}


@dataclass(frozen=True, eq=False)
class Shape:
    """Values for blades and bonded tools: see ``pipeline.realtime.table``.

    ``bent`` are A₁ and A_xy (1/m³), ``bent_slopes`` (2, 2) their gradients; ``lean`` (2,) is ∇c (1/m²) and ``hessian``
    (2, 2) its gradient, both 0 if h includes the tilt of the face; ``regular`` (3, 3) is R (1/m).
    """

    bent: Pair
    bent_slopes: Square
    lean: Pair
    hessian: Square
    regular: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, eq=False)
class Place:
    """c (1/m), h (1/m³) and g² (1/m⁴) of a body with E = 1 at a place, their gradients, and E*.

    ``bend`` (1/m) is the mean curvature of the face, positive on a dome, with its gradient.
    """

    c: float
    h: float
    tilt: float
    slope_c: Pair
    slope_h: Pair
    slope_tilt: Pair
    plane: float
    bend: float = 0.0
    slope_bend: Pair = (0.0, 0.0)
    shape: Shape | None = None
    poisson: float = nan


@dataclass(frozen=True)
class Contact:
    """Force (N/Pa) on the tool, lateral force, dF/dd (N/m/Pa), contact radius (m), ∫ p r² / F (m²)."""

    force: float
    aside: Pair
    stiffness: float
    radius: float
    mean_square: float


class Tool:
    """A tool on a face: ``kind`` is its kind of pressure, ``sticks`` whether contact is bonded.

    ``grows``: the contact grows with the depth; ``asks_all``: the tool needs all tables of a place.
    """

    kind: ClassVar[str] = "disc"
    is_round: ClassVar[bool] = True
    sticks: ClassVar[bool] = False
    grows: ClassVar[bool] = False
    asks_all: ClassVar[bool] = False

    def press(self, depth: float, place: Place, most: float) -> Contact | None:
        """Return the contact at a ``depth`` (m), None if its radius exceeds ``most`` (m)."""
        raise NotImplementedError

    def moment(self, force: float, plane: float) -> tuple[float, float]:
        """Return the mean of r² (m²) under a ``force`` (N/Pa) on a half-space, and its exponent in the force.

        ``plane`` is E* for E = 1.
        """
        raise NotImplementedError

    @property
    def tensor(self) -> Array:
        """The second moment ((xx, xy), (xy, yy)) of its pressure, in units of its trace."""
        return 0.5 * np.eye(2)

    def spread_of(self, radius: float) -> Array:
        """Return the second moment ((xx, xy), (xy, yy)) in m², for a unit force, of a contact ``radius`` (m)."""
        return 0.5 * MOMENTS[self.kind] * radius**2 * np.eye(2)

    def discs(self, radius: float) -> tuple[float, Array]:
        """Return radius (m) and centres (k, 2) of equal discs that represent a contact's pressure for display."""
        return radius, np.zeros((1, 2))

    @property
    def outline(self) -> tuple[Pair, Pair]:
        """Half extents (m) along an edge and across, 0 for a round tool, and the edge's direction."""
        return (inf, inf), (1.0, 0.0)

    def lifted(self, away: Array) -> Array:
        """Return the height (m) of the tool's surface above its lowest point, minus that of points (n, 3) below it."""
        return np.zeros(len(away))
