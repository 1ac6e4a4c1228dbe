"""The mesh of a case: its geometry and sizes, meshed on the part that symmetry leaves, and reflected."""

from dataclasses import replace
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from pipeline.mesh.curve import curve
from pipeline.mesh.elliptic_meridian import EllipticMeridian
from pipeline.mesh.generate import MeshArrays, generate
from pipeline.mesh.meridian import Meridian
from pipeline.mesh.reflect import reflect
from pipeline.mesh.size import Sizes
from pipeline.mesh.slit import open_slit
from pipeline.plan.symmetry import mirror_planes
from pipeline.scene.model import Scene
from pipeline.shapes.half_plane import HalfEllipse, Rectangle
from pipeline.shapes.scanned import Scanned
from pipeline.study.case import Case

if TYPE_CHECKING:
    from pipeline.mesh.organ.base import Kept

# A free column that exceeds a round footprint by at most this share of its radius ends at the footprint's edge: gmsh
# leaves flat tetrahedra in so thin a ring. F is then too small by twice this share.
_THINNEST_RING = 1e-5


def mesh_arrays(case: Case, mirrors: tuple[str, ...], kept: "Kept | None" = None) -> MeshArrays:
    """Return the mesh of a case as arrays, of the part that ``mirrors`` leave of it.

    ``kept`` stores what the meshes of one scanned body share.
    """
    start = perf_counter()
    straight, planes, sizes = case.mesh.degree == 1, mirror_planes(case), sizes_of(case)
    segments = sizes.rim_segments(case.probe)
    held, ball = not (case.mesh.keeps_all or case.mesh.outside == "free"), case.is_closed
    scene = Scene(case.body, case.probe, _column(case), held, segments, straight, planes, ball)
    arrays = _meshed(scene, sizes, kept)
    arrays = open_slit(arrays, scene) if scene.has_inner_slit else arrays
    arrays = arrays if straight else curve(arrays, scene)
    arrays = _with_linear(arrays, case) if case.is_linear_beyond else arrays
    whole = reflect(arrays, tuple(plane for plane in planes if plane not in mirrors))
    return replace(whole, seconds=perf_counter() - start)


def _with_linear(arrays: MeshArrays, case: Case) -> MeshArrays:
    """Give cells beyond ε of the contact the numbers of further regions, in the order of the first ones."""
    middle = arrays.points[arrays.cells[:, :4]].mean(axis=1)
    beyond = np.linalg.norm(middle - np.array(case.frame.point), axis=1) > case.mesh.epsilon
    within = 0 if arrays.regions is None else arrays.regions
    return replace(arrays, regions=within + len(case.tissues) * beyond)


def _column(case: Case) -> float:
    """Return the radius (m) of the kept column as meshed, infinite if the whole body is kept."""
    column, footprint = case.column, case.probe.circumradius
    is_thin = 0 < column - footprint <= _THINNEST_RING * footprint
    return footprint if is_thin and case.mesh.outside == "free" and case.probe.is_round else column


def _meshed(scene: Scene, sizes: Sizes, kept: "Kept | None") -> MeshArrays:
    """Return the mesh of a scene by the generator for its body."""
    # Imported here, since libigl and other libraries take 80 ms to load, which other bodies do not need.
    if isinstance(scene.body, Scanned):
        from pipeline.mesh.organ.make import mesh_scanned  # noqa: PLC0415

        return mesh_scanned(scene, scene.body, sizes, kept)
    if scene.body.region:
        from pipeline.mesh.organ.solid import mesh_solid  # noqa: PLC0415

        return mesh_solid(scene, sizes)
    return generate(scene, sizes)


def upright(case: Case, arrays: MeshArrays) -> MeshArrays:
    """Return the mesh of a case rotated into the solver's frame: the probe presses along -z."""
    turn = case.frame.turn
    return arrays if turn is None else replace(arrays, points=arrays.points @ turn.T)


def sizes_of(case: Case) -> Sizes:
    """Return the element sizes of a case."""
    mesh = case.mesh
    epsilon = inf if case.is_full else mesh.epsilon
    # Round sides, of the body and of the column, are resolved over their whole length.
    side = min(case.body.bend, inf if mesh.keeps_all else epsilon)
    return Sizes(epsilon, mesh.fine, mesh.coarse, mesh.rim_size(case.probe.half_width), mesh.growth, side)


def meridian_of(case: Case) -> Meridian | EllipticMeridian:
    """Return the half plane of an axisymmetric case.

    Raises:
        ValueError: if its body is not axisymmetric.
    """
    body, fixed = case.body.half_plane(), case.body.support.on_half_plane()
    if isinstance(body, HalfEllipse) and isinstance(fixed, float) and not case.is_truncated:
        return EllipticMeridian(body.radius, body.semi_height, case.probe.circumradius, fixed)
    if not isinstance(body, Rectangle):
        raise ValueError(f"this {case.body.shape} has no half plane")
    held = case.is_truncated and case.mesh.outside == "fixed"
    return Meridian(
        body.radius, body.height, case.probe.circumradius, fixed, case.column, held, body.interfaces, body.is_filled
    )
