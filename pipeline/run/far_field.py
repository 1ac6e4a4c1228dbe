"""What closes the half ball of a case: a point force's field on a half-space, or on the body itself."""

import time
from dataclasses import replace

from mpi4py import MPI

from pipeline.mesh.distribute import distribute
from pipeline.mesh.of_case import mesh_arrays
from pipeline.plan.symmetry import mirror_planes
from pipeline.shapes.body import Body
from pipeline.shapes.probes.disc import Disc
from pipeline.solve.far_field import FarField, Place, PointForce
from pipeline.solve.regular import BodyField, Smooth, regular_part
from pipeline.stages import stage
from pipeline.study.closure import room
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case

# Elements of the mesh that the regular part is found on: so many along the way to the nearest side or the bottom, and
# through the thickness; and by how much they grow. Where it is felt, half of them moves F by less than 1e-3.
_NEAR, _THROUGH, _GROWTH = 4, 3, 0.5
# Regular parts by body, place and Poisson's ratio, with the seconds that each took: some kilobytes each.
_known: dict[tuple[Body, Place, float], tuple[Smooth, float]] = {}


def far_field_of(case: Case) -> FarField:
    """Return the far field of a closed case; every rank finds it for itself.

    Raises:
        MeshError: if the body cannot be meshed.
        SolveError: if the regular part cannot be solved.
    """
    near = PointForce(case.material.poisson, case.frame.point, case.column)
    if not case.has_own_far_field:
        return near
    return BodyField(near, *_regular(case))


@stage("far field")
def _regular(case: Case) -> tuple[Smooth, float]:
    """Return the regular part for a unit of a point force with the largest half ball, and the seconds it took.

    Nothing in it is the tool's: all tools at one place share it, and all ε.
    """
    key = case.body, case.frame.point, case.material.poisson
    if key not in _known:
        start = time.perf_counter()
        radius = room(case.body, case.probe)
        coarse = _coarse(case, radius)
        mesh = distribute(MPI.COMM_SELF, mesh_arrays(coarse, mirror_planes(coarse)))
        found = regular_part(mesh, PointForce(case.material.poisson, case.frame.point, radius))
        _known[key] = found, time.perf_counter() - start
    return _known[key]


def _coarse(case: Case, radius: float) -> Case:
    """Return a case on whose mesh the regular part is found: its disc is no tool, but what a mesh is made round."""
    low, high = case.body.heights
    near = radius / _NEAR
    far = max(near, (high - low) / _THROUGH)
    disc = Disc.model_construct(shape="disc", radius=radius / 2, depth=radius, at=case.probe.at)
    mesh = Mesh.model_construct(epsilon=radius, fine=near, coarse=far, rim=near, growth=_GROWTH)
    return replace(case, probe=disc, mesh=mesh)
