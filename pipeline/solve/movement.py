"""What the probe does: a rigid movement, put together of a few that are each solved for once."""

from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.far_field import FarField
from pipeline.solve.loads import Loads

Vector = tuple[float, float, float]

_ZERO: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Motion:
    """A unit of one movement: along the unit vector ``direction``, or about the axis ``rotation`` of a point.

    A unit is a metre, or, for the small rotation ω × (x − ``centre``), a radian. ``opening`` moves what the probe
    touches of a slit's faces apart, each by a metre: the face on the side of that unit vector along it, the other back.
    ``far`` moves the cut face, by ``share`` of a unit of that field.
    """

    direction: Vector = _ZERO
    rotation: Vector = _ZERO
    centre: Vector = _ZERO
    opening: Vector = _ZERO
    far: FarField | None = None
    share: float = 0.0

    @property
    def is_rotation(self) -> bool:
        """Whether it turns the probe."""
        return any(self.rotation)

    @property
    def is_translation(self) -> bool:
        """Whether it moves the probe along a direction."""
        return any(self.direction)

    def at(self, points: FloatArray, sides: FloatArray | None = None) -> FloatArray:
        """Return the displacement of a unit (m), at ``points`` (m), shape (points, 3).

        ``sides`` (points) are 1 or -1, for the faces of a slit on either side of its plane.
        """
        if any(self.opening):
            if sides is None:
                raise ValueError("there is no slit to be opened")
            return np.asarray(np.outer(sides, np.array(self.opening)))
        turned = np.cross(np.array(self.rotation), points - np.array(self.centre))
        return np.asarray(np.array(self.direction) + turned)


@dataclass(frozen=True)
class Movement:
    """What moves: the sum of ``motions``, each by its amount (m, or rad); translations are along orthogonal directions.

    ``apart`` says that symmetry keeps the motions apart: none takes any work in the movement of another. ``loads`` are
    the loads that act on the tissue meanwhile.
    """

    motions: tuple[Motion, ...]
    amounts: tuple[float, ...]
    apart: bool = False
    loads: Loads | None = None

    @property
    def far(self) -> FarField | None:
        """What closes the cut face, if it is not simply held."""
        return next((motion.far for motion in self.motions if motion.far is not None), None)

    @property
    def shares(self) -> FloatArray:
        """How much of the far field belongs to each motion."""
        return np.array([motion.share for motion in self.motions])

    @staticmethod
    def along(travel: Vector, *, apart: bool = False) -> "Movement":
        """Return the movement of a probe that presses by −z of ``travel`` (m) and slides by the rest of it."""
        x, y, z = travel
        slide = hypot(x, y)
        press = Motion((0.0, 0.0, -1.0))
        if not slide:
            return Movement((press,), (-z,))
        return Movement((press, Motion((x / slide, y / slide, 0.0))), (-z, slide), apart)

    @staticmethod
    def all(travel: Vector, centre: Vector) -> "Movement":
        """Return ``travel`` (m) as an amount of all six rigid motions: along x, y, z, and about those axes."""
        axes: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        motions = [Motion(axis) for axis in axes] + [Motion(rotation=axis, centre=centre) for axis in axes]
        return Movement(tuple(motions), (*travel, 0.0, 0.0, 0.0))

    def opened(self, normal: Vector, amount: float) -> "Movement":
        """Return the movement of a probe that also holds each face of a slit ``amount`` (m) off its plane."""
        return replace(self, motions=(*self.motions, Motion(opening=normal)), amounts=(*self.amounts, amount))

    def with_far(self, far: FarField) -> "Movement":
        """Return the movement with a unit of the ``far`` field as a motion more, whose amount is to be found."""
        return Movement((*self.motions, Motion(far=far, share=1.0)), (*self.amounts, 0.0))

    def closed(self, share: float) -> "Movement":
        """Return that of one motion and a far field as that of one motion, with that ``share`` of the field."""
        press, far = self.motions
        return Movement((replace(press, far=far.far, share=share),), self.amounts[:1])

    def times(self, factor: float) -> "Movement":
        """Return ``factor`` times the movement."""
        return replace(self, amounts=tuple(factor * amount for amount in self.amounts))
