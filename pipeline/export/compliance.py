"""c and h of a body, of E = 1, at any places of a region of its top: one coarse mesh and one factorisation for all."""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
from mpi4py import MPI

from pipeline.arrays import FloatArray
from pipeline.export.ranks import ALONE, Ranks
from pipeline.export.region import Region
from pipeline.export.scope import Scope
from pipeline.export.side_force import SideForce
from pipeline.mesh.curve import EDGES
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays
from pipeline.mesh.of_case import mesh_arrays
from pipeline.shapes.probes.blade import Blade
from pipeline.shapes.probes.disc import Disc
from pipeline.solve.far_field import PointForce
from pipeline.solve.greens_function import regular_parts
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case

# Elements of the mesh: so many along the way from the region's edge to the sides, so many through the thickness, or on
# the way to other tissue; they grow by so much in between.
_NEAR, _THROUGH, _TO_TISSUE, _GROWTH = 2.5, 4, 2, 0.4
# A mid node this far from the middle, in lengths of its edge, is a quarter point.
_ASIDE = 0.2


@stage("export mesh")
def coarse_mesh(case: Case, region: Region, finer: float = 1.0, ranks: Ranks = ALONE) -> BodyMesh:
    """Return a mesh of the whole body for all places of a region, elements smaller by a factor ``finer``.

    The first of ``ranks`` makes it, and each has it whole.

    Raises:
        MeshError: if the body cannot be meshed.
    """
    through = _TO_TISSUE if case.body.regions else _THROUGH
    near, far = region.margin / (_NEAR * finer), region.thickness / (through * finer)
    near = min(near, far) if case.body.regions else near
    size: dict[str, Any] = {"depth": region.margin, "at": (0.0, 0.0), "axis": None}
    if region.is_round:
        probe: Any = Disc.model_construct(shape="disc", radius=region.reach[0], **size)
    else:
        length, width = 2 * region.reach[0], 2 * region.reach[1]
        probe = Blade.model_construct(shape="blade", length=length, width=width, **size)
    mesh = Mesh.model_construct(epsilon=region.margin, fine=near, coarse=max(near, far), rim=near, growth=_GROWTH)
    arrays = ranks.on_first(lambda: mesh_arrays(replace(case, probe=probe, mesh=mesh), ()))
    return distribute(MPI.COMM_SELF, _without_quarter_points(arrays))


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


def law_of(scope: Scope, poisson: float) -> MaterialLaw | None:
    """Return the tissues of a body in units of μ at its face, where they are several, for a Poisson's ratio there."""
    tissues = scope.tissues_at(poisson)
    return MaterialLaw.of(*tissues) if tissues else None


def per_newton(force: PointForce) -> float:
    """Return the number of units of a force's field that make one newton, for E = 1.

    A unit is 4πμ times the radius newtons, and E = 2 (1 + ν) μ.
    """
    return 2 * (1 + force.poisson) / (4 * pi * force.radius)


@stage("regular parts")
def compliances(
    body: BodyMesh,
    region: Region,
    places: Sequence[tuple[float, float]],
    poisson: float,
    law: MaterialLaw | None = None,
) -> FloatArray:
    """Return what tables are made of, shape (places, 9), with a ``law`` of several regions if there are any.

    They are c (1/m), h, A₁, A_xy (1/m³), and of R (1/m) R_xz, R_yz, the mean of R_xx and R_yy, half their difference,
    and R_xy: see ``pipeline.realtime.table``.

    Raises:
        SolveError: if they cannot be solved for, or if the mesh is too coarse.
    """
    centres = [((x, y, 0.0), region.room(x, y)) for x, y in places]
    down = [PointForce(poisson, *centre) for centre in centres]
    aside = [SideForce(poisson, *centre, direction) for centre in centres for direction in (0, 1)]
    parts = list(regular_parts(body, [*down, *aside], law))
    found = []
    for number, force in enumerate(down):
        scale = per_newton(force)
        pressed, *pulled = parts[number], *parts[len(down) + 2 * number : len(down) + 2 * number + 2]
        at, bent = pressed.at_centre()
        apart, twist = pressed.bends()
        x, y = (part.at_centre()[0] for part in pulled)
        # The force that presses is downwards.
        normal = (-at[2], -bent[2], -apart[2], -twist[2], -at[0], -at[1])
        found.append(scale * np.array([*normal, (x[0] + y[1]) / 2, (x[0] - y[1]) / 2, (x[1] + y[0]) / 2]))
    return np.array(found)
