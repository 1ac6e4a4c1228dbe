"""The one place that knows that versions of dolfinx and gmsh differ (0.5.2 to 0.10; 4.8 to 4.13).

Everything is decided by what a library offers, never by its version number.
"""

import ctypes
import inspect
import logging
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import basix
import cffi
import dolfinx
import gmsh
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

_JIT = {
    new if new in inspect.signature(fem.form).parameters else old: key
    for key, new, old in (
        ("jit", "jit_options", "jit_params"),
        ("ffcx", "form_compiler_options", "form_compiler_params"),
    )
}
_PETSC = ctypes.CDLL(PETSc.__file__)  # petsc4py has no way to the blocks of a matrix
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


def _vector_element(cell: str, degree: int, dim: int) -> Any:
    if hasattr(ufl, "VectorElement"):
        return ufl.VectorElement("Lagrange", cell, degree, dim=dim)
    return basix.ufl.element("Lagrange", cell, degree, shape=(dim,))


def _coordinate_element(cell: str, order: int, dim: int) -> Any:
    if hasattr(ufl, "VectorElement"):
        # ffcx 0.5 writes this variant into the element when it first compiles a form on the mesh, which changes the
        # name under which every later form on it is looked up in the cache.
        return ufl.VectorElement("Lagrange", cell, order, dim=dim, variant="equispaced")
    return _vector_element(cell, order, dim)


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


def vector_space(mesh: Any, degree: int) -> Any:
    """Return the continuous vector Lagrange space of ``degree`` on ``mesh``."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("Lagrange", degree, (mesh.geometry.dim,)))
    return fem.VectorFunctionSpace(mesh, ("Lagrange", degree))


def scalar_space(mesh: Any, degree: int) -> Any:
    """Return the continuous scalar Lagrange space of ``degree`` on ``mesh``."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("Lagrange", degree))
    return fem.FunctionSpace(mesh, ("Lagrange", degree))


def taylor_hood_space(mesh: Any, degree: int) -> Any:
    """Return the mixed space of vectors of ``degree`` and of scalars one degree lower, both continuous."""
    cell = mesh.ufl_cell().cellname() if callable(mesh.ufl_cell().cellname) else mesh.ufl_cell().cellname
    vector = _vector_element(cell, degree, mesh.geometry.dim)
    if hasattr(ufl, "MixedElement"):
        scalar = ufl.FiniteElement("Lagrange", cell, degree - 1)
        return fem.FunctionSpace(mesh, ufl.MixedElement([vector, scalar]))
    scalar = basix.ufl.element("Lagrange", cell, degree - 1)
    return fem.functionspace(mesh, basix.ufl.mixed_element([vector, scalar]))


def cellwise_vector_space(mesh: Any, size: int) -> Any:
    """Return the space of vectors of ``size`` components constant on each cell."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("DG", 0, (size,)))
    return fem.VectorFunctionSpace(mesh, ("DG", 0), dim=size)


def reference_element(degree: int) -> Any:
    """Return the element of a scalar Lagrange space on the reference tetrahedron, as dolfinx makes it."""
    return basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, degree, basix.LagrangeVariant.gll_warped
    )


def degree(space: Any) -> int:
    """Return the polynomial degree of a Lagrange space."""
    value = space.ufl_element().degree
    return int(value() if callable(value) else value)


def cellwise_tensor_space(mesh: Any) -> Any:
    """Return the space of 3 × 3 tensors constant on each cell."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, ("DG", 0, (3, 3)))
    return fem.TensorFunctionSpace(mesh, ("DG", 0))


_jit = dolfinx.jit.ffcx_jit
_compiled: dict[str, Any] = {}
_kernels: dict[int, int] = {}
_name = [""]
_FFI = cffi.FFI()


def _remember(comm: MPI.Comm, expression: Any, *args: Any, **options: Any) -> Any:
    """Compile as dolfinx does, and look only once a process into the folder of what is compiled: it takes 5 ms.

    Ranks that compile together must all look, or none of them: their memories may differ.
    """
    if comm.size > 1:
        return _jit(comm, expression, *args, **options)
    known = (_name[-1] or expression.signature()) if isinstance(expression, ufl.Form) else repr(expression)
    key = f"{type(expression).__name__} {known} {args} {options}"
    if key not in _compiled:
        _compiled[key] = _jit(comm, expression, *args, **options)
    return _compiled[key]


