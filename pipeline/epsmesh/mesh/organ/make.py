"""Mesh of a scene on a body of triangles: coarse surface, contact, surface by the size field, volume, groups."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.generate import GeometryError, MeshArrays, MeshError
from epsmesh.mesh.organ.base import Base, Kept, Near, far_surface, put_back
from epsmesh.mesh.organ.contact import Contact, FoldedError, set_in
from epsmesh.mesh.organ.faces import Faces
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.regions import fill_regions
from epsmesh.mesh.organ.relax import relaxed
from epsmesh.mesh.organ.remesh import remesh
from epsmesh.mesh.organ.sheet import PROBE, Sheet, TangledError, edges_of, group_names
from epsmesh.mesh.organ.untangle import untangled
from epsmesh.mesh.regions import embedded_sizes
from epsmesh.mesh.size import Sizes
from epsmesh.scene.model import FREE, Scene
from epsmesh.shapes.body import Body
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.scanned import FINE, Scanned

# Passes of surface meshing: only in the second pass points are dense where sizes change fast.
_PASSES = 2
# Attempts that keep the file's own facets where the surface crosses itself, there and at all earlier such places.
_ATTEMPTS = 5
# If these fail, elements of the whole surface are made smaller by these factors.
_FINER = (1, 2, 4)
# The file's own facets are not kept if they are larger than elements by this factor.
_TOO_LARGE = 2
# Rounding of points, since the remesher converts lengths into units of its own and back.
_SAME = 1e-6
# Points are projected back onto the file's surface, unless facets would turn over or cross. Those stay off it by less
# than this share of the elements there, like chords over folds of the same size.
_MOST_OFF = 0.25
# The same at junctions, as a factor: facets meet there at all angles, and the image gives their place least exactly.
_AT_JUNCTION = 4.0
# Largest change of the volume. Chords of elements leave out half a per cent of an organ, and a third of what they
# deviate more, which curved edges restore; with folds as fine as elements it is more, and F is not that of the file.
MOST_EXCESS, _OF_CHORDS = 0.03, 0.3
# The same of a region, which is smaller and rounder.
MOST_OF_REGION = 0.1

Lift = Callable[[FloatArray], FloatArray]


def mesh_scanned(scene: Scene, body: Scanned, sizes: Sizes, kept: Kept | None = None) -> MeshArrays:
    """Mesh a ``scene`` of a ``body`` of triangles; ``kept`` stores what its meshes share.

    Raises:
        GeometryError: at once, if the footprint does not fit there, or the scene needs what such a body cannot have.
        MeshError: if a mesh generator fails with smaller elements, too.
    """

    tangles: list[TangledError] = []
    contact: Near | None = None
    around = scene.probe.far_sizes(scene.frame, sizes.growth, sizes.coarseness)
    deviation = body.deviation(around, straight=scene.straight)
    for finer in _FINER:
        smaller = replace(sizes, column=sizes.column / finer)
        for _ in range(_ATTEMPTS):
            try:
                far = far_surface(body, kept, finer, tangles, contact, deviation=deviation)
                return mesh_organ(scene, smaller, far)
            except TangledError as error:
                failure: MeshError = error
                tangles.append(error)
            except FoldedError:
                if contact is not None:
                    raise
                contact = Near(scene.frame.point, scene.footprint.circumradius)
            except GeometryError:
                raise
            except MeshError as error:
                failure = error
                break
        tangles = []
    raise failure


def mesh_organ(scene: Scene, sizes: Sizes, far: Base) -> MeshArrays:
    """Mesh a ``scene`` whose body is bounded by triangles, with ``far``, its surface away from the contact.

    The same input gives the same arrays, bit for bit.

    Raises:
        GeometryError: if the footprint does not fit there, or the scene needs what such a body cannot have.
        TangledError: if the surface crosses itself, or leaves no space for tetrahedra.
        MeshError: if a mesh generator fails.
    """
    start = perf_counter()
    _check(scene)

    def lift(points: FloatArray) -> FloatArray:
        return scene.body.lift(scene.frame, points)[0]

    contact = set_in(far.sheet, far.faces, scene.frame, scene.footprint, sizes, lift)
    around = scene.probe.far_sizes(scene.frame, sizes.growth, sizes.coarseness)
    field = Field(sizes, scene.frame, contact.edge, embedded_sizes(scene.body, around))
    sheet = _to_sizes(contact, field, _Truth(scene, far, lift))
    sheet = untangled(sheet, np.unique(sheet.facets[sheet.kind == PROBE]))
    _check_whole(sheet, far, scene.body)
    deviation = _deviation(sheet, far.faces, field)
    parts = Complex(sheet.points, sheet.facets, sheet.sides)
    filled = fill_regions(parts, scene.body, field)
    facets = {name: sheet.facets[sheet.kind == number] for number, name in group_names().items()}
    facets[FREE] = np.vstack([facets[FREE], filled.walls])
    rim = np.unique(sheet.border(PROBE))
    points = relaxed(filled, sheet, far.faces.skin)
    seconds = perf_counter() - start
    return MeshArrays(points, filled.cells, facets, rim, seconds, filled.regions, deviation=deviation)


def _check(scene: Scene) -> None:
    """Raise an error for scenes that are not supported here."""
    if scene.is_cut:
        raise GeometryError(f'a {scene.body.shape} has no columns: use outside = "coarse"')
    if scene.mirrors:
        raise GeometryError(f"a {scene.body.shape} has no mirror symmetry")


def _check_whole(sheet: Sheet, far: Base, body: Body) -> None:
    """Check that a surface is that of the file, and that all regions have theirs.

    Raises:
        MeshError: if it is open, or encloses much more or less.
    """
    edges_of(sheet.skin.facets)
    most = MOST_EXCESS + _OF_CHORDS * (far.deviation - FINE)
    if abs(excess := sheet.volume / body.volume - 1) > most:
        amount = "much" if excess > 0 else "little"
        raise MeshError(
            f"the remeshed surface encloses {abs(excess):.2g} times the body's volume too {amount}: "
            "smooth it, or use a smaller `fine`"
        )
    if (walls := far.faces.walls) is None:
        return
    made = Complex(sheet.points, sheet.facets, sheet.sides)
    for region in walls.regions:
        if region not in made.regions or abs(excess := made.volume(region) / walls.volume(region) - 1) > MOST_OF_REGION:
            name = body.region_names[region]
            raise MeshError(f"the remeshed surface of {name} has lost its shape: use a smaller `fine`")


def _deviation(sheet: Sheet, faces: Faces, field: Field) -> float:
    """Return the largest distance (m) of the sheet's points from the file's surface.

    Raises:
        TangledError: if that exceeds the limit given by elements there.
    """
    distance = faces.distance(sheet)
    limit = _MOST_OFF * field.at(sheet.points)
    limit[sheet.facets[np.isin(sheet.facets, sheet.junctions).any(axis=1)]] *= _AT_JUNCTION
    far = distance > limit
    if far.any():
        what = f"the remeshed surface deviates from the file's by {1e3 * distance[far].max():.2g} mm"
        raise TangledError(sheet.points[far], distance[far], what)
    return float(distance.max())


@dataclass(frozen=True, eq=False)
class _Truth:
    """Projection onto the true surface: points of the footprint are lifted, others move to the nearest point."""

    scene: Scene
    far: Base
    lift: Lift

    def put_back(self, sheet: Sheet, rim: IntArray, true_rim: FloatArray) -> Sheet:
        """Return the sheet on the true surface; its ``rim`` points (k) move to ``true_rim`` (k, 3)."""
        points = sheet.points.copy()
        points[rim] = true_rim
        on_border = np.concatenate([rim, sheet.junctions.ravel()])
        inner = np.setdiff1d(np.unique(sheet.facets[sheet.kind == PROBE]), on_border)
        lifted = self.lift(self.scene.frame.local(points[inner])[:, :2])
        seen = np.isfinite(lifted).all(axis=1)
        own = np.setdiff1d(self.far.own_points(sheet), np.concatenate([rim, inner]))
        known = np.concatenate([rim, inner[seen], own])
        places = np.vstack([true_rim, lifted[seen], points[own]])
        return put_back(Sheet(points, sheet.facets, sheet.group, sheet.sharp), self.far.faces, known, places)


def _to_sizes(contact: Contact, field: Field, truth: _Truth) -> Sheet:
    """Remesh the surface to the size field; points are on the true surface, the footprint's edge is unchanged."""
    sheet, rim = contact.sheet, contact.rim
    true_rim, extent = sheet.points[rim], float(np.ptp(sheet.points, axis=0).max())
    for _ in range(_PASSES):
        kept = np.column_stack([rim, np.roll(rim, -1)])
        size = field.at(sheet.points)
        as_is = truth.far.is_own(sheet) & (sheet.extents < _TOO_LARGE * size[sheet.facets].min(axis=1))
        sheet = remesh(sheet, size, truth.far.deviation * min(field.sizes.largest, extent), kept, as_is)
        found = np.unique(sheet.border(PROBE))
        distance, nearest = cKDTree(sheet.points[found]).query(true_rim)
        rim = found[nearest]
        if not len(found) == len(true_rim) == len(np.unique(rim)) or distance.max() > _SAME * extent:
            raise MeshError("the remesher of surfaces changed the footprint's edge")
        sheet = truth.put_back(sheet, rim, true_rim)
    return sheet
