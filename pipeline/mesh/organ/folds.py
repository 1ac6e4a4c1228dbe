"""Surfaces without facets that are folded upon each other, as thin rims leave them, and which no volume can fill."""

from math import cos, radians

import numpy as np

from pipeline.mesh.generate import MeshError
from pipeline.mesh.organ.sheet import Sheet, edges_of

# Neighbours with less between them are folded: a tetrahedron in there would be flat. So often they are looked at.
_FOLDED = radians(10.0)
_ROUNDS = 10


def unfolded(sheet: Sheet) -> Sheet:
    """Return the sheet with the corners of folded facets in the middle of their neighbours.

    Points between groups, as those of the footprint's edge, stay, and those on sharp edges.

    Raises:
        MeshError: if that does not unfold them.
    """
    edges, sides = edges_of(sheet.facets)
    groups = sheet.group[sides]
    stay = np.unique(np.concatenate([edges[groups[:, 0] != groups[:, 1]].ravel(), sheet.sharp.ravel()]))
    from_to = np.vstack([edges, edges[:, ::-1]])
    share = np.bincount(from_to[:, 0], minlength=len(sheet.points))
    for _ in range(_ROUNDS):
        normals = sheet.normals
        folded = (normals[sides[:, 0]] * normals[sides[:, 1]]).sum(axis=1) < -cos(_FOLDED)
        if not folded.any():
            return sheet
        middle = np.zeros_like(sheet.points)
        np.add.at(middle, from_to[:, 0], sheet.points[from_to[:, 1]])
        moved = np.setdiff1d(sheet.facets[sides[folded]], stay)
        points = sheet.points.copy()
        points[moved] = middle[moved] / share[moved, None]
        sheet = Sheet(points, sheet.facets, sheet.group, sheet.sharp)
    raise MeshError("the surface, meshed anew, is folded upon itself")
