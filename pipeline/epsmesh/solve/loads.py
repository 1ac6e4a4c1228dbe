"""Nodal forces of dead loads: weights and tractions that keep magnitude and direction while the body deforms,

    f_i = ∫ ρ g · φ_i dx + ∫ t · φ_i ds.

Tractions act on the free surface. The edge of a cap crosses facets: these are subdivided, so that the resultant is that
of the cap.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import basix
import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.scene.model import FREE
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import add_from_ghosts, global_sum, vector
from epsmesh.solve.movement import Loads, SurfaceLoad, Vector
from epsmesh.solve.points.locate import table_of

_CORNERS = np.vstack([np.zeros(3), np.eye(3)])  # of the reference cell
_FACETS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])  # corners of its facets, in the order of dolfinx
# Quadrature degrees that the map of a curved cell adds.
_CURVED = 3
# Subdivision of facets at a cap's edge: cap radius over size of a piece, and most halvings.
_PIECE, _MOST_HALVINGS = 32, 7
# Width over which a piece there passes from outside to inside, in units of the root of its area.
_WIDTH = 1.2
# Cells processed together.
_CHUNK = 20_000
# Centre (m) and radius (m).
Ball = tuple[Sequence[float], float]


@dataclass(frozen=True, eq=False)
class Applied:
    """Loads on the dofs of a space: nodal ``forces`` (N) on owned dofs, on the modelled part.

    ``size`` (N) is the integral of the loads' magnitude, ``resultant`` (3), in N, that of the loads; both global.
    """

    comm: MPI.Comm
    forces: FloatArray
    size: float
    resultant: FloatArray

    def is_same(self, other: "Applied | None") -> bool:
        """Return whether ``other`` loads have the same nodal forces on all ranks; collective."""
        is_here = other is not None and np.array_equal(self.forces, other.forces)
        return bool(self.comm.allreduce(is_here, op=MPI.LAND))


def apply_loads(loads: Loads, body: BodyMesh, space: Any) -> Applied:
    """Return the loads on the dofs of ``space``, a space of displacements on the mesh of ``body``; collective.

    Raises:
        SolveError: if no facet carries a load on the surface.
    """
    dofs = compat.cell_dofs(space)
    with vector(space) as forces:
        with forces.localForm() as local:
            nodal, found = np.zeros((local.getLocalSize() // 3, 3)), []
            if any(any(weight) for weight in loads.weights):
                found.append(_add_weights(loads.weights, body, space, dofs, nodal))
            found += [_add_traction(load, body, space, dofs, nodal) for load in loads.surface]
            local.array[:] = nodal.reshape(-1)
        add_from_ghosts(forces)
        totals = global_sum(body.comm, np.array(found).reshape(-1, 5))
        if len(totals) and not np.all(totals[:, 4] > 0):
            raise SolveError("the traction acts on no free surface: its area is under the probe, or fixed")
        return Applied(body.comm, forces.array.copy(), float(totals[:, 3].sum()), totals[:, :3].sum(axis=0))


def pressed_by(body: BodyMesh, space: Any, group: str) -> FloatArray:
    """Return the nodal forces (N), on owned dofs of ``space``, of a pressure of 1 Pa on a ``group`` of facets;
    collective."""
    dofs, facets = compat.cell_dofs(space), boundary_of(body, (group,))
    every = np.ones(len(facets.cells), dtype=bool)
    with vector(space) as forces:
        with forces.localForm() as local:
            nodal = np.zeros((local.getLocalSize() // 3, 3))
            for part, points, areas in _areas_at_points(facets, every, None, compat.degree(space)):
                shares = np.einsum("qi,cqx->cix", table_of(compat.degree(space), points)[0], -areas)
                np.add.at(nodal, dofs[facets.cells[part]].reshape(-1), shares.reshape(-1, 3))
            local.array[:] = nodal.reshape(-1)
        add_from_ghosts(forces)
        return np.array(forces.array)


def _add_weights(
    weights: tuple[Vector, ...], body: BodyMesh, space: Any, dofs: Int32Array, nodal: FloatArray
) -> list[float]:
    """Add the body's weight to ``nodal`` forces; return this rank's integrals: x, y, z, magnitude, volume."""
    degree, geometry = compat.degree(space), _nodes(body)
    order = 1 if geometry.shape[1] == 4 else 2
    points, quadrature = basix.make_quadrature(basix.CellType.tetrahedron, degree + (0 if order == 1 else _CURVED))
    functions, gradients = table_of(degree, points)[0], table_of(order, points)[1:]
    by_region = np.array(weights)
    sums = np.zeros(5)
    for start in range(0, body.owned_cells, _CHUNK):
        cells = np.arange(start, min(start + _CHUNK, body.owned_cells))
        jacobian = np.einsum("aqk,ckx->cqxa", gradients, geometry[cells])
        measure = np.abs(np.linalg.det(jacobian)) * quadrature
        regions = 0 if body.regions is None or len(weights) == 1 else body.regions[cells]
        weight = np.broadcast_to(by_region[regions], (len(cells), 3))
        shares = measure @ functions
        np.add.at(nodal, dofs[cells].reshape(-1), (shares[:, :, None] * weight[:, None, :]).reshape(-1, 3))
        volumes = measure.sum(axis=1)
        sums += [*(volumes @ weight), volumes @ np.linalg.norm(weight, axis=1), volumes.sum()]
    return [*map(float, sums)]


def _add_traction(load: SurfaceLoad, body: BodyMesh, space: Any, dofs: Int32Array, nodal: FloatArray) -> list[float]:
    """Add a surface load to ``nodal`` forces; return this rank's integrals: x, y, z, magnitude, area."""
    sums = np.zeros(5)
    free, degree = boundary_of(body, (FREE,)), compat.degree(space)
    carries = load.on_facets(free.corners, free.normals)
    for part, points, areas in _areas_at_points(free, carries, load.within, degree):
        values, size = table_of(degree, points)[0], np.linalg.norm(areas, axis=2)
        forces = np.array(load.traction) * size[:, :, None] - load.pressure * areas
        shares = np.einsum("qi,cqx->cix", values, forces)
        np.add.at(nodal, dofs[free.cells[part]].reshape(-1), shares.reshape(-1, 3))
        total, magnitude = forces.sum(axis=(0, 1)), np.linalg.norm(forces, axis=2).sum()
        sums += [*total, magnitude, size.sum()]
    return [*map(float, sums)]


