"""What closes the half ball of a case: a point force's field on a half-space, or on the body itself."""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from mpi4py import MPI

from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.of_case import mesh_arrays
from pipeline.plan import estimate
from pipeline.plan.symmetry import mirror_planes
from pipeline.shapes.body import Body
from pipeline.shapes.probes.blade import Blade
from pipeline.shapes.probes.disc import Disc
from pipeline.solve.far_field import FarField, Place, PointForce
from pipeline.solve.regular import BodyField, Smooth, regular_part, regular_parts
from pipeline.stages import stage
from pipeline.study.closure import room
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case

# Elements of the mesh that the regular part is found on: so many along the way to the nearest side or the bottom, and
# through the thickness; and by how much they grow. Where it is felt, half of them moves F by less than 1e-3.
_NEAR, _THROUGH, _GROWTH = 4, 3, 0.5
# And of one mesh for many places.
_THROUGH_FOR_MANY = 4
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


def share_far_fields(study: Iterable[Case], needed: Iterable[Case]) -> None:
    """Find what closes the half balls of ``needed``, at several places, by one mesh and one factorisation for a body.

    The mesh is made for all places of the cases of the ``study``, whichever of them are on record already: a run that
    goes on finds the same. Where it is more than one for each place, that is left to be done when they are asked for.

    Raises:
        MeshError: if the body cannot be meshed.
        SolveError: if the regular parts cannot be solved.
    """
    places: dict[Body, dict[Place, Case]] = {}
    for case in study:
        if case.has_own_far_field:
            places.setdefault(case.body, {})[case.frame.point] = case
    wanted: dict[tuple[Body, float], dict[Place, Case]] = {}
    for case in needed:
        if case.has_own_far_field and _key(case) not in _known:
            wanted.setdefault((case.body, case.material.poisson), {})[case.frame.point] = case
    meshes: dict[Body, BodyMesh] = {}
    for (body, ratio), found in wanted.items():
        if (coarse := _coarse_for_many(list(places[body].values()))) is not None:
            if body not in meshes:
                meshes[body] = distribute(MPI.COMM_SELF, mesh_arrays(coarse, ()))
            _find(meshes[body], ratio, found)


@stage("far field")
def _find(mesh: BodyMesh, ratio: float, cases: Mapping[Place, Case]) -> None:
    start = time.perf_counter()
    forces = [PointForce(ratio, place, room(case.body, case.probe)) for place, case in cases.items()]
    found = list(regular_parts(mesh, forces))
    seconds = (time.perf_counter() - start) / len(found)
    for case, smooth in zip(cases.values(), found, strict=True):
        _known[_key(case)] = smooth, seconds


def _coarse_for_many(cases: Sequence[Case]) -> Case | None:
    """Return a case on whose mesh all regular parts are found, None if that has more elements than one for each.

    Its blade, no tool, spans all places: elements are small along it.
    """
    rooms = [room(case.body, case.probe) for case in cases]
    places, near = np.array([case.frame.point[:2] for case in cases]), min(rooms) / _NEAR
    low, high = places.min(axis=0) - near, places.max(axis=0) + near
    top = cases[0].frame.point[2]
    corners = product((low[0], high[0]), (low[1], high[1]), (top,))
    if len(cases) < 2 or any(cases[0].body.gap(corner) < near for corner in corners):
        return None
    (length, width), (x, y) = map(float, high - low), map(float, (low + high) / 2)
    depth, (bottom, _) = min(rooms), cases[0].body.heights
    blade = Blade.model_construct(shape="blade", length=length, width=width, depth=depth, at=(x, y))
    coarse = max(near, (top - bottom) / _THROUGH_FOR_MANY)
    mesh = Mesh.model_construct(epsilon=depth, fine=near, coarse=coarse, rim=near, growth=_GROWTH)
    many = replace(cases[0], probe=blade, mesh=mesh)
    each = sum(
        estimate.cells(one) * 0.5 ** len(mirror_planes(one))
        for one in (_coarse(case, radius) for case, radius in zip(cases, rooms, strict=True))
    )
    return many if estimate.cells(many) < each else None


def _key(case: Case) -> tuple[Body, Place, float]:
    return case.body, case.frame.point, case.material.poisson


@stage("far field")
def _regular(case: Case) -> tuple[Smooth, float]:
    """Return the regular part for a unit of a point force with the largest half ball, and the seconds it took.

    Nothing in it is the tool's: all tools at one place share it, and all ε.
    """
    key = _key(case)
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
