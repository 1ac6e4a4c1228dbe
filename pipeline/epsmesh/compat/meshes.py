"""Meshes: gmsh, and how dolfinx takes and numbers them."""

import inspect
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from typing import Any

import basix
import dolfinx
import gmsh
import numpy as np
import ufl
from mpi4py import MPI

# What gmsh's session, one a process, is left open for, and what its user remembers of the model in it.
_left_open: list[tuple[Any, dict[str, Any]]] = []


@contextmanager
def gmsh_session(keep: Any = None) -> Iterator[dict[str, Any]]:
    """Start and end gmsh, leaving Python's handling of Ctrl-C as it was.

    Where there is something to ``keep``, the session is left open until the next one: if that one is to keep an equal
    thing, it finds the model as it was left, and what it lends, a dictionary, with what was put there. An exception
    ends it.

    gmsh 4.8 changes the handling when imported and when finalized, later versions when initialized.
    """
    handler = signal.getsignal(signal.SIGINT)
    kept, memory = _left_open.pop() if _left_open else (None, {})
    if kept is None or kept != keep:
        if kept is not None:
            gmsh.finalize()
        memory = {}
        gmsh.initialize([""], readConfigFiles=False)
    signal.signal(signal.SIGINT, handler)
    stays = False
    try:
        yield memory
        stays = keep is not None
    finally:
        if stays:
            _left_open.append((keep, memory))
        else:
            gmsh.finalize()
        signal.signal(signal.SIGINT, handler)


def inside_face(face: int, parameters: np.ndarray) -> np.ndarray:
    """Tell which points, parameters (n, 2) of the surface that carries it, are on a trimmed face of gmsh's model."""
    keywords = {"parametric": True} if "parametric" in inspect.signature(gmsh.model.isInside).parameters else {}
    return np.array([bool(gmsh.model.isInside(2, face, list(point), **keywords)) for point in parameters])


def _coordinate_element(cell: str, order: int, dim: int) -> Any:
    if hasattr(ufl, "VectorElement"):
        # ffcx 0.5 writes this variant into the element when it first compiles a form on the mesh, which changes the
        # name under which every later form on it is looked up in the cache.
        return ufl.VectorElement("Lagrange", cell, order, dim=dim, variant="equispaced")
    # Up to order 2 all variants are the same, and have one name.
    variant = {"lagrange_variant": basix.LagrangeVariant.equispaced} if order > 2 else {}
    return basix.ufl.element("Lagrange", cell, order, shape=(dim,), **variant)


def triangle_nodes(order: int) -> np.ndarray:
    """Return where the nodes of a triangle of a mesh of ``order`` are on the reference triangle, (k, 2)."""
    element = basix.create_element(
        basix.ElementFamily.P, basix.CellType.triangle, order, basix.LagrangeVariant.equispaced
    )
    return np.asarray(element.points)


def create_mesh(
    comm: MPI.Comm, cells: np.ndarray, points: np.ndarray, order: int, beyond: np.ndarray | None = None
) -> Any:
    """Create a distributed mesh of tetrahedra, or in the plane of triangles; collective.

    Arrays are on rank 0 only, or, with ``beyond``, on the rank that keeps the cells: the ranks (m, k) that have the
    cells next to each of them, -1 for none. Points are then numbered rank by rank.
    """
    dim = comm.bcast(points.shape[1] if comm.rank == 0 else 0)
    domain = ufl.Mesh(_coordinate_element("tetrahedron" if dim == 3 else "triangle", order, dim))
    more: dict[str, Any] = {_name_of_domain(): domain}
    if comm.size == 1:  # dolfinx would ask SCOTCH, whose threads take 3 ms to start and end
        beyond = np.empty((len(cells), 0), dtype=np.int32)
    if beyond is not None:
        destinations = _destinations(comm.rank, beyond)
        more["partitioner"] = lambda *_: destinations
    return dolfinx.mesh.create_mesh(comm, cells=cells, x=points, **more)


@cache
def _name_of_domain() -> str:
    return "domain" if "domain" in inspect.signature(dolfinx.mesh.create_mesh).parameters else "e"


def _destinations(rank: int, beyond: np.ndarray) -> Any:
    """Return the ranks that get each cell: first that which keeps it, then those that have it as a ghost."""
    ranks = np.sort(beyond, axis=1)
    chosen = np.column_stack([ranks[:, :1] >= 0, (ranks[:, 1:] >= 0) & (ranks[:, 1:] != ranks[:, :-1])])
    chosen = np.column_stack([np.ones(len(ranks), dtype=bool), chosen])
    ranks = np.column_stack([np.full(len(ranks), rank), ranks]).astype(np.int32)
    ends = np.concatenate([[0], np.cumsum(chosen.sum(axis=1))]).astype(np.int32)
    return dolfinx.cpp.graph.AdjacencyList_int32(ranks[chosen], ends)


def partition(cells: np.ndarray, parts: int) -> np.ndarray:
    """Return a part for each tetrahedron (m, 4) of a mesh on this process: few faces between parts of equal size."""
    none, cells = dolfinx.cpp.mesh.GhostMode.none, np.ascontiguousarray(cells, dtype=np.int64)
    make = dolfinx.cpp.mesh.create_cell_partitioner
    by_kind = ([dolfinx.cpp.mesh.CellType.tetrahedron], [cells.reshape(-1)])
    plain = (3, dolfinx.cpp.graph.AdjacencyList_int64(cells), none)
    # Since dolfinx 0.10 one tells how many cells a facet has at most; before 0.9 there was one kind of cells.
    for modes, mesh in (((none, 2), by_kind), ((none,), by_kind), ((), plain)):
        with suppress(TypeError):
            return np.array(make(*modes)(MPI.COMM_SELF, parts, *mesh).array, dtype=np.int32)
    raise TypeError("the partitioner of this dolfinx takes other arguments")


def geometry_dofs(mesh: Any) -> np.ndarray:
    """Return the geometry nodes of each local cell (owned and ghosts), shape (cells, nodes per cell)."""
    several = isinstance(getattr(type(mesh.geometry), "dofmaps", None), property)  # since 0.11
    dofmap = mesh.geometry.dofmaps[0] if several else mesh.geometry.dofmap
    if not hasattr(dofmap, "array"):
        return np.asarray(dofmap)
    # A rank may have no cells: their number does not tell that of their nodes.
    return np.asarray(dofmap.array).reshape(-1, mesh.geometry.cmap.create_dof_layout().num_dofs)


def original_cells(mesh: Any) -> np.ndarray:
    """Return, for each local cell, its number in the arrays that the mesh was made of."""
    return np.asarray(mesh.topology.original_cell_index, dtype=np.int64)


def cell_tags(mesh: Any, values: np.ndarray) -> Any:
    """Return tags of all local cells (owned and ghosts)."""
    return dolfinx.mesh.meshtags(
        mesh, mesh.topology.dim, np.arange(len(values), dtype=np.int32), values.astype(np.int32)
    )


def facet_tags(mesh: Any, facets: np.ndarray, values: np.ndarray) -> Any:
    """Return tags with ``values`` of local ``facets``."""
    order = np.argsort(facets)
    return dolfinx.mesh.meshtags(mesh, mesh.topology.dim - 1, facets[order], values[order].astype(np.int32))
