"""Mesh of a scene on a body of triangles: coarse surface, contact, surface by the size field, volume, groups."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.generate import GeometryError, MeshArrays, MeshError
from epsmesh.mesh.organ.base import Base, Kept, Near, far_surface, put_back
from epsmesh.mesh.organ.contact import FoldedError, Lift, set_in
from epsmesh.mesh.organ.faces import Faces
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.regions import fill_regions
from epsmesh.mesh.organ.relax import relaxed
from epsmesh.mesh.organ.remesh import remesh
from epsmesh.mesh.organ.sheet import Sheet, TangledError, edges_of, group_names
from epsmesh.mesh.organ.untangle import untangled
from epsmesh.mesh.regions import embedded_sizes
from epsmesh.mesh.size import Sizes
from epsmesh.scene.model import FREE, PROBE, Scene
from epsmesh.shapes.body import Body
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.frame import Frame
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
                contact = Near(tuple((scene.frame_of(n).point, tool.circumradius) for n, tool in scene.tools.items()))
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

    sheet, field, patches = _in_contact(scene, sizes, far)
    sheet = _to_sizes(sheet, field, _Truth(far, patches))
    kinds = [patch.kind for patch in patches]
    sheet = untangled(sheet, np.unique(sheet.facets[np.isin(sheet.kind, kinds)]))
    _check_whole(sheet, far, scene.body)
    deviation = _deviation(sheet, far.faces, field)
    parts = Complex(sheet.points, sheet.facets, sheet.sides)
    filled = fill_regions(parts, scene.body, field)
    facets = {name: sheet.facets[sheet.kind == number] for number, name in group_names().items()}
    facets[FREE] = np.vstack([facets[FREE], filled.walls])
    rim = np.unique(np.vstack([sheet.border(kind) for kind in kinds]))
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
class _Patch:
    """The surface below a tool: facets of a ``kind`` within points of its true ``rim`` (k, 3), m, in order.

    ``lift`` projects points of the plane of its ``frame`` along its axis onto the true surface.
    """

    kind: int
    frame: Frame
    lift: Lift
    rim: FloatArray

    def rim_of(self, sheet: Sheet) -> IntArray:
        """Return the points (k) of a sheet that are its rim.

        Raises:
            MeshError: if the sheet has other ones.
        """
        found = np.unique(sheet.border(self.kind))
        distance, nearest = cKDTree(sheet.points[found]).query(self.rim)
        rim = found[nearest]
        extent = float(np.ptp(sheet.points, axis=0).max())
        if not len(found) == len(self.rim) == len(np.unique(rim)) or distance.max() > _SAME * extent:
            raise MeshError("the remesher of surfaces changed the footprint's edge")
        return rim


def _in_contact(scene: Scene, sizes: Sizes, far: Base) -> tuple[Sheet, Field, list[_Patch]]:
    """Return the surface with the footprints of all tools in it, the size field, and the patches below the tools."""
    numbers = {name: kind for kind, name in group_names().items()}
    sheet, fields, patches = far.sheet, list[Field](), list[_Patch]()
    for name, tool in scene.tools.items():
        is_first, frame = name == PROBE, scene.frame_of(name)
        footprint, own = (scene.footprint, sizes) if is_first else (tool, sizes.of_jaw)
        lift = partial(_lifted, scene.body, frame)
        contact = set_in(sheet, far.faces, frame, footprint, own, lift, numbers[name])
        sheet = contact.sheet
        patches.append(_Patch(numbers[name], frame, lift, sheet.points[contact.rim]))
        around = tool.far_sizes(frame, sizes.growth, sizes.coarseness)
        fields.append(Field(own, frame, contact.edge, embedded_sizes(scene.body, around)))
    first, *others = fields
    return sheet, replace(first, local=(*others, *first.local)), patches


def _lifted(body: Body, frame: Frame, points: FloatArray) -> FloatArray:
    return body.lift(frame, points)[0]


@dataclass(frozen=True, eq=False)
class _Truth:
    """Projection onto the true surface: points below tools are lifted, others move to the nearest point."""

    far: Base
    patches: Sequence[_Patch]

    def put_back(self, sheet: Sheet, rims: Sequence[IntArray]) -> Sheet:
        """Return the sheet on the true surface; its ``rims``, points (k), move to those of the patches."""
        points, rim, true_rim = sheet.points.copy(), np.concatenate(rims), np.vstack([p.rim for p in self.patches])
        points[rim] = true_rim
        on_border = np.concatenate([rim, sheet.junctions.ravel()])
        known, places, below = [rim], [true_rim], [rim]
        for patch in self.patches:
            inner = np.setdiff1d(np.unique(sheet.facets[sheet.kind == patch.kind]), on_border)
            lifted = patch.lift(patch.frame.local(points[inner])[:, :2])
            seen = np.isfinite(lifted).all(axis=1)
            known.append(inner[seen])
            places.append(lifted[seen])
            below.append(inner)
        own = np.setdiff1d(self.far.own_points(sheet), np.concatenate(below))
        known.append(own)
        places.append(points[own])
        moved = Sheet(points, sheet.facets, sheet.group, sheet.sharp)
        return put_back(moved, self.far.faces, np.concatenate(known), np.vstack(places))


def _to_sizes(sheet: Sheet, field: Field, truth: _Truth) -> Sheet:
    """Remesh the surface to the size field; points are on the true surface, the footprints' edges are unchanged."""
    extent = float(np.ptp(sheet.points, axis=0).max())
    for _ in range(_PASSES):
        rims = [patch.rim_of(sheet) for patch in truth.patches]
        kept = np.vstack([np.column_stack([rim, np.roll(rim, -1)]) for rim in rims])
        size = field.at(sheet.points)
        as_is = truth.far.is_own(sheet) & (sheet.extents < _TOO_LARGE * size[sheet.facets].min(axis=1))
        sheet = remesh(sheet, size, truth.far.deviation * min(field.sizes.largest, extent), kept, as_is)
        sheet = truth.put_back(sheet, [patch.rim_of(sheet) for patch in truth.patches])
    return sheet
