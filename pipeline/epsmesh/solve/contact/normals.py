"""Normals of tissue at the nodes of a loose interface, along which nodal forces of a uniform pressure act."""

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.solve import SolveError
from epsmesh.solve.contact.facets import FACET_CORNERS, FacetNodes
from epsmesh.solve.contact.surface import Candidates

# Shares of a uniform pressure below this are rounding.
_NOTHING = 1e-9


def nodal_normals(candidates: Candidates, pressed: FloatArray, means: FloatArray, free: FloatArray) -> FloatArray:
    """Return unit normals (n, 3) into the body at ``candidates`` of a loose interface.

    ``pressed`` (n, 3) are the nodal forces of a uniform pressure: frictionless contact bears it as it is, in degree 1
    and from degree 3 on. Some nodes have no share of it on flat facets, as corners in degree 2: their normals are the
    ``means`` (m, 3) around their facets. Components that are not ``free`` (n, 3) are 0: a node on a plane of symmetry
    has its normal in that plane.

    Raises:
        SolveError: if the third component alone is prescribed somewhere.
    """
    if ((free[:, 2] == 0) & free.any(axis=1)).any():
        raise SolveError("a loose interface meets a plane of symmetry across z, where its normals are not computed")
    around = np.zeros((len(candidates), 3))
    for column in candidates.facets.T:
        np.add.at(around, column, means)
    bears = np.zeros(len(candidates), dtype=bool)
    bears[candidates.facets[:, _bears(candidates.shape)]] = True
    signs = np.where(np.einsum("ni,ni->n", pressed, around) < 0, -1.0, 1.0)
    normal = np.where(bears[:, None], signs[:, None] * pressed, around)
    return within_planes(normal, free)


def deformed_normals(candidates: Candidates, points: FloatArray, at_rest: FloatArray, free: FloatArray) -> FloatArray:
    """Return unit normals (n, 3) of the facets of ``candidates`` whose nodes are at ``points`` (n, 3), m.

    They are means of the facets around a node, on the side of the normals ``at_rest`` (n, 3). Components that are not
    ``free`` (n, 3) are 0: those across planes of symmetry.
    """
    facets, shape = candidates.facets, candidates.shape
    before, now = (shape.normals(places[facets]) for places in (candidates.points, points))
    side = np.sign(np.einsum("mki,mki->m", before, at_rest[facets]))
    found = np.zeros_like(points)
    np.add.at(found, facets, side[:, None, None] * now)
    return within_planes(found, free)


def within_planes(normals: FloatArray, free: FloatArray) -> FloatArray:
    """Return unit ``normals`` (n, 3) without components that are not ``free`` (n, 3), unless none is."""
    found = np.where(free.any(axis=1)[:, None], free * normals, normals)
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


def means_of(facets: IntArray, normals: FloatArray) -> FloatArray:
    """Return the mean of unit ``normals`` (n, 3) at the corners of ``facets`` (m, ≥ 3)."""
    return np.asarray(normals[facets[:, :FACET_CORNERS]].mean(axis=1))


def _bears(shape: FacetNodes) -> BoolArray:
    return np.asarray(np.abs(shape.weights) > _NOTHING)
