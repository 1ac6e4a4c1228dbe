"""The displacement on all nodes of its elements, and the stress of each element, of the whole body on one process."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.solve.points.locate import table_of
from epsmesh.solve.points.state import State

# Reflection inverts tetrahedra: the second and third coordinate of the reference cell are swapped.
_SWAPPED = [0, 2, 1]
# Distance from a plane of symmetry, as a share of the largest, at which a node is in it.
_IN_PLANE = 1e-9


@dataclass(frozen=True, eq=False)
class LagrangeNodes:
    """Nodes of elements of one degree, equidistant on the reference cell: ``points`` (n, 3), m, of the undeformed body.

    ``cells`` (m, nodes) are in basix's order, ``displacement`` (n, 3) is in m.
    """

    points: FloatArray
    cells: IntArray
    displacement: FloatArray


def nodes_of(state: State, mirrors: tuple[str, ...]) -> LagrangeNodes | None:
    """Return the nodes of the whole body, on rank 0, cells as the mesh was made; collective.

    None on other ranks, and where they are those of the mesh itself.
    """
    body, degree = state.body, state.degree
    owned, order = body.owned_cells, state.locator.order
    if degree == order:
        return None
    at = compat.equidistant_nodes(degree)
    nodes = compat.geometry_dofs(body.mesh)[:owned]
    corners, unloaded = body.shown[nodes], (np.asarray(body.mesh.geometry.x) - body.shown)[nodes]
    dofs = compat.cell_dofs(state.displacement.function_space)[:owned]
    values = np.asarray(state.displacement.x.array).reshape(-1, 3)[dofs]
    places, moved = (
        np.einsum("qk,nkd->nqd", table_of(of, at)[0], each) for of, each in ((order, corners), (degree, values))
    )
    moved += np.einsum("qk,nkd->nqd", table_of(order, at)[0], unloaded)
    numbers = state.displacement.function_space.dofmap.index_map.local_to_global(dofs.reshape(-1).astype(np.int32))
    parts = body.comm.gather((compat.original_cells(body.mesh)[:owned], np.reshape(numbers, dofs.shape), places, moved))
    if parts is None:
        return None
    which, cells, places, moved = (np.concatenate(part) for part in zip(*parts, strict=True))
    back = np.argsort(which)
    _, first, inverse = np.unique(cells[back], return_index=True, return_inverse=True)
    points, displacement = places[back].reshape(-1, 3)[first], moved[back].reshape(-1, 3)[first]
    found = LagrangeNodes(points, np.reshape(inverse, cells.shape).astype(np.int64), displacement)
    for plane in mirrors:
        found = _reflected(found, "xy".index(plane), at)
    return found


def _reflected(nodes: LagrangeNodes, axis: int, at: FloatArray) -> LagrangeNodes:
    """Return nodes joined with their mirror images; ``at`` are the nodes of the reference cell."""
    sign = np.ones(3)
    sign[axis] = -1.0
    swapped = np.abs(at[:, None] - at[None, :, _SWAPPED]).sum(axis=2).argmin(axis=1)
    count, across = len(nodes.points), np.abs(nodes.points[:, axis])
    beside = across > _IN_PLANE * across.max()
    image = np.where(beside, count + np.cumsum(beside) - 1, np.arange(count))
    return LagrangeNodes(
        np.vstack([nodes.points, nodes.points[beside] * sign]),
        np.vstack([nodes.cells, image[nodes.cells[:, swapped]]]),
        np.vstack([nodes.displacement, nodes.displacement[beside] * sign]),
    )


def stresses_of(state: State, mirrors: tuple[str, ...]) -> FloatArray | None:
    """Return the stress (m, 3, 3), Pa, at the centre of each cell of the whole body, on rank 0; collective."""
    stress = state.of_cells(np.arange(state.body.owned_cells), np.full((1, 3), 0.25)).stress
    comm: MPI.Comm = state.body.comm
    parts = comm.gather((compat.original_cells(state.body.mesh)[: len(stress)], stress))
    if parts is None:
        return None
    which, found = (np.concatenate(part) for part in zip(*parts, strict=True))
    found = found[np.argsort(which)]
    for plane in mirrors:
        sign = np.ones(3)
        sign["xy".index(plane)] = -1.0
        found = np.concatenate([found, found * np.outer(sign, sign)])
    return np.asarray(found)
