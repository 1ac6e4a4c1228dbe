"""c and h of a body, of E = 1, at any places of a region of its top: one coarse mesh and one factorisation for all."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline.arrays import FloatArray
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays
from pipeline.mesh.of_case import mesh_arrays
from pipeline.shapes.bodies.box import Box
from pipeline.shapes.bodies.cylinder import Cylinder
from pipeline.shapes.probes.blade import Blade
from pipeline.shapes.probes.disc import Disc
from pipeline.solve.far_field import PointForce
from pipeline.solve.regular import regular_parts
from pipeline.stages import stage
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case

# Elements of the mesh: so many along the way from the region's edge to the sides, so many through the thickness; they
# grow by so much in between.
_NEAR, _THROUGH, _GROWTH = 2.5, 4, 0.4
# A mid node this far from the middle, in lengths of its edge, is a quarter point.
_ASIDE = 0.2


@dataclass(frozen=True)
class Region:
    """What is tabulated of a face: half extents (m) of both, or radii twice, and the thickness (m) below."""

    reach: tuple[float, float]
    sides: tuple[float, float]
    thickness: float
    is_round: bool

    @staticmethod
    def of(body: Box | Cylinder, share: float) -> "Region":
        """Return the region that leaves out the ``share`` of the smaller of half the width and the thickness."""
        if isinstance(body, Cylinder):
            sides, thickness = (body.radius, body.radius), body.height
        else:
            sides, thickness = (body.size[0] / 2, body.size[1] / 2), body.size[2]
        left = share * min(*sides, thickness)
        return Region((sides[0] - left, sides[1] - left), sides, thickness, isinstance(body, Cylinder))

    @property
    def margin(self) -> float:
        """The way (m) from the region to the sides."""
        return self.sides[0] - self.reach[0]

    def room(self, x: float, y: float) -> float:
        """Return the way (m) from a place to the nearest side, or to the bottom."""
        if self.is_round:
            return min(self.sides[0] - float(np.hypot(x, y)), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)


@stage("export mesh")
def coarse_mesh(case: Case, region: Region, finer: float = 1.0) -> BodyMesh:
    """Return a mesh of the whole body for all places of a region, elements smaller by a factor ``finer``.

    Raises:
        MeshError: if the body cannot be meshed.
    """
    near, far = region.margin / (_NEAR * finer), region.thickness / (_THROUGH * finer)
    size: dict[str, Any] = {"depth": region.margin, "at": (0.0, 0.0), "axis": None}
    if region.is_round:
        probe: Any = Disc.model_construct(shape="disc", radius=region.reach[0], **size)
    else:
        length, width = 2 * region.reach[0], 2 * region.reach[1]
        probe = Blade.model_construct(shape="blade", length=length, width=width, **size)
    mesh = Mesh.model_construct(epsilon=region.margin, fine=near, coarse=max(near, far), rim=near, growth=_GROWTH)
    return distribute(MPI.COMM_SELF, _without_quarter_points(mesh_arrays(replace(case, probe=probe, mesh=mesh), ())))


def _without_quarter_points(arrays: MeshArrays) -> MeshArrays:
    """Return a mesh whose edges all have their mid nodes in the middle: nothing is singular at the edge of a region.

    An element with quarter points on two sides of a facet has no Jacobian in its corner, where quadrature may need it.
    """
    if arrays.cells.shape[1] == len(EDGES) + 4:
        (p, q), mid = np.moveaxis(arrays.points[arrays.cells[:, EDGES]], 2, 0), arrays.points[arrays.cells[:, 4:]]
        share = np.einsum("nei,nei->ne", mid - p, q - p) / np.einsum("nei,nei->ne", q - p, q - p)
        points, moved = arrays.points.copy(), np.abs(share - 0.5) > _ASIDE
        points[arrays.cells[:, 4:][moved]] = ((p + q) / 2)[moved]
        arrays = replace(arrays, points=points)
    return arrays


@stage("regular parts")
def compliances(body: BodyMesh, region: Region, places: Sequence[tuple[float, float]], poisson: float) -> FloatArray:
    """Return c (1/m) and h (1/m³), shape (places, 2), for a Poisson's ratio.

    Raises:
        SolveError: if they cannot be solved for, or if the mesh is too coarse.
    """
    forces = [PointForce(poisson, (x, y, 0.0), region.room(x, y)) for x, y in places]
    found = []
    for force, regular in zip(forces, regular_parts(body, forces), strict=True):
        (*_, up), (*_, bent) = regular.at_centre()
        # Of a unit of the field, 4πμ times the radius newtons, and E = 2 (1 + ν) μ.
        scale = -2 * (1 + poisson) / (4 * pi * force.radius)
        found.append((scale * up, scale * bent))
    return np.array(found)
