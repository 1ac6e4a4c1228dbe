"""The tool of a contact that is found: its surface, its friction and its axis."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance, heights_along
from epsmesh.shapes.frame import Vector
from epsmesh.solve.contact.bed import Bed, Kind, above_places


def _no_distance(points: FloatArray, depth: float) -> Distance:
    """Raise the error of a tool whose distance was not given."""
    raise NotImplementedError("a tool without a distance has no contact at large displacements")


@dataclass(frozen=True)
class Tool:
    """A probe's surface, pressed in along -z.

    ``height`` gives the initial height of the probe above points (n, 3) of the undeformed surface (m), infinite where
    there is no probe. ``ends_at`` is a mask of points (n, 3) on the edge of the candidates: true where the probe itself
    ends. Elsewhere contact must not reach that edge. ``first`` (m) is the smallest height, zero on the
    axis. ``friction`` is Coulomb's coefficient, infinite for tissue that sticks. ``distance`` is that of
    points (n, 3) to the probe pressed in by a depth (m) from the first touch, for contact at large displacements.
    ``foot`` (m) are x and y of its axis. ``is_sharp`` says that it ends at a sharp edge, off which tissue slides.
    ``normal`` is the surface's outward unit normal at the first touch, if that is inclined to the axis. ``beds`` are
    the surfaces that touch the body besides, ``begins`` (n) the nodes of all that touch before the tool does; None for
    all above supports.
    """

    height: Callable[[FloatArray], FloatArray]
    ends_at: Callable[[FloatArray], BoolArray]
    first: float = 0.0
    friction: float = 0.0
    distance: Callable[[FloatArray, float], Distance] = _no_distance
    foot: tuple[float, float] = (0.0, 0.0)
    is_sharp: bool = False
    normal: Vector | None = None
    beds: tuple[Bed, ...] = ()
    begins: BoolArray | None = None

    @property
    def rubs(self) -> bool:
        """Whether it, or what touches the body besides, has friction; a support that only sticks has none here."""
        return self.friction > 0 or any(bed.friction > 0 and not bed.sticks for bed in self.beds)

    @property
    def drags(self) -> bool:
        """Whether a body settles with friction on what touches it besides."""
        return any(bed.drags and not bed.sticks for bed in self.beds)

    def at_rest(self, places: FloatArray) -> "Tool":
        """Return the tool of linear elasticity: gaps of nodes are those above their undeformed ``places``.

        They are along the surface's normal at the first touch: −z, but for a tool that is inclined to the surface.
        """
        if self.normal is not None:
            return replace(self, distance=above_places(self.distance, np.array(self.normal), places))
        heights = self.height(places) - self.first

        def distance(points: FloatArray, depth: float) -> Distance:
            return Distance.along_axis(heights - depth, points - places)

        return replace(self, distance=distance)

    def heights_along(self, normal: FloatArray, places: FloatArray, depth: float) -> FloatArray:
        """Return how far (n, m) the tool, at a ``depth`` (m), is from ``places`` (n, 3) along a unit ``normal``."""
        return heights_along(normal, lambda points: self.distance(points, depth), places)

    def advanced(self, change: float) -> "Tool":
        """Return the tool farther along its axis by ``change`` (m), as forces of contact do work.

        Those along the ``normal`` are not across the tool's surface beside the first touch: their work is that of a
        tool that comes nearer along the normal.
        """

        def distance(points: FloatArray, depth: float) -> Distance:
            if self.normal is None:
                return self.distance(points, depth + change)
            found = self.distance(points, depth)
            return replace(found, gap=found.gap - change * self.normal[2])

        return replace(self, distance=distance, beds=tuple(bed.advanced(change) for bed in self.beds))

    def moved(self, by: FloatArray) -> "Tool":
        """Return the tool and its second jaws elsewhere, ``by`` (3), m, and not farther along their axes."""
        x, y, _ = map(float, np.array([*self.foot, 0.0]) + by)
        return replace(
            self,
            height=lambda points: self.height(points - by),
            ends_at=lambda points: self.ends_at(points - by),
            distance=lambda points, depth: self.distance(points - by, depth),
            foot=(x, y),
            beds=tuple(bed.moved(by) if bed.kind is Kind.JAW else bed for bed in self.beds),
        )

    def torque(self, points: FloatArray, forces: FloatArray) -> float:
        """Return the torque (N m) of the tissue on the tool about its advance, −z.

        The tool's ``forces`` (n, 2 or 3) in N act on the tissue at ``points`` (n, 3), m.
        """
        (x, y), (along_x, along_y) = (points[:, :2] - np.array(self.foot)).T, forces[:, :2].T
        return float(x @ along_y - y @ along_x)
