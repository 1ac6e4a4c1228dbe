"""What is prescribed of a displacement, whatever its value, and where the front of a slit is."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve import SolveError
from pipeline.solve.movement import Vector

# v is 1 up to the first of these shares of its radius, and nothing from the second on.
_INNER, _OUTER = 0.4, 1.0
# A direction this near to an axis of coordinates is it.
_SAME = 1e-9


@dataclass(frozen=True)
class Front:
    """Where the front of a slit is, or a blade's tip in it, in a mesh whose probe presses along -z; lengths in m.

    ``point`` is where the probe's axis meets the surface, ``along`` the unit vector along the front, which is ``depth``
    below, from -``reach`` to ``reach`` or all through the body. Within ``radius`` of it nothing else is.
    """

    point: Vector
    along: Vector
    depth: float
    reach: float
    radius: float

    @property
    def normal(self) -> Vector:
        """Unit vector across the slit."""
        x, y, _ = self.along
        return 0.0 - y, x, 0.0

    def advance(self, x: FloatArray) -> FloatArray:
        """Return by how much each of the points (3, n) goes along the axis (n,)."""
        offset = x.T - np.array(self.point)
        away = np.maximum(np.abs(offset @ np.array(self.normal)), np.abs(offset[:, 2] + self.depth))
        if isfinite(self.reach):
            away = np.maximum(away, np.abs(offset @ np.array(self.along)) - self.reach)
        return np.asarray(np.clip((_OUTER - away / self.radius) / (_OUTER - _INNER), 0.0, 1.0))


@dataclass(frozen=True)
class Conditions:
    """What is prescribed, whatever its value: on the footprint all components (``bonded``) or that along z alone.

    Nothing is where contact is ``unilateral``: what touches is found, and held by those who find it. The support is
    held, and on planes of symmetry that bound the mesh so is the displacement across them. A probe that stands in a
    slit, with that ``front``, touches both of its faces, and without bond holds them apart only: what pushes it on is
    then at its ``tip``.
    """

    bonded: bool = True
    unilateral: bool = False
    front: Front | None = None
    tip: Front | None = None

    @property
    def components(self) -> tuple[int, ...]:
        """Components of the displacement that the probe prescribes.

        Raises:
            SolveError: if that would be none of them alone.
        """
        if self.unilateral:
            return ()
        if self.bonded:
            return (0, 1, 2)
        if self.front is None:
            return (2,)
        normal = [axis for axis, part in enumerate(self.front.normal) if abs(part) > 1 - _SAME]
        if not normal:
            raise SolveError("tissue slides along the faces of a slit that lies along x or y only")
        return tuple(normal)
