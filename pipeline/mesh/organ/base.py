"""The surface away from the contact: cut where it is held, and meshed as coarsely as it is round.

It depends on the body alone, so that every place, tool and mesh on it shares it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.generate import GeometryError
from pipeline.mesh.organ.even import merged
from pipeline.mesh.organ.field import PER_RADIUS
from pipeline.mesh.organ.level import cut, level_line, on_segments
from pipeline.mesh.organ.narrow import NOWHERE, Narrow, narrow_places
from pipeline.mesh.organ.remesh import release, remesh
from pipeline.mesh.organ.sharp import sharp_edges
from pipeline.mesh.organ.sheet import FIXED, FREE, Sheet
from pipeline.shapes.scanned import Scanned
from pipeline.shapes.surface import Surface
from pipeline.stages import stage

# Raise by hand when the same file gives another surface.
_VERSION = 4
# How far, in units of the largest elements, the surface between two meshings may be from the file's: points are put
# back onto the file's after each.
DEVIATION = 0.02
# Facets that turn by more (cosine) as their points are put back have turned over; so often neighbours are looked at.
_TURNED, _ROUNDS = 0.2, 10


@dataclass(frozen=True, eq=False)
class Base:
    """The coarse ``sheet``, and the ``level`` line (n, 2, 3), in m, at which what is held of the true surface ends.

    Elements are smaller where it is ``narrow``.
    """

    sheet: Sheet
    level: FloatArray
    narrow: Narrow = NOWHERE


# Points, and numbers of points.
Arrays = dict[str, Any]


class Kept(Protocol):
    """A place where arrays are kept from run to run."""

    def arrays(self, key: str, make: Callable[[], Arrays]) -> Arrays:
        """Return what is kept under ``key``, or what ``make`` returns, which is then kept."""


def far_surface(body: Scanned, kept: Kept | None = None, finer: float = 1, adapted: bool = False) -> Base:
    """Return the surface of ``body`` away from any contact, out of what is ``kept`` if it is there.

    Its elements are ``finer`` by this factor than the body's bend asks for, and if ``adapted``, no larger than thin
    parts and narrow gaps are wide.

    Raises:
        GeometryError: if nothing, or all, of it is held.
        MeshError: if the remesher fails.
    """
    (below,), (skin,), triangles = body.support.edges(), body.surfaces()["skin"], body.triangles
    largest, how = body.bend / PER_RADIUS / finer, " adapted" if adapted else ""

    def make() -> Arrays:
        made = base(triangles.points, triangles.facets, skin, below, largest, adapted)
        sheet, narrow = made.sheet, {"narrow": made.narrow.points, "sizes": made.narrow.sizes} if adapted else {}
        return {"points": sheet.points, "facets": sheet.facets, "group": sheet.group, "sharp": sheet.sharp,
                "level": made.level, **narrow}  # fmt: skip

    if kept is None:
        found = make()
    else:
        found = kept.arrays(f"surface {_VERSION} {triangles.hash} {below!r} {largest!r} {release()}{how}", make)
    sheet = Sheet(found["points"], found["facets"], found["group"], found["sharp"])
    return Base(sheet, found["level"], Narrow(found["narrow"], found["sizes"]) if adapted else NOWHERE)


@stage("far surface")
def base(points: FloatArray, facets: IntArray, skin: Surface, below: float, largest: float,
         adapted: bool = False) -> Base:  # fmt: skip
    """Return the surface in elements of at most ``largest`` (m), held below the height ``below`` (m).

    They are smaller where it is narrow, if ``adapted``.

    Raises:
        GeometryError: if nothing, or all, is held.
        MeshError: if the remesher fails.
    """
    even = merged(points, facets)
    sheet, narrow = cut(*even, below), narrow_places(*even, largest) if adapted else NOWHERE
    if len(np.unique(sheet.group)) < 2:
        low, high = points[:, 2].min(), points[:, 2].max()
        raise GeometryError(f"a level of {below:g} m does not cut a surface between {low:g} and {high:g} m")
    level = level_line(points, facets, below)
    sheet = Sheet(sheet.points, sheet.facets, sheet.group, sharp_edges(sheet, largest))
    coarse = remesh(sheet, np.minimum(largest, narrow.at(sheet.points)), DEVIATION * largest)
    return Base(put_back(coarse, skin, level), level, narrow)


def put_back(
    sheet: Sheet, skin: Surface, level: FloatArray, known: IntArray | None = None, places: FloatArray | None = None
) -> Sheet:
    """Return the sheet with its points on the ``skin``, those of the support's edge on the ``level`` line.

    The ``known`` points (k) go to their ``places`` (k, 3); those on sharp edges stay, and so do those whose facets
    would turn over.
    """
    moved = skin.project(sheet.points)
    line, stay = np.unique(sheet.border(FIXED, FREE)), np.unique(sheet.sharp)
    moved[line] = on_segments(sheet.points[line], level)
    moved[stay] = sheet.points[stay]
    if known is not None:
        moved[known] = places
    return _settled(sheet, moved)


def _settled(sheet: Sheet, moved: FloatArray) -> Sheet:
    """Move the points of a sheet, but not those whose facets would turn over by that."""
    before, points = sheet.normals, moved.copy()
    for _ in range(_ROUNDS):
        after = Sheet(points, sheet.facets, sheet.group, sheet.sharp)
        turned = (before * after.normals).sum(axis=1) < _TURNED
        if not turned.any():
            return after
        back = np.unique(sheet.facets[turned])
        points[back] = sheet.points[back]
    return sheet
