"""Contact of a blade with a body: a flat rectangle with the regular part of ``pipeline.realtime.contact``."""

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, cos, hypot, log, pi, sin, sqrt
from typing import ClassVar

import numpy as np

from pipeline.realtime.place import Array, Contact, Pair, Place, Tool
from pipeline.realtime.table import chebyshev

# Of a rectangle, half sides l ≥ w, E* = 1, in Chebyshev polynomials of 1 - 2 log(w/l)/log(1/50): F/d in units of
# 2 √(l w), <x²>/l² and <y²>/w² of its pressure, and moment per tilt about its short and long axis in l^2.5 w^0.5, l w².
_SLENDER = 0.02
RECTANGLE = np.array(
    [
        [1.5467288, -0.5389724, 0.154788, -0.0121522, 0.0020102, -0.0001257, 6e-06, -1.4e-06],
        [0.4134192, 0.0443058, 0.0039289, -0.0011234, -0.0003526, 1.7e-06, 2.01e-05, 4.2e-06],
        [0.484368, -0.0181444, -0.0053293, -0.0007768, 1.19e-05, 3.22e-05, 7.5e-06, 8e-07],
        [1.8450174, -0.0168921, 0.2328837, 0.0145178, 0.0050319, 0.0002247, -2e-06, -6.7e-06],
        [1.7362244, 0.2238417, 0.0903649, 0.0247386, 0.0048149, 0.0006582, 5.88e-05, 3.6e-06],
    ]
).T
# For display, discs so many half widths apart, with a least and a largest number, represent the blade.
_APART, _FEWEST, _MOST = 1.2, 4, 24


@dataclass(frozen=True)
class Blade(Tool):
    """A flat rectangular punch of half ``length`` and half ``width`` (m), its edge along ``turn`` (rad) from x.

    Its stiffness on a half-space, second moments and tilting stiffness depend on its aspect ratio. They are fitted to
    boundary elements (A. E. H. Love's rectangles, graded to the edges), within 1e-5.
    """

    is_round: ClassVar[bool] = False
    asks_all: ClassVar[bool] = True

    length: float
    width: float
    turn: float

    @property
    def spread(self) -> tuple[float, float]:
        """The second moments (m²) of its pressure along the edge and across, for a unit force."""
        _, along, across, *_ = _rectangle(self.width / self.length)
        return along * self.length**2, across * self.width**2

    def press(self, depth: float, place: Place, most: float) -> Contact | None:
        """Return the contact at a ``depth`` (m), or nothing if half its diagonal is more than ``most`` (m)."""
        long, short = self.length, self.width
        if hypot(long, short) > most or place.shape is None:
            return None
        force, _, _, lean_along, lean_across = _rectangle(short / long)
        stiff = place.plane
        along, across = self.spread
        edge = cos(self.turn), sin(self.turn)
        leans = stiff * lean_along * long**2.5 * short**0.5, stiff * lean_across * short**2 * long
        shape = place.shape
        # e·A·e = h/2 + (A₁ cos 2φ + A_xy sin 2φ), and the other sign across.
        mean, half = (along + across) / 2, along - across
        apart, twist = half * cos(2 * self.turn), half * sin(2 * self.turn)
        soft = 1 / (stiff * force * 2 * sqrt(long * short)) + place.c
        soft += mean * place.h + apart * shape.bent[0] + twist * shape.bent[1]
        of_x, of_y = (
            slope_c + mean * slope_h + apart * slope_apart + twist * slope_twist
            for slope_c, slope_h, slope_apart, slope_twist in zip(
                place.slope_c, place.slope_h, *shape.bent_slopes, strict=True
            )
        )
        (xx, xy), (yx, yy) = shape.hessian
        for lean, (x, y) in zip(leans, (edge, (-edge[1], edge[0])), strict=True):
            slope = shape.lean[0] * x + shape.lean[1] * y
            soft -= lean * slope**2 / 4
            of_x -= lean / 2 * slope * (xx * x + xy * y)
            of_y -= lean / 2 * slope * (yx * x + yy * y)
        push = depth / soft
        squared = 0.5 * push**2
        return Contact(push, (squared * of_x, squared * of_y), 1 / soft, hypot(long, short), along + across)

    def moment(self, force: float, plane: float) -> tuple[float, float]:
        """It does not depend on the force of a flat tool."""
        return sum(self.spread), 0.0

    @property
    def tensor(self) -> Array:
        """From both second moments."""
        along, across = self.spread
        edge = np.array([np.cos(self.turn), np.sin(self.turn)])
        return np.asarray((across * np.eye(2) + (along - across) * np.outer(edge, edge)) / (along + across))

    def spread_of(self, radius: float) -> Array:
        """It does not depend on the radius."""
        along, across = self.spread
        edge = np.array(self.outline[1])
        side = np.array([-edge[1], edge[0]])
        return np.asarray(along * np.outer(edge, edge) + across * np.outer(side, side))

    def discs(self, radius: float) -> tuple[float, Array]:
        """Discs along the edge, at Chebyshev points: the pressure is singular (1/√) at both ends."""
        count = min(max(ceil(2 * self.length / (_APART * self.width)), _FEWEST), _MOST)
        # A disc's second moment in one direction is a third of its squared radius.
        reach = sqrt(2 * max(self.spread[0] - self.width**2 / 3, 0.0))
        return self.width, np.outer(reach * np.cos(pi * (np.arange(count) + 0.5) / count), self.outline[1])

    @property
    def outline(self) -> tuple[Pair, Pair]:
        """Its rectangle."""
        return (self.length, self.width), (cos(self.turn), sin(self.turn))


@lru_cache(64)
def _rectangle(share: float) -> tuple[float, ...]:
    """Return the five coefficients of a rectangle with w/l = ``share``."""
    at = 1 - 2 * log(share) / log(_SLENDER)
    return tuple((np.array(chebyshev(at, len(RECTANGLE))) @ RECTANGLE).tolist())


def blade(length: float, width: float, turn: float) -> Blade | None:
    """Return the blade of a ``length`` and a ``width`` (m), None if it is more slender than the fit."""
    long, short = max(length, width) / 2, min(length, width) / 2
    if short < _SLENDER * long:
        return None
    return Blade(long, short, turn if length >= width else turn + pi / 2)
