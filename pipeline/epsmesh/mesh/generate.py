"""Tetrahedral meshes of a scene from gmsh, on one process, as plain arrays."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import ceil, nan
from typing import Any, TypeVar

import gmsh
import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.compat import gmsh_session
from epsmesh.mesh.follow import middle_nodes, rounded_sizes
from epsmesh.mesh.model_arrays import corners_of, numbered_points, points_by_tag
from epsmesh.mesh.reason import generate as mesh_model
from epsmesh.mesh.reason import reason
from epsmesh.mesh.regions import LocalSizes, longest_at_rim, region_sizes
from epsmesh.mesh.size import Sizes, set_size_field
from epsmesh.scene.model import (
    CUT,
    FIXED,
    FLANK,
    FREE,
    JAW,
    MIRROR,
    MOUNT,
    PROBE,
    SLIT,
    TISSUE,
    Scene,
    SceneError,
    build,
    rims,
)
from epsmesh.shapes.bodies.cad import FromCad
from epsmesh.shapes.body import Drawn
from epsmesh.shapes.probe import Probe
from epsmesh.stages import stage

# gmsh's HXT is 3 to 6 times faster, but numbers its points by memory address: no two runs give the same mesh, not even
# on one thread (gmsh 4.8.4). The sequential Delaunay algorithm is reproducible bit for bit.
_DELAUNAY = 1
# Tolerance of the integral of 1/size along edges: gmsh's default, 1e-9, takes a third of the time of a small mesh.
_ON_EDGES = 1e-6

# A tetrahedron is flat if its volume is below this share of that of a box of its extent. In one mesh with a flat cell,
# the strain in it was 80 times that beside it, F erred by more than its error bar, and iterations did not converge.
FLAT = 1e-5
# Triangles of a surface overlap if their area exceeds its own by this factor: they are chords, and mostly smaller.
_OVERLAP = 1.2
# If gmsh fails, a round side gets the resolution of a side with the body's extent divided by this.
_RETRIES = (4, 8)


Taken = TypeVar("Taken")


class MeshError(Exception):
    """gmsh could not mesh the scene."""


class GeometryError(MeshError):
    """The scene itself could not be built: other element sizes do not help."""


@dataclass(frozen=True)
class MeshArrays:
    """A whole tetrahedral mesh as arrays, on one process.

    ``points`` (n, 3) in metres; ``cells`` (m, 4), or (m, 10) once curved; ``facets`` maps the name of a group to its
    boundary triangles (k, 3); ``rim`` are the points on the probe's edge; ``seconds`` is the time of meshing.
    ``regions`` (m) are the cells' region numbers of the body; None for a body of one material. A region outside the
    mesh has no cell. ``bent``, until cells are curved, has edges (k, 2) on faces that only the geometry kernel knows,
    and their mid nodes (k, 3), in m. ``deviation`` (m) is the largest distance of points from the surface in a file of
    triangles; NaN for other bodies. ``interfaces`` are the triangles (k, 3) between regions, where they are known.
    """

    points: FloatArray
    cells: IntArray
    facets: dict[str, IntArray]
    rim: IntArray
    seconds: float
    regions: IntArray | None = None
    bent: tuple[IntArray, FloatArray] | None = None
    deviation: float = nan
    interfaces: IntArray | None = None


def generate(scene: Scene, sizes: Sizes) -> MeshArrays:
    """Mesh ``scene``: the same input gives the same arrays, bit for bit, on the same version of gmsh.

    gmsh sometimes fails on elements that are large for the body; smaller elements far from the contact are then tried.

    Raises:
        GeometryError: at once, if there is nothing to mesh.
        MeshError: with gmsh's own message, if meshing fails.
    """
    start = time.perf_counter()

    def made(sizes: Sizes) -> MeshArrays:
        return in_model(scene, sizes, 3, lambda rim_curves, _: _collect(scene, rim_curves, start))

    return with_smaller(made, scene, sizes)


def with_smaller(made: Callable[[Sizes], MeshArrays], scene: Scene, sizes: Sizes) -> MeshArrays:
    """Return the mesh that is ``made`` with ``sizes``, or with smaller elements far from the contact if that fails."""
    for divisor in _RETRIES:
        try:
            return made(sizes)
        except GeometryError:
            raise
        except MeshError:
            sizes = replace(sizes, column=min(sizes.column, scene.body.extent / divisor))
    return made(sizes)


@stage("gmsh")
def in_model(
    scene: Scene,
    sizes: Sizes,
    dim: int,
    take: Callable[[list[int], tuple[LocalSizes, ...]], Taken],
    *,
    stays: bool = True,
) -> Taken:
    """Mesh ``scene`` up to dimension ``dim``, and return what ``take`` returns while gmsh's model is open.

    It is called with the curves of the probe's rim and the sizes of regions. A model that ``stays`` is used again.

    Raises:
        GeometryError: if there is nothing to mesh.
        MeshError: with gmsh's own message, if meshing fails.
    """
    with _model(scene, stays) as kept:
        if "rim" not in kept:
            kept["rim"] = _built(scene)
        rim_curves = kept["rim"]
        try:
            if scene.rim_segments and len(rim_curves) == 1 and scene.is_flat:
                parts = 2 ** len(scene.cutting)
                least = ceil(scene.probe.perimeter / parts / (sizes.times * longest_at_rim(scene.body)))
                edges = max(scene.rim_segments // parts, least)
                gmsh.model.mesh.setTransfiniteCurve(rim_curves[0], edges + 1)
            gmsh.option.setNumber("Mesh.MeshSizeFactor", sizes.times)
            local, unit = region_sizes(scene, sizes.growth, sizes.largest, sizes.coarseness), 1 / scene.scale
            more = [term for part in local for term in part.terms(unit, gmsh.model.geo)]
            more += rounded_sizes(scene, sizes.growth)
            if scene.jaw is not None:
                more += _at_jaw(scene, scene.jaw, sizes)
                rim_curves = [*rim_curves, *rims(scene)[JAW]]
            lifted = [] if scene.is_flat else rim_curves
            last = set_size_field(sizes, scene.probe, scene.frame, scene.scale, more, lifted)
            if scene.body.region:
                gmsh.model.geo.synchronize()  # points to which sizes refer
            mesh_model(dim)
            folded = _folded()
        except Exception as error:  # gmsh raises bare Exception
            raise MeshError(f"gmsh: {reason(error)}") from error
        if folded:
            raise MeshError(f"gmsh folded the triangles of {folded} curved surfaces: use a smaller `coarse` or `fine`")
        taken = take(rim_curves, local)
        _clear(last)
        return taken


def _at_jaw(scene: Scene, jaw: Probe, sizes: Sizes) -> list[str]:
    """Set the number of edges along the rim of a ``jaw``; return the element sizes around it, as texts for gmsh."""
    frame, unit, curves = jaw.frame_on(scene.body), 1 / scene.scale, rims(scene)[JAW]
    if scene.jaw_segments and len(curves) == 1:
        gmsh.model.mesh.setTransfiniteCurve(curves[0], scene.jaw_segments // 2 ** len(scene.cutting) + 1)
    return sizes.of_jaw.terms(frame.point, jaw.rim_distance(*frame.expressions(unit), unit), unit)


def _clear(last: int) -> None:
    """Remove the mesh of the model, and its fields up to the ``last``."""
    gmsh.model.mesh.clear()
    for field in range(1, last + 1):
        gmsh.model.mesh.field.remove(field)


def _folded() -> int:
    """Return the number of curved surfaces of gmsh's current model whose triangles overlap.

    gmsh sometimes folds the triangles of a side where they are large: tetrahedra then leave out a part of the body.
    """
    curved = [(dim, tag) for dim, tag in gmsh.model.getEntities(2) if gmsh.model.getType(dim, tag) != "Plane"]
    if not curved:
        return 0
    points = points_by_tag()
    areas, true = np.empty(len(curved)), np.empty(len(curved))
    for number, (dim, tag) in enumerate(curved):
        corners = points[corners_of(2, [tag])]
        sides = corners[:, 1:] - corners[:, :1]
        areas[number] = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2
        true[number] = gmsh.model.occ.getMass(dim, tag)
    folded = areas > _OVERLAP * true
    # The area of a part of an ellipsoid may err by a quarter in the geometry kernel; that of all parts does not.
    spline = np.array([gmsh.model.getType(dim, tag) == "BSpline surface" for dim, tag in curved])
    if areas[spline].sum() <= true[spline].sum():
        folded &= ~spline
    return int(folded.sum())


def _built(scene: Scene) -> list[int]:
    """Build the scene in gmsh's current model and return the curves of the probe's rim."""
    try:
        return build(scene)
    except SceneError as error:
        raise GeometryError(str(error)) from None
    except Exception as error:  # so does its geometry kernel
        raise GeometryError(f"gmsh: {reason(error)}") from error


@contextmanager
def _model(scene: Scene, stays: bool) -> Iterator[dict[str, Any]]:
    """Open gmsh; if it ``stays``, later meshes of the same ``scene`` reuse the model that was built and its data.

    Other element sizes give the same elements as on a new model, bit for bit.
    """
    drawn = scene if scene.straight else replace(scene, rim_segments=0)  # along curved edges segments are sizes
    with gmsh_session(drawn if stays and isinstance(scene.body, Drawn) else None) as kept:
        model_options()
        yield kept


def model_options() -> None:
    """Set gmsh's options: sizes from the field alone, and reproducible meshes."""
    for name, value in {
        "General.Terminal": 0,
        "General.NumThreads": 1,
        "Mesh.Algorithm3D": _DELAUNAY,
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.LcIntegrationPrecision": _ON_EDGES,
    }.items():
        gmsh.option.setNumber(name, value)