def _compile(comm: MPI.Comm, expression: Any, *args: Any, **options: Any) -> Any:
    """Compile, and put the kernels that are asked for in the place of the generated ones."""
    found = _remember(comm, expression, *args, **options)
    if _kernels and isinstance(expression, ufl.Form):
        of = found[0]
        if hasattr(of, "form_integrals"):  # since 0.7; integrals over cells come first
            count, marks, integrals = of.form_integral_offsets[1], of.form_integral_ids, of.form_integrals
        else:
            count, marks, integrals = of.num_integrals(0), of.integral_ids(0), of.integrals(0)
        for i in range(count):
            if marks[i] in _kernels:
                integrals[i].tabulate_tensor_float64 = _FFI.cast("void*", _kernels[marks[i]])
    return found


dolfinx.jit.ffcx_jit = _compile


def form(expression: Any, cache: str, name: str = "", kernels: dict[int, int] | None = None) -> Any:
    """Compile ``expression``, with the generated code in the folder ``cache``; collective.

    ``name`` tells it from all others with other code in this process; without one, UFL finds out in a millisecond.
    ``kernels`` are addresses of kernels for integrals over cells, by the mark of the cells (-1: all): they are used
    in place of the generated ones, now and whenever this process compiles the same expression again.
    """
    jit = {"cache_dir": cache, "cffi_extra_compile_args": ["-O2", "-march=native"], "timeout": 120}
    options = {"jit": jit, "ffcx": {}}
    with quiet_compiler(), _using(kernels or {}, name):
        return fem.form(expression, **{name: options[key] for name, key in _JIT.items()})


@contextmanager
def _using(kernels: dict[int, int], name: str) -> Iterator[None]:
    _kernels.update(kernels)
    _name.append(name)
    try:
        yield
    finally:
        _kernels.clear()
        _name.pop()


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Keep the compiler's own words, which go to the root logger, from those who wait for a force."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


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


def sparse_matrix(offsets: np.ndarray, columns: np.ndarray, block: int) -> PETSc.Mat:
    """Return a square matrix of zeros, of this process alone, in sparse rows whose columns ascend.

    Of type seqbaij if rows and columns are of blocks of ``block``, else (1) seqaij, for vectors of three components.
    """
    count, size, indices = np.diff(offsets), block * (len(offsets) - 1), columns.astype(PETSc.IntType, copy=False)
    create, kind = (PETSc.Mat().createBAIJ, "SeqBAIJ") if block > 1 else (PETSc.Mat().createAIJ, "SeqAIJ")
    matrix = create(((size, None), (size, None)), 3, nnz=count.astype(PETSc.IntType), comm=MPI.COMM_SELF)
    fill = getattr(_PETSC, f"Mat{kind}SetColumnIndices")
    if fill(ctypes.c_void_p(matrix.handle), ctypes.c_void_p(indices.ctypes.data)):
        raise RuntimeError("PETSc does not take the pattern of a matrix")
    matrix.assemble()
    matrix.zeroEntries()
    return matrix


@contextmanager
def entries(matrix: PETSc.Mat, count: int) -> Iterator[np.ndarray]:
    """Lend the ``count`` entries of a matrix, seqaij or seqbaij, there block by block by columns, to write to."""
    kind = {"seqaij": "SeqAIJ", "seqbaij": "SeqBAIJ"}[matrix.getType()]
    handle, values = ctypes.c_void_p(matrix.handle), ctypes.POINTER(ctypes.c_double)()
    if getattr(_PETSC, f"Mat{kind}GetArray")(handle, ctypes.byref(values)):
        raise RuntimeError("PETSc does not lend the entries of its matrix")
    try:
        yield np.ctypeslib.as_array(values, (count,))
    finally:
        getattr(_PETSC, f"Mat{kind}RestoreArray")(handle, ctypes.byref(values))
        matrix.assemble()  # what was made of the values before is void


def versions() -> dict[str, str]:
    """Return the versions of the libraries that a force depends on."""
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    return {"dolfinx": str(dolfinx.__version__), "petsc": petsc, "gmsh": str(gmsh.__version__)}
