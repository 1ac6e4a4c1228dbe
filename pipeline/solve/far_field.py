"""The field far from a tool that presses on a plane face: what closes a half ball that is cut out round the contact.

Far away only the net force of a tool tells: its field is that of a point force, but for terms of the order a/r (of a
bonded tool, which also pulls sideways) or (a/r)². A *unit* of the far field is what 4πμε newtons a metre make of it, ε
the radius of the half ball: displacements of about a metre on the cut face. What is cut away then takes one unknown,
how much of the far field there is, and is a part of the energy that is made stationary. The force is from above, by the
energy of what the far field leaves out: of the order (a/ε)³ (small, bonded) and (a/ε)⁵.
"""

from dataclasses import dataclass, replace
from math import log, pi

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.solve.movement import Place

# Below the centre there is no direction aside; a point this near to it, in units of the radius, is it.
_TINY, _AT_CENTRE = 1e-14, 1e-9


@dataclass(frozen=True)
class PointForce:
    """A half-space under a point force along -z at ``centre`` (J. Boussinesq, 1885), ``radius`` (m) away from it."""

    poisson: float
    centre: Place
    radius: float

    @property
    def seconds(self) -> float:
        """It is a closed form."""
        return 0.0

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) of a unit, in m: ε/ρ times what depends on the direction alone."""
        outward, distance = self._directions(points)
        cosine, softness = -outward[:, 2], 1 - 2 * self.poisson
        found = (cosine - softness / (1 + cosine))[:, None] * outward
        found[:, 2] = -(cosine**2 + 1 + softness)
        return self.radius / distance[:, None] * found

    def traction(self, points: FloatArray) -> FloatArray:
        """Return the traction (n, 3) of a unit on the half sphere through each point, in units of μ.

        That is σn with n away from the centre.
        """
        outward, distance = self._directions(points)
        cosine = -outward[:, 2]
        found = ((1 - 2 * self.poisson) / (1 + cosine) - 3 * cosine)[:, None] * outward
        found[:, 2] = 3 * cosine**2
        return 2 * self.radius / distance[:, None] ** 2 * found

    def stress(self, points: FloatArray) -> FloatArray:
        """Return the stress (n, 3, 3) of a unit, in units of μ, with nothing at the centre itself."""
        offsets = points - np.array(self.centre)
        distance = np.linalg.norm(offsets, axis=1)
        away = distance > _AT_CENTRE * self.radius
        x, depth, r = offsets[away], -offsets[away, 2], distance[away]
        flat, across = x * (1, 1, 0), np.maximum(r**2 - depth**2, _TINY * r**2)
        share, softness = 1 / (r * (r + depth)), 1 - 2 * self.poisson
        found = np.zeros((len(points), 3, 3))
        found[away] = (-3 * depth / r**5)[:, None, None] * _outer(x)
        found[away] += (softness * (2 * share - depth / r**3) / across)[:, None, None] * _outer(flat)
        found[away] += (softness * (depth / r**3 - share))[:, None, None] * np.diag([1.0, 1.0, 0.0])
        return 2 * self.radius * found

    def stiffness(self, mu: float) -> float:
        """Return twice the strain energy (N/m) of a unit beyond the half ball: -∫ u·σn of the two above."""
        softness = 1 - 2 * self.poisson
        return 4 * pi * mu * self.radius * (2 + softness / 3 + softness**2 * (2 * log(2) - 1))

    def force(self, mu: float) -> float:
        """Return the force (N/m) that makes a unit."""
        return 4 * pi * mu * self.radius

    def moved(self, centre: Place) -> "PointForce":
        """Return that of a force at another ``centre`` (m)."""
        return replace(self, centre=centre)

    def _directions(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (n, 3) from the centre, and distances (n), in m."""
        offsets = points - np.array(self.centre)
        distances = np.linalg.norm(offsets, axis=1)
        return offsets / distances[:, None], distances


def _outer(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors[:, :, None] * vectors[:, None, :])