def _collect(scene: Scene, rim_curves: list[int], start: float) -> MeshArrays:
    mesh, scale = gmsh.model.mesh, scene.scale
    points, position = numbered_points()
    points = points * scale
    cells = position[corners_of(3, [tag for _, tag in gmsh.model.getEntities(3)])]
    if not len(cells):
        raise MeshError("gmsh made no tetrahedra")
    regions = _regions() if scene.body.regions or scene.probe.elastic else None
    facets = {FIXED: np.empty((0, 3), dtype=np.int64)}
    for dim, group in gmsh.model.getPhysicalGroups(2):
        name = gmsh.model.getPhysicalName(dim, group)
        facets[name] = position[corners_of(2, gmsh.model.getEntitiesForPhysicalGroup(dim, group))]
    assert set(facets) <= {PROBE, FIXED, FREE, CUT, SLIT, JAW, MOUNT, FLANK, *MIRROR.values()}
    if not rim_curves:
        why = "gmsh leaves out the edge of the contact, which is too small beside the body: use a larger depth"
        raise GeometryError(why)
    rim = [position[mesh.getNodes(1, curve, includeBoundary=True)[0]] for curve in rim_curves]
    # Used points are renumbered without gaps.
    used, rim_points = np.zeros(len(points), dtype=bool), np.unique(np.concatenate(rim))
    used[cells] = True
    number = np.cumsum(used) - 1
    points, cells, rim_points = points[used], number[cells], number[rim_points[used[rim_points]]]
    facets = {name: number[f] for name, f in facets.items()}
    bent = None
    if isinstance(scene.body, FromCad) and not scene.straight:
        edges, middle = middle_nodes(position, scale)
        bent = number[edges], middle
    return MeshArrays(points, orient(points, cells), facets, rim_points, time.perf_counter() - start, regions, bent)


