"""Spaces, forms and vectors of dolfinx, made of compiled code that is looked up once.

``fem.form`` looks into the folder of compiled code at every call (5 ms) and takes generated kernels only. Here the same
compiler is called, its code is kept by the form's signature, and the C++ objects are made of it, or of the addresses of
our own kernels, as dolfinx allows. The folder of compiled code is the project's own.
"""

import fcntl
import hashlib
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.files import cache_folder

_known: dict[tuple[str, str], compat.Code] = {}


def form(expression: Any, kernels: dict[int, int] | None = None) -> Any:
    """Return the form of ``expression``, compiled if it is not yet; collective.

    ``kernels`` are addresses of kernels for integrals over cells, by the mark of the cells: this form uses them in the
    place of the generated ones. It then has integrals over cells alone, and no functions as coefficients.
    """
    ((domain, tags),) = expression.subdomain_data().items()
    mesh = domain.ufl_cargo()
    code = _code(mesh.comm, expression, expression.signature())
    return compat.make_form(expression, mesh, tags.get("cell"), code, kernels or {})


def space(mesh: Any, element: Any) -> Any:
    """Return the space of functions of ``element`` on ``mesh``; collective."""
    return compat.function_space(mesh, element, lambda: _code(mesh.comm, element, repr(element)))


def vector_space(mesh: Any, degree: int) -> Any:
    """Return the continuous vector Lagrange space of ``degree`` on ``mesh``; collective."""
    return space(mesh, compat.element(mesh, "Lagrange", degree, (mesh.geometry.dim,)))


def scalar_space(mesh: Any, degree: int) -> Any:
    """Return the continuous scalar Lagrange space of ``degree`` on ``mesh``; collective."""
    return space(mesh, compat.element(mesh, "Lagrange", degree))


def taylor_hood_space(mesh: Any, degree: int) -> Any:
    """Return the mixed space of vectors of ``degree`` and of scalars one degree lower, both continuous; collective."""
    vector = compat.element(mesh, "Lagrange", degree, (mesh.geometry.dim,))
    return space(mesh, compat.mixed_element([vector, compat.element(mesh, "Lagrange", degree - 1)]))


def cellwise_space(mesh: Any, shape: tuple[int, ...]) -> Any:
    """Return the space of vectors or tensors of ``shape`` that are constant on each cell; collective."""
    return space(mesh, compat.element(mesh, "DG", 0, shape))


def quadrature_degree(degree: int) -> int:
    """Return up to which degree polynomials are integrated on curved cells of a space of ``degree``.

    The map of a quarter-point element varies within the cell, and 2p reads F up to 0.07 % low there; at p = 2, degree 4
    has points at which the map is singular.
    """
    return max(6, 2 * degree)


# ---- vectors ----------------------------------------------------------------------------------------


@contextmanager
def vector(space: Any) -> Iterator[PETSc.Vec]:
    """Lend a ghosted vector of zeros on the dofs of ``space``; collective."""
    index_map, width = space.dofmap.index_map, space.dofmap.index_map_bs
    ghosts = np.asarray(index_map.ghosts, dtype=PETSc.IntType)
    size = width * index_map.size_local, None
    # Without blocks for scalars: PETSc's ghosted vectors of blocks of one are slower to make.
    blocks = {"bsize": width} if width > 1 else {}
    found = PETSc.Vec().createGhost(ghosts, size, comm=space.mesh.comm, **blocks)
    found.set(0.0)
    try:
        yield found
    finally:
        found.destroy()


def fill(function: Any, values: PETSc.Vec, factor: float = 1.0) -> None:
    """Make ``factor`` times ``values`` the dofs of ``function``, ghosts included; collective."""
    values.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    with values.localForm() as local:
        function.x.array[:] = factor * local.array if factor != 1.0 else local.array


def assemble(form: Any, result: PETSc.Vec) -> None:
    """Write the vector of a linear form into ``result``; collective."""
    with result.localForm() as local:
        local.set(0.0)
    fem_petsc.assemble_vector(result, form)
    add_from_ghosts(result)


def add_from_ghosts(values: PETSc.Vec) -> None:
    """Add what each rank has put on ghosts to their owners; collective."""
    values.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)


def global_sum(comm: MPI.Comm, values: FloatArray) -> FloatArray:
    """Return the sum of ``values`` over all ranks, entry by entry; collective."""
    total = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), total)
    return total


# ---- the compiler -----------------------------------------------------------------------------------


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Keep the compiler's own words, which go to the root logger, from those who wait for a force."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


def _code(comm: MPI.Comm, expression: Any, signature: str) -> compat.Code:
    """Return what ``expression`` is compiled to; ``signature`` tells it from all others.

    Ranks that compile together must all look into the folder, or none of them: their memories may differ.
    """
    folder = str(form_cache())
    options = {"cache_dir": folder, "cffi_extra_compile_args": ["-O2", "-march=native"], "timeout": 120}
    key = folder, signature
    if comm.size > 1 or key not in _known:
        with quiet_compiler():
            found = compat.compile_code(comm, expression, options)
        if comm.size > 1:
            return found
        _known[key] = found
    return _known[key]


def form_cache() -> Path:
    """Return the folder of compiled forms: one for each kind of processor, since code is made for the machine."""
    try:
        text = Path("/proc/cpuinfo").read_text()
        features = next(line for line in text.splitlines() if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        features = ""
    return cache_folder() / "forms" / hashlib.sha256(features.encode()).hexdigest()[:12]


@contextmanager
def compiling() -> Iterator[None]:
    """Hold the cache's lock, which the system releases when its holder dies, however it dies.

    A process killed while compiling leaves a source file without its mark of completion, for which every later run
    would wait in vain; a mark without its source fails every later run. Whoever holds the lock may remove such orphans.
    """
    folder = form_cache()
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for source in folder.glob("*.c"):
            if not source.with_suffix(".c.cached").exists():
                source.unlink()
        for mark in folder.glob("*.c.cached"):
            if not mark.with_suffix("").exists():
                mark.unlink()
        yield
