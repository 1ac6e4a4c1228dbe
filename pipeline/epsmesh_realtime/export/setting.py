"""The frame of a curved body's model: level over a place of two coordinates, tangent to the face at one of three."""

from dataclasses import dataclass
from math import cos, radians

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import MOST_INCLINED, Frame, PlaceError
from epsmesh.study.case import Case

# Least cosine of the angle between normals of a face.
_STEEP = cos(radians(MOST_INCLINED))


@dataclass(frozen=True, eq=False)
class Setting:
    """Origin (3,), in m, and axes (3, 3), in rows, of a model; the third one points out of the ``body``.

    ``tangent`` is the frame of the study's place, whose normal is the third axis; None if the axes are the body's, with
    the origin at z = 0.
    """

    body: Body
    origin: FloatArray
    axes: FloatArray
    tangent: Frame | None = None

    @staticmethod
    def of(case: Case) -> "Setting":
        """Return the frame for the place of a case."""
        at = case.probe.at
        if len(at) == len("xy"):
            return Setting(case.body, np.array([*at, 0.0]), np.eye(3))
        frame = case.frame.facing((1.0, 0.0, 0.0))
        return Setting(case.body, np.array(frame.point), frame.axes, frame)

    def local(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3), in m, along the axes."""
        return np.asarray((points - self.origin) @ self.axes.T)

    def heights(self, xs: FloatArray, ys: FloatArray) -> FloatArray:
        """Return the face's height (y, x), in m, over the origin, at offsets ``xs`` and ``ys`` (m) along the axes.

        Raises:
            PlaceError: if the face does not extend to one of them, or is too steep there.
        """
        if self.tangent is None:
            left, back, _ = self.origin.tolist()
            return np.array([[self.body.frame((x + left, y + back)).point[2] for x in xs] for y in ys])
        places = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        points, normals = self.body.lift(self.tangent, places)
        if not np.isfinite(points).all():
            raise PlaceError("misses the body, seen along the normal of the study's place")
        if (normals @ self.axes[2]).min() < _STEEP:
            raise PlaceError(f"is inclined by more than {MOST_INCLINED:g}° to the normal of the study's place")
        return np.asarray(self.local(points)[:, 2].reshape(len(ys), len(xs)))


def place_of(axes: FloatArray, point: FloatArray) -> tuple[float, ...]:
    """Return the ``at`` of a study for a ``point`` (3,), in m, of a model's face: two coordinates if it is level."""
    return tuple(point.tolist()[: len("xy") if axes[2, 2] == 1 else len("xyz")])
