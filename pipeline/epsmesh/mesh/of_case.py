"""The mesh of a case: its geometry and sizes, meshed on the part that symmetry leaves, and reflected."""

from contextlib import suppress
from dataclasses import replace
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from epsmesh.mesh.curve import curve
from epsmesh.mesh.elliptic_meridian import EllipticMeridian
from epsmesh.mesh.generate import MeshArrays, MeshError, generate
from epsmesh.mesh.loose import part_loose
from epsmesh.mesh.meridian import Meridian
from epsmesh.mesh.parts import Part, refine, reflect_part, split, whole
from epsmesh.mesh.refine import refined
from epsmesh.mesh.reflect import NOWHERE, Place, reflect
from epsmesh.mesh.size import EDGES_PER_RADIUS, Sizes
from epsmesh.mesh.slit import open_slit
from epsmesh.mesh.smooth import smoothed
from epsmesh.mesh.tip import part_tool
from epsmesh.plan.refinement import is_refined, refinements
from epsmesh.plan.symmetry import mirror_planes
from epsmesh.plan.thin import cause
from epsmesh.scene.model import Scene
from epsmesh.shapes.body import Layered
from epsmesh.shapes.grasp import MIDDLE, middle_plane
from epsmesh.shapes.half_plane import HalfEllipse, Rectangle
from epsmesh.shapes.scanned import Scanned
from epsmesh.study.case import Case

if TYPE_CHECKING:
    from epsmesh.mesh.organ.base import Kept

# A free column that exceeds a round footprint by at most this share of its radius ends at the footprint's edge: gmsh
# leaves flat tetrahedra in so thin a ring. F is then too small by twice this share.
_THINNEST_RING = 1e-5
# Sizes of elements that are halved, in units of those wanted, and of those along the rim; squared for two refinements.
# Halving leaves more small elements than gmsh: with a factor of 2, error bars at equal unknowns are larger by a tenth.
# With these they are smaller by a tenth (six meshes each of a disc and a blade).
_COARSER, _AT_RIM = 2.2, 0.75


def mesh_arrays(case: Case, mirrors: tuple[str, ...], kept: "Kept | None" = None) -> MeshArrays:
    """Return the mesh of a case as arrays, of the part that ``mirrors`` leave of it.

    ``kept`` stores what the meshes of one scanned body share.
    """
    if is_refined(case):
        with suppress(MeshError):
            return refined_arrays(case, mirrors, coarse_arrays(case))
    return unrefined_arrays(case, mirrors, kept)


def unrefined_arrays(case: Case, mirrors: tuple[str, ...], kept: "Kept | None" = None) -> MeshArrays:
    """Return the mesh of a case as its generator makes it: see :func:`mesh_arrays`."""
    start = perf_counter()
    scene, sizes = _scene(case, is_coarse=False)
    try:
        arrays = _meshed(scene, sizes, kept)
    except MeshError as error:
        if thin := cause(case):
            raise type(error)(f"{error}. {thin}") from error
        raise
    arrays = open_slit(arrays, scene) if scene.has_inner_slit else arrays
    arrays = arrays if scene.straight else curve(arrays, scene)
    arrays = part_loose(arrays, loose) if (loose := case.body.loose) else arrays
    arrays = part_tool(arrays, scene) if scene.probe.elastic else arrays
    arrays = _with_linear(arrays, case) if case.is_linear_beyond else arrays
    found = _named(reflect(arrays, _beyond(case, mirrors), _middle(case)), case)
    return replace(found, seconds=perf_counter() - start)


def refined_arrays(case: Case, mirrors: tuple[str, ...], coarse: MeshArrays) -> MeshArrays:
    """Return the mesh of a case, refined from its coarse mesh on this process.

    Raises:
        NotRefined: if a cell would be flat.
    """
    start = perf_counter()
    (part,) = split(coarse, 1)
    found = whole(refined_part(case, mirrors, part, MPI.COMM_SELF))
    return replace(found, seconds=coarse.seconds + perf_counter() - start)


def coarse_arrays(case: Case) -> MeshArrays:
    """Return the mesh that the mesh of a case is refined from: of the part that all planes of symmetry leave.

    It has ten nodes per cell: corners, and the points at which edges will be halved. Each rank halves them for its
    part; of two refinements the first one is done here.

    Raises:
        NotRefined: if a cell would be flat.
    """
    start = perf_counter()
    scene, sizes = _scene(case, is_coarse=True)
    arrays = curve(smoothed(_meshed(scene, sizes, None)), scene, is_finest=False)
    for _ in range(refinements(case) - 1):
        arrays = curve(smoothed(refined(arrays)[0]), scene, is_finest=False)
    return replace(arrays, seconds=perf_counter() - start)


