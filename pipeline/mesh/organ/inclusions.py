"""Surfaces of inclusions in a body of triangles, as triangles that follow the size field."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull

from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.generate import MeshError
from pipeline.mesh.organ.field import Field
from pipeline.mesh.organ.remesh import remesh
from pipeline.mesh.organ.sheet import FREE, Sheet
from pipeline.shapes.ovoid import Ovoid
from pipeline.shapes.regions import Inclusion

# Points of the initial surface, and passes of remeshing: only in the second pass points are dense enough for sizes that
# change fast.
_POINTS, _PASSES = 1000, 2
# Largest deviation of chords from the surface, in units of the smallest semi-axis; the field controls the sizes.
_DEVIATION = 0.05


def inclusion_surfaces(inclusions: Sequence[Inclusion], field: Field) -> list[tuple[FloatArray, IntArray]]:
    """Return points (n, 3), in m, and facets (m, 3) of the surface of each inclusion; points are on the true surface.

    Raises:
        MeshError: if the remesher fails.
    """
    return [_to_sizes(inclusion.surface, field) for inclusion in inclusions]


def _to_sizes(surface: Ovoid, field: Field) -> tuple[FloatArray, IntArray]:
    points, facets = _evenly(surface)
    for _ in range(_PASSES):
        sheet = Sheet(points, facets, np.full(len(facets), FREE), np.empty((0, 2), dtype=np.int64))
        made = remesh(sheet, field.at(points), _DEVIATION * min(surface.axes))
        points, facets = surface.project(made.points), made.facets
    corners = points[facets] - np.array(surface.centre)
    if not (np.linalg.det(corners) > 0).all():
        raise MeshError("the remesher folded the surface of an inclusion")
    return points, facets


def _evenly(surface: Ovoid) -> tuple[FloatArray, IntArray]:
    """Return points spread evenly over the surface, and the facets between them, oriented outward."""
    points = surface.sample(_POINTS)
    on_ball = (points - np.array(surface.centre)) / np.array(surface.axes)
    facets = ConvexHull(on_ball).simplices.astype(np.int64)
    inward = np.linalg.det(on_ball[facets]) < 0
    facets[inward] = facets[inward][:, ::-1]
    return points, facets
