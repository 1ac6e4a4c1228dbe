"""Local compliances c and h of a body with E = 1, at any place of a region: one coarse mesh, one factorisation."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import pi

import numpy as np
from mpi4py import MPI

from epsmesh.arrays import FloatArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.solve.far_field import PointForce
from epsmesh.solve.greens_function import regular_parts
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.terms import AddedTerm
from epsmesh.stages import stage
from epsmesh.study.case import Case
from epsmesh_realtime.export.ranks import ALONE, Ranks
from epsmesh_realtime.export.region import Region, coarse_case
from epsmesh_realtime.export.scope import Scope
from epsmesh_realtime.export.side_force import SideForce

# A mid node this far from the middle, in units of its edge's length, is a quarter point.
_ASIDE = 0.2
# Point forces at a place: one along the normal, two along the face.
_FORCES = 3


@stage("export mesh")
def coarse_mesh(case: Case, region: Region, ranks: Ranks = ALONE) -> BodyMesh:
    """Return a mesh of the whole body for all places of a region.

    The first of ``ranks`` makes it, and each rank gets all of it.

    Raises:
        MeshError: if the body cannot be meshed.
    """
    meshed = coarse_case(case, region)
    arrays = ranks.on_first(lambda: mesh_arrays(meshed, ()))
    return distribute(MPI.COMM_SELF, _without_quarter_points(arrays))


def _without_quarter_points(arrays: MeshArrays) -> MeshArrays:
    """Return the mesh with all mid nodes in the middle of their edges: there is no singularity at a region's edge.

    An element with quarter points on two sides of a facet has a singular Jacobian at the corner, where quadrature may
    need it.
    """
    if arrays.cells.shape[1] == len(EDGES) + 4:
        (p, q), mid = np.moveaxis(arrays.points[arrays.cells[:, EDGES]], 2, 0), arrays.points[arrays.cells[:, 4:]]
        share = np.einsum("nei,nei->ne", mid - p, q - p) / np.einsum("nei,nei->ne", q - p, q - p)
        points, moved = arrays.points.copy(), np.abs(share - 0.5) > _ASIDE
        points[arrays.cells[:, 4:][moved]] = ((p + q) / 2)[moved]
        arrays = replace(arrays, points=points)
    return arrays


def law_of(scope: Scope, poisson: float) -> MaterialLaw | None:
    """Return a body's tissues in units of μ at its face, for a Poisson's ratio there; None if there is one tissue."""
    tissues = scope.tissues_at(poisson)
    return replace(MaterialLaw.of(*tissues), unit=scope.shear_at(poisson)) if tissues else None


def per_newton(force: PointForce) -> float:
    """Return the factor from the field of a unit force to that of one newton, for E = 1.

    The unit of force is 4πμ times the radius, and E = 2 (1 + ν) μ.
    """
    return 2 * (1 + force.poisson) / (4 * pi * force.radius)


def compliances(
    body: BodyMesh,
    region: Region,
    places: Sequence[tuple[float, float]],
    poisson: float,
    law: MaterialLaw | None = None,
    terms: Sequence[AddedTerm] = (),
) -> FloatArray:
    """Return the values to tabulate, shape (places, 9): see :func:`each_compliance`."""
    return np.array(list(each_compliance(body, region, places, poisson, law, terms)))


@stage("regular parts")
def each_compliance(
    body: BodyMesh,
    region: Region,
    places: Sequence[tuple[float, float]],
    poisson: float,
    law: MaterialLaw | None = None,
    terms: Sequence[AddedTerm] = (),
) -> Iterator[FloatArray]:
    """Yield the values to tabulate at each place, shape (9,); ``law`` gives the tissues of a body with several.

    ``terms`` are the capsules of its regions.

    The values are c (1/m); h, A₁, A_xy (1/m³); and of R (1/m): R_xz, R_yz, the mean of R_xx and R_yy, half their
    difference, R_xy. See ``epsmesh_realtime.table``.

    Raises:
        SolveError: if a solve fails, or if the mesh is too coarse.
    """
    forces: list[PointForce] = []
    for x, y in places:
        centre = (x, y, 0.0), region.room(x, y)
        forces += [PointForce(poisson, *centre), *(SideForce(poisson, *centre, direction) for direction in (0, 1))]
    parts = regular_parts(body, forces, law, terms)
    for force, pressed, *pulled in zip(forces[::_FORCES], parts, parts, parts, strict=True):
        at, bent = pressed.at_centre()
        apart, twist = pressed.bends()
        along, across = (part.at_centre()[0] for part in pulled)
        # The pressing force points down.
        normal = (-at[2], -bent[2], -apart[2], -twist[2], -at[0], -at[1])
        aside = (along[0] + across[1]) / 2, (along[0] - across[1]) / 2, (along[1] + across[0]) / 2
        yield per_newton(force) * np.array([*normal, *aside])
