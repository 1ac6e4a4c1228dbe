"""Fields of the modulus in a half plane: boxes are halved until polynomials of a low degree follow them."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.generate import MeshError

# Points along each side of a box, and the degree of the polynomials that follow a field there.
_ALONG, _DEGREE = 12, 3
# The deviation from them, relative to the mean, times the size of the box over its distance from the contact, up to
# which a box is small enough: some hundredths of that distance across a kink, some thousandths across a steep rise.
_RESOLVED = 4e-3
# Most boxes that are halved for the sake of a field.
_MOST = 6_000


class RoundField(Protocol):
    """A field without unit in a half plane."""

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values at ``points`` (n, 2), r and z in m from the highest point of the axis.

        Raises:
            SolveError: if one is not positive.
        """


# Maps places (n, 2) in the coordinates of boxes to r and z.
Placed = Callable[[FloatArray], FloatArray]


class Resolution:
    """Judges boxes of a half plane, whose lengths are in units of ``unit`` (m), by the ``fields`` of their regions."""

    def __init__(self, fields: Sequence[RoundField | None], unit: float, place: Placed = lambda points: points):
        """Begin; ``place`` maps the coordinates of boxes to r and z."""
        self._fields, self._unit, self._place, self._count = fields, unit, place, 0
        nodes, _ = np.polynomial.legendre.leggauss(_ALONG)
        values = np.polynomial.legendre.legvander(nodes, _DEGREE)
        self._shares, self._projection = (nodes + 1) / 2, values @ np.linalg.pinv(values)

    def large(self, boxes: FloatArray, sizes: FloatArray, regions: IntArray) -> BoolArray:
        """Return which ``boxes`` (n, 4), of these ``sizes`` and in these regions, do not resolve the field there.

        Raises:
            MeshError: if it would take too many boxes.
        """
        found = np.zeros(len(boxes), dtype=bool)
        for number, field in enumerate(self._fields):
            (chosen,) = np.nonzero(regions == number)
            if field is not None and len(chosen):
                found[chosen] = self._deviation(field, boxes[chosen], sizes[chosen]) > _RESOLVED
        self._count += int(found.sum())
        if self._count > _MOST:
            raise MeshError('a formula of `young` varies too steeply for the meridian: use model = "3d"')
        return found

    def _deviation(self, field: RoundField, boxes: FloatArray, sizes: FloatArray) -> FloatArray:
        low, high, below, above = (side[:, None, None] for side in boxes.T)
        first, second = np.broadcast_arrays(
            low + (high - low) * self._shares[:, None], below + (above - below) * self._shares
        )
        places = self._place(np.stack([first, second], axis=-1).reshape(-1, 2))
        values = field.at(self._unit * places).reshape(len(boxes), _ALONG, _ALONG)
        rest = values - self._projection @ values @ self._projection.T
        distances = np.linalg.norm(places.reshape(len(boxes), -1, 2), axis=2).min(axis=1)
        return np.asarray(rest.std(axis=(1, 2)) / values.mean(axis=(1, 2)) * sizes / (1 + distances))
