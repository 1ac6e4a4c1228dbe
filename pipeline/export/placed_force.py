"""A half-space whose face touches a curved body at a place: its field, and what pulls at the body's boundary for it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from pipeline.arrays import FloatArray
from pipeline.solve.compiled import form
from pipeline.solve.far_field import PointForce

Vector = tuple[float, float, float]

# The loads on the boundary grow like 1/distance towards the force: a quadrature that is exact for as much.
_QUADRATURE = 8


@dataclass(frozen=True)
class PlacedForce(PointForce):
    """A half-space under a point force along ``-turn[2]``: the rows of ``turn`` lie along its face, and outwards.

    Nearer to the force than ``blunt`` (m) the boundary is taken to be the half-space's own face.
    """

    turn: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    blunt: float = 0.0

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) of a unit, in m."""
        return np.asarray(self._plain.at(self._local(points)) @ self._rows)

    def stress(self, points: FloatArray) -> FloatArray:
        """Return the stress (n, 3, 3) of a unit, in units of μ, with nothing at the centre itself."""
        return np.asarray(self._rows.T @ self._plain.stress(self._local(points)) @ self._rows)

    def above(self, points: FloatArray) -> float:
        """Return the largest cosine of the angle between the normal and the way to a point (n, 3) that is not blunt."""
        local = self._local(points)
        distance = np.linalg.norm(local, axis=1)
        return float((local[:, 2] / np.where(distance > max(self.blunt, 1e-12 * self.radius), distance, np.inf)).max())

    def pull(self, space: Any, places: FloatArray) -> "PlacedPull":
        """Return what integrates the stresses of such forces over the boundary of ``space``."""
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
    """∫ σn·v on the whole boundary, σ that of a :class:`PlacedForce`, in closed form at the points of quadrature.

    On a curved boundary the stress grows like 1/distance², and what of it the normal leaves like 1/distance:
    polynomials of the stress would not cancel as it does.
    """

    def __init__(self, space: Any) -> None:
        mesh = space.mesh
        self._centre, self._turn = fem.Constant(mesh, np.zeros(3)), fem.Constant(mesh, np.eye(3))
        self._numbers = fem.Constant(mesh, np.zeros(3))  # ν, the radius, and what is blunt
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