def refined_part(case: Case, mirrors: tuple[str, ...], part: Part, comm: MPI.Comm) -> Part:
    """Return the part of this rank of the mesh of a case, from that of its coarse mesh; collective.

    Raises:
        NotRefined: on every rank, if a cell would be flat.
    """
    scene, _ = _scene(case, is_coarse=True)
    part = refine(part, scene, comm)
    if case.is_linear_beyond:
        part = replace(part, mesh=_with_linear(part.mesh, case))
    part = reflect_part(part, _beyond(case, mirrors), _middle(case))
    return replace(part, mesh=_named(part.mesh, case))


def _scene(case: Case, *, is_coarse: bool) -> tuple[Scene, Sizes]:
    """Return the scene of a case, and the element sizes of its mesh, or of the coarse mesh that is refined."""
    straight, planes, sizes = case.mesh.degree == 1, mirror_planes(case), sizes_of(case)
    if is_coarse:
        times, at_rim = _COARSER ** refinements(case), _AT_RIM ** refinements(case)
        # Elements larger than the body is thick would be flat, and so would theirs.
        column = min(sizes.column, EDGES_PER_RADIUS * case.body.thickness(case.frame))
        sizes = replace(sizes, times=times, rim=at_rim * sizes.rim, column=column / times)
    segments = sizes.rim_segments(case.expected)
    held, ball = not (case.mesh.keeps_all or case.mesh.outside == "free"), case.is_closed
    folds, jaw = not case.has_quarter_points, None if MIDDLE in planes else case.expected_jaw
    scene = Scene(case.body, case.expected, _column(case), held, segments, straight, planes, ball, folds)
    if jaw is None:
        return scene, sizes
    sizes = replace(sizes, jaw_rim=case.mesh.jaw_rim_size(jaw.half_width))
    return replace(scene, jaw=jaw, jaw_segments=sizes.of_jaw.rim_segments(jaw)), sizes


def _beyond(case: Case, mirrors: tuple[str, ...]) -> tuple[str, ...]:
    """Return the planes of symmetry in which the mesh of a case is reflected."""
    return tuple(plane for plane in mirror_planes(case) if plane not in mirrors)


def _middle(case: Case) -> Place:
    """Return the place of the plane between two jaws, if the mesh is reflected in it."""
    return middle_plane(case.body, case.probe) if MIDDLE in mirror_planes(case) else NOWHERE


def _named(arrays: MeshArrays, case: Case) -> MeshArrays:
    """Give cells in mirror images of layers the numbers of the layers that are there, which have the same tissue."""
    body = case.body
    if not isinstance(body, Layered) or arrays.regions is None or MIDDLE not in mirror_planes(case):
        return arrays
    heights = arrays.points[arrays.cells[:, :4], 2].mean(axis=1)
    there = 1 + (heights[:, None] < np.array(body.interfaces)).sum(axis=1)
    number = arrays.regions % len(case.tissues)  # those beyond ε have further ones
    is_layer = (number > 0) & (number <= len(body.layer))
    return replace(arrays, regions=arrays.regions + is_layer * (there - number))


def _with_linear(arrays: MeshArrays, case: Case) -> MeshArrays:
    """Give cells beyond ε of all contacts the numbers of further regions, in the order of the first ones."""
    middle = arrays.points[arrays.cells[:, :4]].mean(axis=1)
    places = [tool.frame_on(case.body).point for tool in (case.probe, case.jaw) if tool is not None]
    away = [np.linalg.norm(middle - np.array(place), axis=1) for place in places]
    beyond = np.min(away, axis=0) > case.mesh.epsilon
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
        from epsmesh.mesh.organ.make import mesh_scanned  # noqa: PLC0415

        return mesh_scanned(scene, scene.body, sizes, kept)
    if scene.body.region:
        from epsmesh.mesh.organ.solid import mesh_solid  # noqa: PLC0415

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
    return Sizes(
        epsilon,
        mesh.fine,
        mesh.coarse,
        mesh.rim_size(case.probe.half_width),
        mesh.growth,
        side,
        coarseness=mesh.coarseness,
    )


def meridian_of(case: Case) -> Meridian | EllipticMeridian:
    """Return the half plane of an axisymmetric case.

    Raises:
        ValueError: if its body is not axisymmetric.
    """
    body, fixed = case.body.half_plane(), case.body.hold.on_half_plane()
    if isinstance(body, HalfEllipse) and isinstance(fixed, float) and not case.is_truncated:
        return EllipticMeridian(body.radius, body.semi_height, case.probe.circumradius, fixed)
    if not isinstance(body, Rectangle):
        raise ValueError(f"this {case.body.shape} has no half plane")
    held = case.is_truncated and case.mesh.outside == "fixed"
    return Meridian(
        body.radius, body.height, case.probe.circumradius, fixed, case.column, held, body.interfaces, body.is_filled
    )
