"""A slit with a blade in it: a plane crack below the surface, whose faces the blade opens by its width.

In the probe's own coordinates the slit is the plane across = 0 down to its front at height -depth. The blade touches
both faces along its length, from the surface down to its tip. The front is ``ahead`` of the tip, and ``beside`` the
blade's ends.
"""

from dataclasses import dataclass
from math import inf, isfinite

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body

# A point is on a line of the slit within this distance, in units of its depth.
_ON = 1e-6


@dataclass(frozen=True)
class Slit:
    """Sizes (m): ``depth`` of the front, ``length`` and ``width`` of the blade, and slit length ``ahead`` of its tip.

    With ``is_open`` the slit extends to the sides of the body; otherwise it ends ``beside`` the blade's ends.
    """

    depth: float
    length: float
    width: float
    ahead: float
    beside: float
    is_open: bool

    @property
    def tip(self) -> float:
        """Depth (m) of the blade's tip."""
        return self.depth - self.ahead

    @property
    def reach(self) -> float:
        """Half of the slit's length (m), infinite if it is open."""
        return inf if self.is_open else self.length / 2 + self.beside

    @property
    def on_surface(self) -> float:
        """Half of the length (m) that must be within the body: of the slit, or of the blade in an open slit."""
        return self.length / 2 if self.is_open else self.reach

    @property
    def half_width(self) -> float:
        """Half of the smallest distance (m) between lines at which the displacement is singular."""
        return min(self.clear, self.tip, self.length) / 2

    @property
    def edges(self) -> float:
        """Length (m) of the lines at which the displacement is singular; in an open slit, of those near the blade."""
        front = self.length + 4 * self.depth if self.is_open else 2 * (self.reach + self.depth)
        return 2 * (self.length + self.tip) + front

    def touched(self) -> FloatArray:
        """Return the corners (4, 3), in own coordinates (m), of the part of a face that the blade touches."""
        a, t = self.length / 2, self.tip
        return _polygon([(-a, -t), (a, -t), (a, 0.0), (-a, 0.0)])

    def free(self, far: float) -> list[FloatArray]:
        """Return the corners of the pieces of the rest of a face; an open slit is drawn out to ``far`` (m).

        Two pieces meet at every corner of the front, so that no triangle has all of its corners on it. Both faces share
        the nodes of the front, which would close such a triangle.
        """
        a, t, c = self.length / 2, self.tip, self.depth
        if self.is_open:
            return [
                _polygon([(-a, -c), (a, -c), (a, -t), (-a, -t)]),
                _polygon([(-far, -c), (-a, -c), (-a, -t), (-a, 0.0), (-far, 0.0)]),
                _polygon([(far, 0.0), (a, 0.0), (a, -t), (a, -c), (far, -c)]),
            ]
        b = self.reach
        return [
            _polygon([(-a, -t), (-b, -c), (b, -c), (a, -t)]),
            _polygon([(-a, 0.0), (-b, 0.0), (-b, -c), (-a, -t)]),
            _polygon([(b, 0.0), (a, 0.0), (a, -t), (b, -c)]),
        ]

    def is_singular(self, points: FloatArray) -> bool:
        """Return whether ``points`` (n, 3) of a line, in own coordinates, are on the front or the contact's edge."""
        along, down, close = np.abs(points[:, 0]), -points[:, 2], _ON * self.depth
        within, sunk = along < self.length / 2 + close, down < self.tip + close
        lines = [
            within & (np.abs(down) < close),
            within & (np.abs(down - self.tip) < close),
            sunk & (np.abs(along - self.length / 2) < close),
            np.abs(down - self.depth) < close,
        ]
        if isfinite(self.reach):
            lines.append(np.abs(along - self.reach) < close)
        return any(bool(line.all()) for line in lines)

    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the front and to the edge of the contact as text, in units of 1/``unit`` m."""
        half = self.tip / 2
        touched = to_rectangle(
            f"(Fabs({along})-{unit * self.length / 2:.12g})", f"(Fabs({height}+{unit * half:.12g})-{unit * half:.12g})"
        )
        front = f"(Fabs({height})-{unit * self.depth:.12g})"
        if isfinite(self.reach):
            # Mirrored at the surface: a slit has no edge at its mouth.
            front = to_rectangle(f"(Fabs({along})-{unit * self.reach:.12g})", front)
        return f"Sqrt(Min({touched}^2,{front}^2)+{across}^2)"

    def room(self, body: Body) -> float:
        """Return the distance (m) from the front to the nearest of: blade, interface of layers, bottom, support."""
        top = body.heights[1]
        ends = (*body.interfaces, *body.hold.edges(), body.heights[0])
        return min(self.clear, *(abs(end - top + self.depth) for end in ends))

    def room_at_tip(self, body: Body) -> float:
        """Return the distance (m) from the blade's tip to the nearest of: front, surface, interface of layers."""
        top = body.heights[1]
        return min(self.clear, self.tip, *(abs(end - top + self.tip) for end in body.interfaces))

    @property
    def clear(self) -> float:
        """The least distance (m) of the front from the blade."""
        return self.ahead if self.is_open else min(self.ahead, self.beside)


def _polygon(points: list[tuple[float, float]]) -> FloatArray:
    return np.array([(along, 0.0, height) for along, height in points])


def to_rectangle(p: str, q: str) -> str:
    """Return the distance to a rectangle's sides as text, negative inside; p and q are distances past the sides."""
    return f"(Sqrt(Max({p},0)^2+Max({q},0)^2)+Min(Max({p},{q}),0))"