@dataclass(frozen=True, eq=False)
class Boundary:
    """Local ``facets`` (n) of the boundary: their owned cell, their number in it, and the nodes (m) of that cell.

    ``corners`` (n, 3, 3), in m, and outward unit ``normals`` (n, 3) are those of the facets.
    """

    facets: Int32Array
    cells: Int32Array
    sides: Int32Array
    geometry: FloatArray
    corners: FloatArray
    normals: FloatArray


def boundary_of(body: BodyMesh, groups: Sequence[str]) -> Boundary:
    """Return the facets of boundary ``groups`` of the cells that this rank owns."""
    topology, tdim = body.mesh.topology, body.mesh.topology.dim
    topology.create_connectivity(tdim - 1, tdim)
    topology.create_connectivity(tdim, tdim - 1)
    of_facet, of_cell = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    facets = np.concatenate([body.facets.get(group, np.empty(0, dtype=np.int32)) for group in groups])
    cells = np.array([of_facet.links(facet)[0] for facet in facets], dtype=np.int32)
    owned = cells < body.owned_cells
    cells, facets = cells[owned], facets[owned]
    beside = of_cell.array.reshape(-1, 4)[cells]
    sides = np.asarray((beside == facets[:, None]).argmax(axis=1), dtype=np.int32)
    geometry = _nodes(body)[cells]
    corners = geometry[np.arange(len(cells))[:, None], _FACETS[sides]]
    opposite = geometry[np.arange(len(cells)), sides]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals *= np.sign(np.einsum("cx,cx->c", corners[:, 0] - opposite, normals))[:, None]
    return Boundary(facets, cells, sides, geometry, corners, normals)


