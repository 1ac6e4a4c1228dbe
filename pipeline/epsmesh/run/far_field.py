"""The far field of a half-ball case: that of a point force on a half-space, or on the body itself."""

import time
from collections.abc import Iterable
from functools import cache

from mpi4py import MPI

from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.plan.far_fields import far_mesh
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.shapes.body import Body
from epsmesh.solve.far_field import BodyField, PointForce, Smooth
from epsmesh.solve.greens_function import regular_parts
from epsmesh.solve.movement import Place
from epsmesh.stages import stage
from epsmesh.study.case import Case
from epsmesh.study.closure import FarRegion, room

_Key = tuple[Body, Place, float, FarRegion | None]
# Regular parts of Green's functions with the seconds of their solves, by body, place, Poisson's ratio and the region of
# their mesh; some kilobytes each. They do not depend on the tool or ε.
_known: dict[_Key, tuple[Smooth, float]] = {}


def far_field_of(case: Case) -> PointForce | BodyField:
    """Return the far field of a half-ball case; every rank computes it.

    Raises:
        MeshError: if the body cannot be meshed.
        SolveError: if the regular part cannot be solved.
    """
    near = PointForce(case.material.poisson, case.frame.point, case.column)
    if not case.has_own_far_field:
        return near
    if _key(case) not in _known:
        _find(_mesh_of(case), [case])
    smooth, _ = _known[_key(case)]
    return _field(near, smooth)


def far_field_seconds(case: Case) -> float:
    """Return the seconds to solve for a half-ball case's far field; 0 for a closed form."""
    if not case.has_own_far_field:
        return 0.0
    _, seconds = _known[_key(case)]
    return seconds


def share_far_fields(cases: Iterable[Case]) -> None:
    """Compute the far fields of ``cases`` that share a mesh: one factorisation for each body and Poisson's ratio.

    Raises:
        MeshError: if the body cannot be meshed.
        SolveError: if the regular parts cannot be solved.
    """
    wanted: dict[tuple[Body, float], dict[Place, Case]] = {}
    for case in cases:
        if case.far_region is not None and _key(case) not in _known:
            wanted.setdefault((case.body, case.material.poisson), {})[case.frame.point] = case
    meshes: dict[Body, BodyMesh] = {}
    for (body, _), found in wanted.items():
        cases_there = list(found.values())
        if body not in meshes:
            meshes[body] = _mesh_of(cases_there[0])
        _find(meshes[body], cases_there)


@stage("far field")
def _mesh_of(case: Case) -> BodyMesh:
    meshed = far_mesh(case)
    planes = mirror_planes(meshed) if case.far_region is None else ()
    return distribute(MPI.COMM_SELF, mesh_arrays(meshed, planes))


@stage("far field")
def _find(mesh: BodyMesh, cases: list[Case]) -> None:
    """Compute the regular parts of ``cases``, each for a unit point force with the largest half ball at its place."""
    start = time.perf_counter()
    ratio = cases[0].material.poisson
    forces = [PointForce(ratio, case.frame.point, room(case.body, case.probe)) for case in cases]
    found = list(regular_parts(mesh, forces))
    seconds = (time.perf_counter() - start) / len(found)
    for case, smooth in zip(cases, found, strict=True):
        _known[_key(case)] = smooth, seconds


# One object for each far field, because it caches its values.
_field = cache(BodyField)


def _key(case: Case) -> _Key:
    return case.body, case.frame.point, case.material.poisson, case.far_region
