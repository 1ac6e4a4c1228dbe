"""A half-space that touches a curved body at a place: its field, and the body's boundary loads by that field."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import form
from epsmesh.solve.far_field import PointForce

Vector = tuple[float, float, float]

# The boundary loads grow like 1/distance towards the force, so quadrature needs this degree.
_QUADRATURE = 8


@dataclass(frozen=True)
class PlacedForce(PointForce):
    """A half-space under a point force along ``-turn[2]``; the rows of ``turn``: two tangents, the outward normal.

    Within ``blunt`` (m) of the force the boundary is taken as the half-space's own face, without load.
    """

    turn: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    blunt: float = 0.0

    @property
    def outward(self) -> Vector:
        """The outward unit normal of the half-space."""
        return self.turn[2]

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) by a unit force, in m."""
        return np.asarray(self._plain.at(self._local(points)) @ self._rows)

    def stress(self, points: FloatArray) -> FloatArray:
        """Return the stress (n, 3, 3) by a unit force, in units of μ; 0 at the force itself."""
        return np.asarray(self._rows.T @ self._plain.stress(self._local(points)) @ self._rows)

    def above(self, points: FloatArray) -> float:
        """Return the largest cosine of the angle between normal and direction to a point (n, 3) outside ``blunt``."""
        local = self._local(points)
        distance = np.linalg.norm(local, axis=1)
        return float((local[:, 2] / np.where(distance > max(self.blunt, 1e-12 * self.radius), distance, np.inf)).max())

    def pull(self, space: Any, places: FloatArray) -> "PlacedPull":
        """Return the load vectors of such forces on the boundary of ``space``."""
        return PlacedPull(space)

    def _local(self, points: FloatArray) -> FloatArray:
        return np.asarray((points - np.array(self.centre)) @ self._rows.T)

    @cached_property
    def _rows(self) -> FloatArray:
        return np.array(self.turn)

    @cached_property
    def _plain(self) -> PointForce:
        return PointForce(self.poisson, (0.0, 0.0, 0.0), self.radius)


class PlacedPull:
    """∫ σn·v on the whole boundary, with σ of a :class:`PlacedForce` in closed form at the quadrature points.

    On a curved boundary the stress grows like 1/distance², but its traction only like 1/distance. An interpolated
    stress would lose this cancellation.
    """

    def __init__(self, space: Any) -> None:
        mesh = space.mesh
        self._centre, self._turn = fem.Constant(mesh, np.zeros(3)), fem.Constant(mesh, np.eye(3))
        self._numbers = fem.Constant(mesh, np.zeros(3))  # ν, radius, blunt
        measure = ufl.ds(domain=mesh, metadata={"quadrature_degree": _QUADRATURE})
        self._form = form(ufl.inner(self._traction(mesh), ufl.TestFunction(space)) * measure)

    def of(self, force: PlacedForce) -> FloatArray:
        """Return the load vector of this process, in units of μ."""
        self._centre.value[:] = force.centre
        self._turn.value[:] = force.turn
        self._numbers.value[:] = force.poisson, force.radius, force.blunt
        return np.asarray(fem.assemble_vector(self._form).array)

    def _traction(self, mesh: Any) -> Any:
        """As ``PointForce.stress``, times the normal."""
        softness, radius, blunt = 1 - 2 * self._numbers[0], self._numbers[1], self._numbers[2]
        x = ufl.dot(self._turn, ufl.SpatialCoordinate(mesh) - self._centre)
        n = ufl.dot(self._turn, ufl.FacetNormal(mesh))
        r, depth = ufl.sqrt(ufl.dot(x, x)), -x[2]
        flat, level = ufl.as_vector([x[0], x[1], 0]), ufl.as_vector([n[0], n[1], 0])
        share, across = 1 / (r * (r + depth)), ufl.dot(flat, flat)
        pull = -3 * depth * ufl.dot(x, n) / r**5 * x
        pull += softness * (2 * share - depth / r**3) / across * ufl.dot(flat, n) * flat
        pull += softness * (depth / r**3 - share) * level
        pull = ufl.conditional(ufl.gt(r, blunt), 2 * radius * pull, ufl.as_vector([0.0, 0.0, 0.0]))
        return ufl.dot(ufl.transpose(self._turn), pull)
