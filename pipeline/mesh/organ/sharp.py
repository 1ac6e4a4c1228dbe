"""Sharp edges of a surface: those that remain when one looks from as far as an element is large."""

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipeline.arrays import IntArray
from pipeline.mesh.organ.sheet import Sheet, edges_of

# Facets that meet at a larger angle (cosine) make a sharp edge, if those at some distance from it do so, too.
_SHARP = 0.7


def sharp_edges(sheet: Sheet, largest: float) -> IntArray:
    """Return the edges (k, 2) at which the surface is sharp: not only facet by facet, as noise and voxels are."""
    edges, sides = edges_of(sheet.facets)
    normals = sheet.normals
    sharp = (normals[sides[:, 0]] * normals[sides[:, 1]]).sum(axis=1) < _SHARP
    edges, sides = edges[sharp], sides[sharp]
    if not len(edges):
        return edges
    middle = sheet.points[edges].mean(axis=1)
    centre = sheet.points[sheet.facets].mean(axis=1)
    mean = []
    for side in sides.T:
        # Into the facet, as far as half an element reaches: the facets about there say which way the surface faces.
        along = sheet.points[edges[:, 1]] - sheet.points[edges[:, 0]]
        inward = centre[side] - middle
        inward -= along * ((inward * along).sum(axis=1) / (along**2).sum(axis=1))[:, None]
        inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), np.finfo(float).tiny)
        total = np.zeros_like(inward)
        for share in (0.1, 0.2, 0.3, 0.4, 0.5, 0.6):
            place = np.ascontiguousarray(middle + share * largest * inward)
            _, facet, _ = igl.point_mesh_squared_distance(place, sheet.points, sheet.facets)
            total += normals[facet]
        mean.append(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), np.finfo(float).tiny))
    return _long_lines(sheet, edges[(mean[0] * mean[1]).sum(axis=1) < _SHARP], largest)


def _long_lines(sheet: Sheet, edges: IntArray, largest: float) -> IntArray:
    """Return those of the edges that make lines as long as an element: a speck is no edge of a body."""
    count = len(sheet.points)
    joined = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    _, line = connected_components(joined, directed=False)
    length = np.linalg.norm(sheet.points[edges[:, 1]] - sheet.points[edges[:, 0]], axis=1)
    of_line = line[edges[:, 0]]
    return edges[np.bincount(of_line, length, minlength=1)[of_line] > largest] if len(edges) else edges
