"""Surface away from the contact: cut at the edge of the support, and meshed as coarsely as its curvature allows.

It depends on the body, and on how closely it is followed, so that places, tools and most meshes on it share it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import igl
import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.generate import GeometryError
from epsmesh.mesh.organ.faces import Faces
from epsmesh.mesh.organ.junctions import coarsened
from epsmesh.mesh.organ.prepare import cut, level_line, merged, sharp_edges
from epsmesh.mesh.organ.remesh import release, remesh
from epsmesh.mesh.organ.sheet import Sheet, TangledError
from epsmesh.mesh.organ.untangle import crossing_facets
from epsmesh.mesh.size import EDGES_PER_RADIUS
from epsmesh.shapes.complex import OUTSIDE, Complex
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.scanned import FINE, Scanned
from epsmesh.shapes.surface import Surface
from epsmesh.stages import stage

# Increase by hand when the same file gives another surface.
_VERSION = 7
# Elements per contact radius near a contact, and the growth of their size beyond twice that radius.
_PER_CONTACT, _GROWTH = 3, 0.3
# Distance around a tangle within which the file's own facets stay, in units of these facets.
_REACH = 1.5
# Tolerance for points that must not move, in units of the body.
_SAME = 1e-7
# A facet has turned over if projection rotates it by more than this (cosine); rounds of a check of its neighbours.
_TURNED, _ROUNDS = 0.2, 10


@dataclass(frozen=True, eq=False)
class Base:
    """The coarse ``sheet``, and the true ``faces`` of the body.

    ``as_is`` (k, 3) are the centres of facets that are the file's own. Facets, before their edges are curved, deviate
    from the faces by up to ``deviation``, in units of the largest elements.
    """

    sheet: Sheet
    faces: Faces
    as_is: FloatArray
    deviation: float

    def is_own(self, sheet: Sheet) -> BoolArray:
        """Return a mask of the facets of a remeshed ``sheet`` that are still the file's own."""
        if not len(self.as_is):
            return np.zeros(len(sheet.facets), dtype=bool)
        distance, _ = cKDTree(self.as_is).query(sheet.centres)
        return np.asarray(distance < _SAME * np.ptp(sheet.points, axis=0).max())

    def own_points(self, sheet: Sheet) -> IntArray:
        """Return the corners of these facets."""
        return np.unique(sheet.facets[self.is_own(sheet)])


@dataclass(frozen=True)
class Near:
    """Contacts, each at a point with several elements within a radius; both in m."""

    contacts: tuple[tuple[Vector, float], ...]

    def at(self, points: FloatArray) -> FloatArray:
        """Return the size (m) of elements at points (n, 3)."""
        size = np.full(len(points), np.inf)
        for point, radius in self.contacts:
            distance = np.linalg.norm(points - np.array(point), axis=1)
            size = np.minimum(size, radius / _PER_CONTACT + _GROWTH * np.maximum(distance - 2 * radius, 0.0))
        return size


# Points, and numbers of points.
Arrays = dict[str, Any]
# Failures of earlier attempts at a mesh, in order.
Tangles = Sequence[TangledError]


class Kept(Protocol):
    """A cache of arrays that persists between runs."""

    def arrays(self, key: str, make: Callable[[], Arrays]) -> Arrays:
        """Return the arrays cached under ``key``; without any, call ``make`` and cache its result."""


def far_surface(
    body: Scanned,
    kept: Kept | None = None,
    finer: float = 1,
    tangles: Tangles = (),
    contact: Near | None = None,
    *,
    deviation: float = FINE,
) -> Base:
    """Return the surface of ``body`` away from any contact, from the cache ``kept`` if it is there.

    Its elements are smaller than the body's curvature requires, by the factor ``finer``, and deviate from it by
    ``deviation`` in units of their largest size. Around the ``tangles`` of earlier attempts they are the facets of the
    file. Near a ``contact``, if given, they are small.

    Raises:
        GeometryError: if nothing, or all, of it is fixed.
        MeshError: if the remesher fails.
    """
    (below,), (skin,), triangles = body.hold.edges(), body.surfaces()["skin"], body.triangles
    largest = body.bend / EDGES_PER_RADIUS / finer
    parts = body.partition or Complex.around(triangles)

    def make() -> Arrays:
        made = base(parts, skin, below, largest, tangles, contact, deviation=deviation)
        sheet = made.sheet
        return {
            "points": sheet.points,
            "facets": sheet.facets,
            "group": sheet.group,
            "sharp": sheet.sharp,
            "level": made.faces.level,
            "as_is": made.as_is,
        }

    if kept is None or tangles or contact:
        found = make()
    else:
        key = f"surface {_VERSION} {parts.hash} {below!r} {largest!r} {deviation!r} {release()}"
        found = kept.arrays(key, make)
    return Base(
        sheet=Sheet(found["points"], found["facets"], found["group"], found["sharp"]),
        faces=Faces(skin, found["level"], body.partition),
        as_is=found["as_is"],
        deviation=deviation,
    )


