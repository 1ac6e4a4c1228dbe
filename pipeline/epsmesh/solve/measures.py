"""Measures of the integrals of forms: quadrature degrees on straight and on curved cells."""

from collections.abc import Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import ufl
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.solve.compiled import quadrature_degree

# Marks of cells, and the rounding error of an edge's bulge, in units of its length.
_NEITHER, STRAIGHT, _CURVED = 0, 1, 2
_FLAT = 1e-9
# Cells that are looked at together: their points fit into the cache.
_AT_ONCE = 2**14
CURVED: WeakKeyDictionary[Any, BoolArray | None] = WeakKeyDictionary()
MARKED: WeakKeyDictionary[Any, dict[bool, Any]] = WeakKeyDictionary()


def dx(space: Any, *, curved_only: bool = False, more: int = 0, everywhere: bool = False) -> Any:
    """Return the measure for forms of elasticity on ``space``, with quadrature degrees; of curved cells only, if so.

    On straight cells degree 2p - 2 is exact; ``more`` is added for integrands that are no such polynomials. Curved
    cells have a higher degree of their own, since few cells of a mesh are curved; all cells if ``everywhere``.
    """
    degree, mesh = compat.degree(space), space.mesh
    exact, enough = ({"quadrature_degree": d} for d in (2 * degree - 2 + more, quadrature_degree(degree)))
    marks = None if everywhere else marked_cells(mesh, curved_only=curved_only)
    if marks is None:
        return ufl.dx(metadata=enough if everywhere else exact)
    measure = ufl.Measure("dx", domain=mesh, subdomain_data=marks)
    return measure(STRAIGHT, metadata=exact) + measure(_CURVED, metadata=enough)


def marked_cells(mesh: Any, *, curved_only: bool = False) -> Any:
    """Return tags of the cells of a mesh, straight and curved ones, or of curved ones only; None if none can be."""
    curved, known = curved_cells(mesh), MARKED.setdefault(mesh, {})
    if curved is not None and curved_only not in known:
        marks = np.where(curved, _CURVED, _NEITHER if curved_only else STRAIGHT)
        known[curved_only] = compat.cell_tags(mesh, marks)
    return known.get(curved_only)


def measures_of(
    space: Any, cells: Mapping[str, BoolArray | None], *, more: int, everywhere: bool = False
) -> dict[str, Any]:
    """Return a measure for each law on its ``cells``, None for all of them: see :func:`dx`."""
    masks = [mask for mask in cells.values() if mask is not None]
    if not masks:
        return {law: dx(space, more=more, everywhere=everywhere) for law in cells}
    degree, mesh, count = compat.degree(space), space.mesh, len(masks)
    exact, enough = ({"quadrature_degree": d} for d in (2 * degree - 2 + more, quadrature_degree(degree)))
    curved, marks = curved_cells(mesh), np.array(masks).argmax(axis=0) + 1
    if everywhere:
        curved, exact = None, enough
    if curved is not None:
        marks[curved] += count
    measure = ufl.Measure("dx", domain=mesh, subdomain_data=compat.cell_tags(mesh, marks))
    straight = [measure(number, metadata=exact) for number in range(1, count + 1)]
    if curved is None:
        return dict(zip(cells, straight, strict=True))
    bent = [measure(count + number, metadata=enough) for number in range(1, count + 1)]
    return {law: one + other for law, one, other in zip(cells, straight, bent, strict=True)}


def curved_cells(mesh: Any) -> BoolArray | None:
    """Return a mask of local cells with a mid node off the middle of its edge; None if cells have no mid nodes."""
    if mesh not in CURVED:
        CURVED[mesh] = _find_curved(mesh)
    return CURVED[mesh]


def has_curved_cells(mesh: Any) -> bool:
    """Return whether any rank has a curved cell; collective."""
    curved = curved_cells(mesh)
    return bool(mesh.comm.allreduce(curved is not None and bool(curved.any()), op=MPI.LOR))


def _find_curved(mesh: Any) -> BoolArray | None:
    nodes, points = compat.geometry_dofs(mesh), np.asarray(mesh.geometry.x)
    if nodes.shape[1] == 4:
        return None
    curved = np.empty(len(nodes), dtype=bool)
    for start in range(0, len(nodes), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        curved[some] = _are_curved(points, nodes[some])
    return curved


def _are_curved(points: FloatArray, nodes: IntArray) -> BoolArray:
    bulge, length = np.zeros(len(nodes)), np.zeros(len(nodes))
    for number, ends in enumerate(EDGES, start=4):
        first, second = (points[nodes[:, end]] for end in ends)
        off = points[nodes[:, number]] - (first + second) / 2
        for most, values in ((bulge, off), (length, second - first)):
            for along in values.T:
                np.maximum(most, np.abs(along), out=most)
    return np.asarray(bulge > _FLAT * length)
