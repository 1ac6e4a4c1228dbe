"""The one place that knows that versions of dolfinx and gmsh differ (0.5.2 to 0.10; 4.8 to 4.13).

Everything is decided by what a library offers, never by its version number.
"""

import inspect
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import basix
import dolfinx
import gmsh
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

_DIAGONAL = "diag" if "diag" in inspect.signature(fem_petsc.assemble_matrix).parameters else "diagonal"


@contextmanager
def gmsh_session() -> Iterator[None]:
    """Start and end gmsh, leaving Python's handling of Ctrl-C as it was.

    gmsh 4.8 changes it when imported and when finalized, later versions when initialized.
    """
    handler = signal.getsignal(signal.SIGINT)
    gmsh.initialize([""], readConfigFiles=False)
    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        gmsh.finalize()
        signal.signal(signal.SIGINT, handler)


def _coordinate_element(cell: str, order: int, dim: int) -> Any:
    if hasattr(ufl, "VectorElement"):
        # ffcx 0.5 writes this variant into the element when it first compiles a form on the mesh, which changes the
        # name under which every later form on it is looked up in the cache.
        return ufl.VectorElement("Lagrange", cell, order, dim=dim, variant="equispaced")
    return basix.ufl.element("Lagrange", cell, order, shape=(dim,))


def create_mesh(comm: MPI.Comm, cells: np.ndarray, points: np.ndarray, order: int) -> Any:
    """Create a distributed mesh of tetrahedra, or in the plane of triangles; collective, arrays only on rank 0."""
    dim = comm.bcast(points.shape[1] if comm.rank == 0 else 0)
    domain = ufl.Mesh(_coordinate_element("tetrahedron" if dim == 3 else "triangle", order, dim))
    names = inspect.signature(dolfinx.mesh.create_mesh).parameters
    keyword = "domain" if "domain" in names else "e"
    return dolfinx.mesh.create_mesh(comm, cells=cells, x=points, **{keyword: domain})


def geometry_dofs(mesh: Any) -> np.ndarray:
    """Return the geometry nodes of each local cell (owned and ghosts), shape (cells, nodes per cell)."""
    dofmap = mesh.geometry.dofmap if hasattr(mesh.geometry, "dofmap") else mesh.geometry.dofmaps[0]
    array = dofmap.array if hasattr(dofmap, "array") else np.asarray(dofmap)
    topology = mesh.topology.index_map(mesh.topology.dim)
    return array.reshape(topology.size_local + topology.num_ghosts, -1)


def cell_dofs(space: Any) -> np.ndarray:
    """Return the dofs, in blocks, of each local cell (owned and ghosts), shape (cells, blocks per cell)."""
    dofs = space.dofmap.list
    topology = space.mesh.topology.index_map(space.mesh.topology.dim)
    array = dofs.array if hasattr(dofs, "array") else np.asarray(dofs)
    return array.reshape(topology.size_local + topology.num_ghosts, -1)


def original_cells(mesh: Any) -> np.ndarray:
    """Return, for each local cell, its number in the arrays that the mesh was made of."""
    return np.asarray(mesh.topology.original_cell_index, dtype=np.int64)


def cell_tags(mesh: Any, values: np.ndarray) -> Any:
    """Return tags of all local cells (owned and ghosts)."""
    return dolfinx.mesh.meshtags(
        mesh, mesh.topology.dim, np.arange(len(values), dtype=np.int32), values.astype(np.int32)
    )


def element(mesh: Any, family: str, degree: int, shape: tuple[int, ...] = ()) -> Any:
    """Return an element of scalars, vectors or tensors on the cells of ``mesh``."""
    cell = mesh.ufl_cell()
    if not hasattr(ufl, "VectorElement"):
        name = cell.cellname() if callable(cell.cellname) else cell.cellname
        return basix.ufl.element(family, name, degree, shape=shape)
    if len(shape) == 2:
        return ufl.TensorElement(family, cell, degree, shape)
    return ufl.VectorElement(family, cell, degree, dim=shape[0]) if shape else ufl.FiniteElement(family, cell, degree)


def mixed_element(parts: list[Any]) -> Any:
    """Return the element that has ``parts`` side by side."""
    return ufl.MixedElement(parts) if hasattr(ufl, "MixedElement") else basix.ufl.mixed_element(parts)


def reference_element(degree: int) -> Any:
    """Return the element of a scalar Lagrange space on the reference tetrahedron, as dolfinx makes it."""
    return basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, degree, basix.LagrangeVariant.gll_warped
    )


def degree(space: Any) -> int:
    """Return the polynomial degree of a Lagrange space."""
    value = space.ufl_element().degree
    return int(value() if callable(value) else value)


def dirichletbc(value: Any, dofs: np.ndarray, space: Any) -> Any:
    """Return a condition on ``dofs`` of ``space``.

    dolfinx 0.5 finds out by an error, which takes as long as a small solve, that it wants the C++ object.
    """
    return fem.dirichletbc(value, dofs, space._cpp_object if hasattr(fem.bcs, "DirichletBCMetaClass") else space)


def assemble_matrix(
    form: Any, bcs: list[Any], diagonal: float, mat_type: str, into: PETSc.Mat | None = None
) -> PETSc.Mat:
    """Assemble a matrix with the rows and columns of ``bcs`` replaced by ``diagonal``; collective.

    ``into`` is a matrix of the same form, of ``mat_type``, whose values go.
    """
    matrix = fem_petsc.create_matrix(form, mat_type) if into is None else into
    try:
        matrix.zeroEntries()
        add_matrix(matrix, form, bcs, diagonal)
    except BaseException:
        matrix.destroy()
        raise
    return matrix


def add_matrix(matrix: PETSc.Mat, form: Any, bcs: list[Any], diagonal: float) -> None:
    """Add ``form`` to a matrix, but for the rows and columns of ``bcs``, whose diagonal is set; collective."""
    fem_petsc.assemble_matrix(matrix, form, bcs=bcs, **{_DIAGONAL: diagonal})
    matrix.assemble()


def versions() -> dict[str, str]:
    """Return the versions of the libraries that a force depends on."""
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    return {"dolfinx": str(dolfinx.__version__), "petsc": petsc, "gmsh": str(gmsh.__version__)}