def areas_within(boundary: Boundary, chosen: BoolArray, ball: Ball) -> FloatArray:
    """Return the area (m²) of each facet of a ``boundary`` (n) that is within a ``ball``, 0 if it is not ``chosen``."""
    found = np.zeros(len(chosen))
    for part, _, areas in _areas_at_points(boundary, chosen, ball, 0):
        found[part] += np.linalg.norm(areas, axis=2).sum(axis=1)
    return found


def _areas_at_points(
    boundary: Boundary, chosen: BoolArray, within: Ball | None, degree: int
) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
    """Yield ``chosen`` facets, quadrature points (q, 3) of the reference cell, and their outward areas (m, q, 3), m².

    Areas outside the ball ``within`` are zero. Integrands have a ``degree``.
    """
    sides, geometry, normals = boundary.sides, boundary.geometry, boundary.normals
    halvings = halvings_at_end(within, boundary.corners)
    order = 1 if geometry.shape[1] == 4 else 2
    degree += 0 if order == 1 else _CURVED
    for side in range(4):
        for count in np.unique(halvings[chosen & (sides == side) & (halvings >= 0)]):
            facets = np.flatnonzero(chosen & (sides == side) & (halvings == count))
            flat, quadrature = _rule(degree, int(count))
            a, b, c = _CORNERS[_FACETS[side]]
            points = a + flat[:, :1] * (b - a) + flat[:, 1:] * (c - a)
            places, gradients = table_of(order, points)[0], table_of(order, points)[1:]
            for part in np.array_split(facets, -(-len(facets) * len(points) // 500_000)):
                x = np.einsum("qk,ckx->cqx", places, geometry[part])
                jacobian = np.einsum("aqk,ckx->cqxa", gradients, geometry[part])
                areas = np.cross(jacobian @ (b - a), jacobian @ (c - a)) * quadrature[:, None]
                areas *= np.sign(np.einsum("cqx,cx->cq", areas, normals[part]))[:, :, None]
                if within is not None and count:
                    centre, radius = within
                    width = _WIDTH * np.sqrt(np.linalg.norm(areas, axis=2))
                    areas *= np.clip(0.5 + (radius - np.linalg.norm(x - centre, axis=2)) / width, 0.0, 1.0)[:, :, None]
                yield part, points, areas


def halvings_at_end(within: Ball | None, corners: FloatArray) -> Int32Array:
    """Return how often to halve each facet's sides for the quadrature, -1 for facets outside the ball ``within``."""
    halvings = np.zeros(len(corners), dtype=np.int32)
    if within is None:
        return halvings
    centre, radius = np.array(within[0]), within[1]
    middle = corners.mean(axis=1)
    # Radius of a facet around its centre, with a margin for curved facets.
    size = 1.2 * np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    away = np.linalg.norm(middle - centre, axis=1)
    needed = np.ceil(np.log2(np.maximum(1.0, _PIECE * size / radius)))
    halvings[:] = np.clip(np.maximum(needed, 2), 0, _MOST_HALVINGS)
    halvings[away + size <= radius] = 0
    halvings[away - size > radius] = -1
    return halvings


def _nodes(body: BodyMesh) -> FloatArray:
    """Return the nodes (m) of each local cell, (cells, 4 or 10, 3), of the shape that the study gives."""
    return np.asarray(body.shown[compat.geometry_dofs(body.mesh)])


@cache
def _rule(degree: int, halvings: int) -> tuple[FloatArray, FloatArray]:
    """Return points (q, 2) and weights (q) on the reference triangle: a composite rule on its pieces."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, degree if halvings == 0 else 1)
    for _ in range(halvings):
        moved = [points + shift for shift in ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0])]
        points = np.vstack([*moved, 1.0 - points]) / 2
        weights = np.tile(weights, 4) / 4
    return points, weights
