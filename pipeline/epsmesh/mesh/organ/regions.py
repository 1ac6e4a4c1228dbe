"""Tetrahedra in a body and its embedded regions, from the surfaces between them; hollow regions stay empty."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.generate import GeometryError, flat_cells, orient
from epsmesh.mesh.organ.embedded import embedded_surfaces
from epsmesh.mesh.organ.field import Field
from epsmesh.mesh.organ.sheet import TangledError
from epsmesh.mesh.organ.volume import fill
from epsmesh.shapes.body import Body
from epsmesh.shapes.complex import TISSUE, Complex


@dataclass(frozen=True, eq=False)
class Filled:
    """Points (n, 3) in m and cells (m, 4) of a body, the region of each cell, and the facets (k, 3) of cavities.

    ``regions`` are None if there is one region.
    """

    points: FloatArray
    cells: IntArray
    regions: IntArray | None
    walls: IntArray


def fill_regions(parts: Complex, body: Body, field: Field) -> Filled:
    """Fill a ``body``, whose surfaces are ``parts``, with cells, and those of its regions that are not among these.

    The first points are those of the ``parts``.

    Raises:
        GeometryError: if a hollow region is not within tissue.
        TangledError: if the surfaces leave no space for tetrahedra.
        MeshError: if a mesh generator fails.
    """
    pieces = dict(enumerate(body.embedded, start=1 + len(body.regions) - len(body.embedded)))
    apart = {number: piece for number, piece in pieces.items() if number not in parts.regions}
    inner = dict(zip(apart, embedded_surfaces(tuple(apart.values()), field), strict=True))
    parts = parts.holding(inner, {n: body.layer_at(piece.surface.bounds[1][2]) for n, piece in apart.items()})
    empty = [number for number, piece in pieces.items() if piece.is_hollow]
    tissue = parts.without(empty)
    if (tissue.sides < TISSUE).all(axis=1).any():
        raise GeometryError(
            "a hollow region meets the body's surface or another hollow region: it must be inside tissue"
        )
    points, cells, regions = fill(tissue, field)
    if (flat := flat_cells(points, cells)).any():
        raise TangledError.at(points[cells[flat]], "gmsh left a flat tetrahedron")
    walls = parts.facets[np.isin(parts.sides, empty).any(axis=1)]
    return Filled(points, orient(points, cells), regions, walls)