@stage("far surface")
def base(
    parts: Complex,
    skin: Surface,
    below: float,
    largest: float,
    tangles: Tangles = (),
    contact: Near | None = None,
    *,
    deviation: float = FINE,
) -> Base:
    """Return the surface in elements of at most ``largest`` (m), fixed below the height ``below`` (m).

    ``parts`` are the body's surface, ``skin``, and those between its regions. ``deviation`` is that of :class:`Base`.
    Around ``tangles`` the facets stay unchanged. Near a ``contact`` elements are small.

    Raises:
        GeometryError: if nothing, or all, is fixed.
        MeshError: if the remesher fails.
    """
    points, facets = parts.points, parts.facets
    is_divided = len(parts.regions) > 1
    sheet = cut(points, facets, below, parts.sides) if is_divided else cut(*merged(points, facets), below)
    if len(np.unique(sheet.skin.kind)) < 2:
        low, high = points[:, 2].min(), points[:, 2].max()
        raise GeometryError(f"a level of {below:g} m does not cut a surface between {low:g} and {high:g} m")
    faces = Faces(skin, level_line(points, facets[parts.sides[:, 1] == OUTSIDE], below), parts if is_divided else None)
    sheet = Sheet(sheet.points, sheet.facets, sheet.group, sharp_edges(sheet, largest))
    as_is = _round(sheet, tangles)
    made = Base(sheet, faces, sheet.centres[as_is], deviation)
    # Twice with a contact: only in the second pass points are dense enough for sizes that change fast.
    for _ in range(1 if contact is None else 2):

        def size(points: FloatArray) -> FloatArray:
            found = np.full(len(points), largest)
            return found if contact is None else np.minimum(found, contact.at(points))

        if is_divided:
            sheet = coarsened(sheet, size, deviation * largest, made.is_own)
        else:
            sheet = remesh(sheet, size(sheet.points), deviation * largest, as_is=made.is_own(sheet))
        own = made.own_points(sheet)
        sheet = put_back(sheet, faces, own, sheet.points[own])
    return replace(made, sheet=sheet)


def _round(sheet: Sheet, tangles: Tangles) -> BoolArray:
    """Return a mask of the file's facets near tangles; the distance grows with each attempt."""
    near, centres = np.zeros(len(sheet.facets), dtype=bool), cKDTree(sheet.centres)
    for number, tangle in enumerate(tangles, start=1):
        _, nearest, _ = igl.point_mesh_squared_distance(tangle.places, sheet.points, sheet.facets)
        own = np.ptp(sheet.points[sheet.facets[nearest]], axis=1).max(axis=1)
        reach = _REACH * number * np.maximum(own, tangle.reach)
        near[nearest] = True
        near[np.concatenate(centres.query_ball_point(tangle.places, reach)).astype(int)] = True
    return near


def put_back(sheet: Sheet, faces: Faces, known: IntArray | None = None, places: FloatArray | None = None) -> Sheet:
    """Return the sheet with its points projected onto the true ``faces``.

    The ``known`` points (k) move to their ``places`` (k, 3). Points on sharp edges stay, and so do points whose facets
    would turn over.
    """
    moved, stay = faces.project(sheet), np.unique(sheet.sharp)
    moved[stay] = sheet.points[stay]
    if known is not None:
        moved[known] = places
    return settled(sheet, moved)


def settled(sheet: Sheet, moved: FloatArray) -> Sheet:
    """Move the points of a sheet, except those whose facets would turn over, or in a divided sheet cross others."""
    before, points = sheet.normals, moved.copy()
    already = int(crossing_facets(sheet).sum()) if sheet.is_divided else 0
    for _ in range(_ROUNDS):
        after = Sheet(points, sheet.facets, sheet.group, sheet.sharp)
        bad = (before * after.normals).sum(axis=1) < _TURNED
        if sheet.is_divided and not bad.any() and (crossing := crossing_facets(after)).sum() > already:
            bad = crossing
        if not bad.any():
            return after
        back = np.unique(sheet.facets[bad])
        points[back] = sheet.points[back]
    return sheet
