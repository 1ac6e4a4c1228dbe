"""The displacement near a tool: that of a half-space under it, for a unit force, in closed forms.

On the face, ρ from the axis of a contact of radius a under a force F, E = 1 (K. L. Johnson, Contact Mechanics, ch. 3
and 5; I. N. Sneddon, 1965):

    disc    w = F/(πE*a)·asin(a/ρ),                                  P(ρ)/F = 1 - (1 - ρ²/a²)^½
    ball    w = 3F/(4πE*a³)·((2a² - ρ²) asin(a/ρ) + a (ρ² - a²)^½),  P(ρ)/F = 1 - (1 - ρ²/a²)^(3/2)
    cone    w = 2F/(πE*a²)·(a asin(a/ρ) + (ρ² - a²)^½ - ρ),          P(ρ)/F = 1 - (1 - ρ²/a²)^½ + ρ²/a² arcosh(a/ρ)

outside the contact. Inside, the face has the tool's shape. The lateral displacement is (1 - 2ν)(1 + ν) P(ρ)/(2πρ)
towards the axis, where P is the force within ρ. Below the face, a contact is represented by its force and second
moment. Near the tool, a curved face uses the closed form of its tangent plane, corrected by a point force for the
distance to that plane. A blade is represented by discs along its edge with the same second moments. At the edge of a
bonded disc there is no displacement towards the axis.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.place import Array, Tool

# Distance from the axis, in units of a, that counts as 0.
_AXIS = 1e-6
# A curved face is near a tool up to so many contact radii, and up to this slope below the tangent plane.
_NEXT, _STEEP = 4.0, 1.0
# Largest height above the force's plane, in units of the distance to the force, for the half-space's field.
_OVER = 0.95
# Largest distance of a contact's points from its plane, in units of its radius.
_BOWED = 0.7


@dataclass(frozen=True, eq=False)
class Footprint:
    """The footprint of a ``tool``: equal contacts of radius ``a`` (m) at ``centres`` (k, 2) in the plane of contact.

    ``spread`` is the second moment ((xx, xy), (xy, yy)) of the whole pressure (m²), for a unit force.
    """

    tool: Tool
    a: float
    centres: Array
    spread: Array

    @staticmethod
    def of(tool: Tool, radius: float) -> "Footprint":
        """Return the footprint of a tool with contact ``radius`` (m)."""
        return Footprint(tool, *tool.discs(radius), tool.spread_of(radius))

    @property
    def reach(self) -> float:
        """The largest distance (m) of the contact from the axis."""
        return self.a if len(self.centres) == 1 else float(np.hypot(*self.tool.outline[0]))

    def within(self, away: Array) -> NDArray[np.intp]:
        """Return which of the points (n, 3), in m from the axis and the plane, are below the footprint."""
        flat = away[:, 0] ** 2 + away[:, 1] ** 2
        near = np.flatnonzero((flat <= self.reach**2) & (np.abs(away[:, 2]) <= _BOWED * self.reach))
        if len(self.centres) > 1:
            (half, (c, s)), (x, y) = self.tool.outline, away[near, :2].T
            near = near[(np.abs(c * x + s * y) <= half[0]) & (np.abs(c * y - s * x) <= half[1])]
        return near

    def field(self, away: Array, poisson: float, flat: float) -> Array:
        """Return the displacement (n, 3), E = 1, at points (n, 3), in m; points within ``flat`` of the plane are on it.

        Below the tool it is the displacement of the contact's edge.
        """
        square = float(np.trace(self.spread))
        is_face = np.abs(away[:, 2]) <= flat
        moved = np.empty_like(away)
        face, other = np.flatnonzero(is_face), np.flatnonzero(~is_face)
        moved[face] = self._on_plane(away[face], poisson, square)
        below = away[other]
        moved[other] = found = boussinesq(below, poisson, square)
        across = below[:, 0] ** 2 + below[:, 1] ** 2
        height = below[:, 2] ** 2
        bent = np.flatnonzero((across + height <= (_NEXT * self.reach) ** 2) & (height <= _STEEP**2 * across))
        if len(bent):
            level = below[bent] * (1.0, 1.0, 0.0)
            less = found[bent] - boussinesq(level, poisson, square)
            moved[other[bent]] = self._on_plane(level, poisson, square) + less
        return moved

    def _on_plane(self, away: Array, poisson: float, square: float) -> Array:
        if len(self.centres) == 1:
            return self._on_face(away[:, :2], poisson)
        moved = boussinesq(away, poisson, square)
        near = np.flatnonzero(away[:, 0] ** 2 + away[:, 1] ** 2 <= (_NEXT * self.reach) ** 2)
        at = away[near, :2]
        moved[near] = sum(self._on_face(at - centre, poisson) for centre in self.centres) / len(self.centres)
        return moved

    def _on_face(self, at: Array, poisson: float) -> Array:
        """Return the displacement (n, 3) at points (n, 2) of the plane, from the middle of the contact."""
        rho = np.maximum(np.sqrt(at[:, 0] ** 2 + at[:, 1] ** 2), _AXIS * self.a)
        sunk, share = on_face(self.tool.kind, rho, self.a, 1 / (1 - poisson**2))
        if self.tool.sticks:
            share = share * np.maximum(1 - (self.a / rho) ** 2, 0.0)
        aside = -(1 - 2 * poisson) * (1 + poisson) / (2 * pi) * share / rho**2
        return np.column_stack([aside * at[:, 0], aside * at[:, 1], -sunk])


def on_face(tool: str, rho: Array, a: float, plane: float) -> tuple[Array, Array]:
    """Return w/F of a half-space outside the contact, and P(ρ)/F; inside, w is that of the edge."""
    far, near = np.maximum(rho, a), np.minimum(rho / a, 1.0)
    angle, beside, left = np.arcsin(a / far), np.sqrt(far**2 - a**2), np.sqrt(1 - near**2)
    if tool == "disc":
        return angle / (pi * plane * a), 1 - left
    if tool == "sphere":
        return 0.75 / (pi * plane * a**3) * ((2 * a**2 - far**2) * angle + a * beside), 1 - left**3
    sunk = 2 / (pi * plane * a**2) * (a * angle - a**2 / (far + beside))
    return sunk, 1 - left + near**2 * np.arccosh(1 / near)


def boussinesq(away: Array, poisson: float, square: float) -> Array:
    """Return the displacement (n, 3) of a half-space under a newton, E = 1, whose mean of ρ² is ``square`` (m²).

    J. Boussinesq, 1885; the second moment adds its Laplacian along the face times a quarter of the mean of ρ².
    """
    flat = away[:, :2]
    across = (flat**2).sum(axis=1)
    one = 1 / np.sqrt(np.maximum(across + away[:, 2] ** 2, square))
    depth = np.maximum(-away[:, 2], -_OVER / one)
    third, soft = one**3, 1 - 2 * poisson
    fifth, quarter = third * one**2, square / 4
    bend = 15 * across * one**2
    aside = depth * third - soft * one / (1 / one + depth)
    aside += quarter * fifth * depth * (bend - 12 + 3 * soft)
    down = depth**2 * third + (1 + soft) * one
    down += quarter * (depth**2 * fifth * (bend - 6) + (1 + soft) * third * (1 - 3 * depth**2 * one**2))
    return (1 + poisson) / (2 * pi) * np.column_stack([aside[:, None] * flat, -down])
