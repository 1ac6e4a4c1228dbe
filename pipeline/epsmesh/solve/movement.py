"""Loading of a body: the movement of the probe, dead loads, and a far field on a cut face.

A movement is a sum of rigid motions; each is solved for once.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import hypot
from typing import Protocol, Self

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray

Vector = tuple[float, float, float]
Place = Vector

_ZERO: Vector = (0.0, 0.0, 0.0)


class FarField(Protocol):
    """Displacement field of the body beyond the cut face, without loads there; hashable."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) of a unit, in m, at points (n, 3), in m, on the cut face."""

    def stiffness(self, mu: float) -> float:
        """Return twice the strain energy (N/m) of a unit beyond the cut face, for the shear modulus ``mu`` (Pa)."""

    def moved(self, centre: Place) -> Self:
        """Return the field for a half ball of the same size around another ``centre`` (m)."""


@dataclass(frozen=True, eq=False)
class SurfaceLoad:
    """A ``traction`` (Pa), or a ``pressure`` (Pa) against the outward normal, on part of the free boundary.

    ``on_facets`` is a mask of loaded facets, from their corners (n, 3, 3) and outward unit normals (n, 3). ``within``
    is the ball that bounds the load, its centre (m) and radius (m); None for no bound.
    """

    on_facets: Callable[[FloatArray, FloatArray], BoolArray]
    traction: Vector = (0.0, 0.0, 0.0)
    pressure: float = 0.0
    within: tuple[Vector, float] | None = None


@dataclass(frozen=True, eq=False)
class Loads:
    """Dead loads: specific weights (N/m³) of each region of the body, and surface loads; on the modelled part."""

    weights: tuple[Vector, ...] = ()
    surface: tuple[SurfaceLoad, ...] = ()


@dataclass(frozen=True)
class Motion:
    """A unit of one rigid motion: along the unit vector ``direction``, or about the axis ``rotation``.

    A unit is a metre, or a radian for the small rotation ω × (x − ``centre``). ``opening`` moves the two faces of a
    slit apart: each by a metre, the face on the side of that unit vector along it, the other one back. ``far`` moves
    the cut face, by ``share`` units of that field.
    """

    direction: Vector = _ZERO
    rotation: Vector = _ZERO
    centre: Vector = _ZERO
    opening: Vector = _ZERO
    far: FarField | None = None
    share: float = 0.0

    @property
    def is_rotation(self) -> bool:
        """Whether it is a rotation."""
        return any(self.rotation)

    @property
    def is_translation(self) -> bool:
        """Whether it is a translation."""
        return any(self.direction)

    def at(self, points: FloatArray, sides: FloatArray | None = None) -> FloatArray:
        """Return the displacement of a unit (m), at ``points`` (m), shape (points, 3).

        ``sides`` (points) are 1 or -1, for the faces of a slit on either side of its plane.
        """
        if any(self.opening):
            if sides is None:
                raise ValueError("an opening needs a slit")
            return np.asarray(np.outer(sides, np.array(self.opening)))
        turned = np.cross(np.array(self.rotation), points - np.array(self.centre))
        return np.asarray(np.array(self.direction) + turned)


@dataclass(frozen=True)
class Movement:
    """Movement of the probe: ``motions`` times their amounts (m, or rad); translations have orthogonal directions.

    ``decoupled`` says that symmetry decouples the motions: none does work in another. ``loads`` are dead loads on the
    tissue. ``pull`` (m) is that of two jaws along the surface, after the motions.
    """

    motions: tuple[Motion, ...]
    amounts: tuple[float, ...]
    decoupled: bool = False
    loads: Loads | None = None
    pull: Vector | None = None

    @property
    def far(self) -> FarField | None:
        """The far field on the cut face; None if the cut face is fixed or free."""
        return next((motion.far for motion in self.motions if motion.far is not None), None)

    @property
    def shares(self) -> FloatArray:
        """Amplitude of the far field in each motion."""
        return np.array([motion.share for motion in self.motions])

    @staticmethod
    def along(travel: Vector, *, decoupled: bool = False) -> "Movement":
        """Return the movement of a probe along ``travel`` (m): it presses by −z and slides by x and y."""
        x, y, z = travel
        slide = hypot(x, y)
        press = Motion((0.0, 0.0, -1.0))
        if not slide:
            return Movement((press,), (-z,))
        return Movement((press, Motion((x / slide, y / slide, 0.0))), (-z, slide), decoupled)

    @staticmethod
    def all(travel: Vector, centre: Vector) -> "Movement":
        """Return ``travel`` (m) as an amount of all six rigid motions: along x, y, z, and about axes at ``centre``."""
        axes: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        motions = [Motion(axis) for axis in axes] + [Motion(rotation=axis, centre=centre) for axis in axes]
        return Movement(tuple(motions), (*travel, 0.0, 0.0, 0.0))

    def opened(self, normal: Vector, amount: float) -> "Movement":
        """Return the movement of a probe that also moves each face of a slit ``amount`` (m) off its plane."""
        return replace(self, motions=(*self.motions, Motion(opening=normal)), amounts=(*self.amounts, amount))

    def with_far(self, far: FarField) -> "Movement":
        """Return the movement with a unit of the ``far`` field as one more motion, of unknown amplitude."""
        return Movement((*self.motions, Motion(far=far, share=1.0)), (*self.amounts, 0.0))

    def closed(self, share: float) -> "Movement":
        """Return the movement of one motion and a far field as a single motion, with that ``share`` of the field."""
        press, far = self.motions
        return Movement((replace(press, far=far.far, share=share),), self.amounts[:1])
