"""Drawn bodies and CAD solids with regions of triangles: the kernel's faces are meshed, then all surfaces are filled.

gmsh bounds a volume either by faces of its kernel or by triangles. Its faces are therefore taken as triangles, too.
"""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.follow import middle_nodes, points_along, rounded_points
from epsmesh.mesh.generate import GeometryError, MeshArrays, in_model, region_of_volume, with_smaller
from epsmesh.mesh.model_arrays import corners_of, numbered_points
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.regions import fill_regions
from epsmesh.mesh.regions import LocalSizes
from epsmesh.mesh.size import POINTS_PER_EDGE, Sizes
from epsmesh.scene.model import FREE, Scene
from epsmesh.shapes.bodies.cad import FromCad
from epsmesh.shapes.complex import OUTSIDE, Complex
from epsmesh.shapes.contact import lifted_edge
from epsmesh.shapes.files.check import outside_out
from epsmesh.shapes.files.edges import Edges, oriented
from epsmesh.shapes.probe import Probe


@dataclass(frozen=True, eq=False, kw_only=True)
class SolidField(Field):
    """A field whose distance from the edge of contact is that of meshes without such regions.

    ``edge`` (n, 3), in m, are points along the footprint's edge; a ``is_lifted`` edge is not plane.
    """

    probe: Probe
    is_lifted: bool

    def _to_rim(self, points: FloatArray) -> FloatArray:
        return np.maximum(super()._to_rim(points) - self.probe.rim_offset, 0.0)

    def _rim_text(self, unit: float, kernel: Any) -> str:
        if self.is_lifted and self.probe.has_singular_edge:
            return super()._rim_text(unit, kernel)
        return self.probe.rim_distance(*self.frame.expressions(unit), unit)


@dataclass(frozen=True, eq=False)
class ModelFaces:
    """Triangles of the faces of a model, and the ``field`` of sizes.

    ``parts`` are the surfaces between regions, ``facets`` the triangles of each group, ``rim`` the points on the
    probe's edge. ``bent`` is that of :class:`MeshArrays`.
    """

    parts: Complex
    facets: dict[str, IntArray]
    rim: IntArray
    bent: tuple[IntArray, FloatArray] | None
    field: Field


def mesh_solid(scene: Scene, sizes: Sizes) -> MeshArrays:
    """Mesh a ``scene`` of a drawn body or a CAD solid with regions of triangles, as :func:`generate` meshes others.

    Raises:
        GeometryError: at once, if there is nothing to mesh.
        MeshError: if a mesh generator fails.
    """
    start = perf_counter()

    def made(sizes: Sizes) -> MeshArrays:
        def take(rim_curves: list[int], local: tuple[LocalSizes, ...]) -> ModelFaces:
            return _faces(scene, sizes, local, rim_curves)

        return _filled(scene, in_model(scene, sizes, 2, take, stays=False), start)

    return with_smaller(made, scene, sizes)


def _faces(scene: Scene, sizes: Sizes, local: tuple[LocalSizes, ...], rim_curves: list[int]) -> ModelFaces:
    """Return the faces of gmsh's current model, after its faces were meshed."""
    model, scale = gmsh.model, scene.scale
    all_points, position = numbered_points()
    all_points = all_points * scale
    triangles = {tag: position[corners_of(2, [tag])] for _, tag in model.getEntities(2)}
    numbers = region_of_volume()
    beside = {volume: [tag for _, tag in model.getBoundary([(3, volume)], oriented=False)] for volume in numbers}
    sides = {tag: [OUTSIDE, OUTSIDE] for tag in triangles}
    for volume, faces in beside.items():
        for face, is_behind in zip(faces, _is_behind(all_points, [triangles[face] for face in faces]), strict=True):
            sides[face][0 if is_behind else 1] = numbers[volume]
    walls = [tag for tag, (one, other) in sides.items() if one != other]
    facets = np.vstack([triangles[tag] for tag in walls])
    used, number = np.unique(facets, return_inverse=True)
    new = np.full(len(all_points), -1, dtype=np.int64)
    new[used] = np.arange(len(used))
    parts = Complex(
        all_points[used],
        number.reshape(-1, 3),
        np.repeat(np.array([sides[tag] for tag in walls]), [len(triangles[tag]) for tag in walls], axis=0),
    )
    groups = {
        model.getPhysicalName(2, group): np.vstack(
            [new[triangles[face]] for face in model.getEntitiesForPhysicalGroup(2, group)]
        )
        for _, group in model.getPhysicalGroups(2)
    }
    rim = [position[model.mesh.getNodes(1, curve, includeBoundary=True)[0]] for curve in rim_curves]
    bent = None
    if isinstance(scene.body, FromCad) and not scene.straight:
        edges, middle = middle_nodes(position, scale)
        bent = new[edges], middle
    return ModelFaces(parts, groups, np.unique(new[np.concatenate(rim)]), bent, _field(scene, sizes, local, rim_curves))


def _field(scene: Scene, sizes: Sizes, local: tuple[LocalSizes, ...], rim_curves: list[int]) -> SolidField:
    is_lifted = not scene.is_flat
    if is_lifted and scene.probe.has_singular_edge:
        edge = scene.scale * points_along(rim_curves, scene.units(sizes.rim) / POINTS_PER_EDGE)
    else:
        edge = lifted_edge(scene.body, scene.probe, scene.frame)
    local = (*local, *rounded_points(scene, sizes.growth))
    return SolidField(
        sizes, scene.frame, edge[np.isfinite(edge).all(axis=1)], local, probe=scene.probe, is_lifted=is_lifted
    )


def _is_behind(points: FloatArray, faces: list[IntArray]) -> list[bool]:
    """Return for each face of a volume whether its triangles are oriented outward."""
    facets = np.vstack(faces)
    edges = Edges(facets)
    turned, flipped = oriented(edges)
    if flipped is None or len(edges.open) or len(edges.fins):
        raise GeometryError("the faces of a volume are not closed")
    outward = outside_out(points, turned, edges)
    first = np.cumsum([0, *map(len, faces[:-1])])
    return [bool(is_same) for is_same in (outward[first] == facets[first]).all(axis=1)]


def _filled(scene: Scene, faces: ModelFaces, start: float) -> MeshArrays:
    filled = fill_regions(faces.parts, scene.body, faces.field)
    facets = faces.facets | {FREE: np.vstack([faces.facets.get(FREE, np.empty((0, 3), dtype=np.int64)), filled.walls])}
    seconds = perf_counter() - start
    return MeshArrays(filled.points, filled.cells, facets, faces.rim, seconds, filled.regions, faces.bent)
