"""What every tool meets and makes: a place of a body, a contact there, and what is to be known of a tool."""

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
    """What tools take that are not round, or stick: see ``pipeline.realtime.table``.

    ``bent`` holds A₁ and A_xy (1/m³), ``bent_slopes`` (2, 2) theirs; ``lean`` (2,) is ∇c (1/m²) and ``hessian`` (2, 2)
    its slope, both 0 where the lean of the face is in h; ``regular`` (3, 3) is R (1/m).
    """

    bent: Pair
    bent_slopes: Square
    lean: Pair
    hessian: Square
    regular: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, eq=False)
class Place:
    """c (1/m), h (1/m³) and g² (1/m⁴) of a body with E = 1 at a place, their slopes along x and y, and E*.

    ``bend`` (1/m) is the mean curvature of the face, positive where it is a dome, with its slope.
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
    """Force (N/Pa) against the tool, force aside on it, dF/dd (N/m/Pa), radius of contact (m) and ∫ p r² / F (m²)."""

    force: float
    aside: Pair
    stiffness: float
    radius: float
    mean_square: float


class Tool:
    """What presses on a face: ``kind`` tells how its pressure goes, and ``sticks`` whether tissue does to it.

    One that ``grows`` touches with more of itself the deeper it is; one that ``asks_all`` takes all tables of a place.
    """

    kind: ClassVar[str] = "disc"
    is_round: ClassVar[bool] = True
    sticks: ClassVar[bool] = False
    grows: ClassVar[bool] = False
    asks_all: ClassVar[bool] = False

    def press(self, depth: float, place: Place, most: float) -> Contact | None:
        """Return the contact at a ``depth`` (m), or nothing if its radius is more than ``most`` (m)."""
        raise NotImplementedError

    def moment(self, force: float, plane: float) -> tuple[float, float]:
        """Return the mean of r² (m²) under a ``force`` (N/Pa) on a half-space of E* ``plane`` for E = 1.

        With it comes which power of the force that is.
        """
        raise NotImplementedError

    @property
    def tensor(self) -> Array:
        """The second moment ((xx, xy), (xy, yy)) of its pressure, in units of its trace."""
        return 0.5 * np.eye(2)

    def spread_of(self, radius: float) -> Array:
        """Return the second moment ((xx, xy), (xy, yy)) in m², for a force of one, of a contact of a ``radius`` (m)."""
        return 0.5 * MOMENTS[self.kind] * radius**2 * np.eye(2)

    def discs(self, radius: float) -> tuple[float, Array]:
        """Return the radius (m) and the centres (k, 2) of the equal parts that a contact's pressure is seen as."""
        return radius, np.zeros((1, 2))

    @property
    def outline(self) -> tuple[Pair, Pair]:
        """Half extents (m) along an edge and across, of which a round tool has none, and the edge's direction."""
        return (inf, inf), (1.0, 0.0)

    def lifted(self, away: Array) -> Array:
        """Return by how much (m) more than its lowest point it moves what lies below it up, of points (n, 3)."""
        return np.zeros(len(away))