def region_of_volume() -> dict[int, int]:
    """Return the region number of each volume of gmsh's current model."""
    number: dict[int, int] = {}
    for dim, group in gmsh.model.getPhysicalGroups(3):
        region = int(gmsh.model.getPhysicalName(dim, group).removeprefix(TISSUE) or 0)
        number |= dict.fromkeys(map(int, gmsh.model.getEntitiesForPhysicalGroup(dim, group)), region)
    return number


def _regions() -> IntArray:
    """Return the region of each tetrahedron, in the order of the entities."""
    number = region_of_volume()
    tags = [tag for _, tag in gmsh.model.getEntities(3)]
    counts = [len(corners_of(3, [tag])) for tag in tags]
    return np.repeat(np.array([number[tag] for tag in tags], dtype=np.int64), counts)


def flat_cells(points: FloatArray, cells: IntArray) -> BoolArray:
    """Return a mask of flat tetrahedra; a mesh with one of them is unusable."""
    corners = points[cells]
    volume = _volumes(corners)
    return np.asarray(~(np.abs(volume) > FLAT * np.ptp(corners, axis=1).max(axis=1) ** 3))


def orient(points: FloatArray, cells: IntArray) -> IntArray:
    """Return the cells with positive volume.

    Raises:
        MeshError: if one is flat.
    """
    if count := np.count_nonzero(flat_cells(points, cells)):
        raise MeshError(
            f"gmsh left {count} flat tetrahedra: use a smaller rim, above all where a layer is much "
            "thinner than elements along the probe's edge are long"
        )
    turned = _volumes(points[cells]) < 0
    return np.where(turned[:, None], cells[:, [0, 1, 3, 2]], cells)


def _volumes(corners: FloatArray) -> FloatArray:
    """Return six times the volume of tetrahedra, (n, 4, 3), negative for mirror images."""
    return determinants(np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0))


def determinants(columns: FloatArray) -> FloatArray:
    """Return the triple products (n) of three vectors each, (3, n, 3)."""
    (a, b, c), (d, e, f), (g, h, i) = (part.T for part in columns)
    return np.asarray(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g))
