"""Spaces, forms and vectors of dolfinx from compiled code that is looked up once.

``fem.form`` searches the cache folder at every call (5 ms) and accepts generated kernels only. This module calls the
same compiler, keeps its code in memory by the form's signature, and builds the C++ objects from it. As dolfinx allows,
it may pass addresses of hand-written kernels instead. The cache folder belongs to the project.
"""

import fcntl
import hashlib
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.files import cache_folder

# Integrands of large displacements are no polynomials: quadrature degrees added to those of linear elasticity.
MORE = 2
# Of the C compiler. Python's own have -g, which takes a seventh of its time.
FLAGS = ("-O2", "-g0", "-march=native")
_known: dict[tuple[str, str], compat.Code] = {}
# Code of the kinds of forms, and where it finds its parts.
_made: dict[tuple[Any, ...], tuple[compat.Code, list[list[int]]]] = {}
# The cache folders whose lock this process has.
_locked: set[Path] = set()


def form(expression: Any, kernels: dict[int, int] | None = None) -> Any:
    """Return the form of ``expression``, compiled at its first use; collective.

    ``kernels`` are addresses of cell kernels, by the mark of the cells. They replace the generated kernels in this
    form, which must then have cell integrals only and no functions as coefficients.
    """
    ((domain, tags),) = expression.subdomain_data().items()
    mesh = domain.ufl_cargo()
    code = _code(mesh.comm, expression, expression.signature())
    return compat.make_form(compat.parts_of(expression, code[0]), mesh, tags.get("cell"), code, kernels or {})


def form_like(
    kind: tuple[Any, ...],
    expression: Callable[[], Any],
    mesh: Any,
    marks: Any,
    *parts: Any,
    kernels: dict[int, int] | None = None,
) -> Any:
    """Return the form of an ``expression`` of some ``parts``: spaces, functions and constants; collective.

    On one rank the expression is made once for each ``kind``, with the elements of the parts and of the ``mesh``: UFL
    takes a millisecond for it. The kind must tell all else of it. ``marks`` are the tags of its cells, or None.
    """
    elements = [part.ufl_element() if hasattr(part, "ufl_element") else part.ufl_shape for part in parts]
    domain = mesh.ufl_domain()
    key = form_cache(), kind, repr(domain.ufl_coordinate_element()), marks is None, *map(repr, elements)
    if mesh.comm.size > 1 or key not in _made:
        made = expression()
        code = _code(mesh.comm, made, made.signature())
        found = compat.parts_of(made, code[0])
        _made[key] = code, [[_place(parts, one) for one in some] for some in found]
    code, places = _made[key]
    of = compat.Parts(*([parts[place] for place in some] for some in places))
    return compat.make_form(of, domain.ufl_cargo(), marks, code, kernels or {})


def _place(parts: Sequence[Any], one: Any) -> int:
    """Return the number of ``one`` of the parts."""
    return next(number for number, part in enumerate(parts) if part is one)


def general_form(expression: Any) -> Any:
    """Return a form of any integrals, over facets too; to be kept, since each call searches the cache; collective."""
    comm = expression.ufl_domain().ufl_cargo().comm
    with quiet_compiler(), _sources_stay(comm):
        return compat.general_form(expression, _options())


@dataclass(frozen=True)
class Kernel:
    """A compiled cell kernel: its ``address``, and the ``coefficients`` (UFL) whose dofs it reads, in this order.

    ``code`` keeps it in memory.
    """

    address: int
    coefficients: tuple[Any, ...]
    code: compat.Code


def kernel(comm: MPI.Comm, expression: Any) -> Kernel:
    """Return the kernel of a form with one integral over cells, compiled at its first use; collective.

    The form may have functions of UFL alone.
    """
    code = _code(comm, expression, expression.signature())
    (address,) = compat.kernels_of(code).values()
    return Kernel(address, tuple(compat.coefficients_of(expression, code[0])), code)


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


def quadrature_space(mesh: Any, degree: int, size: int) -> Any:
    """Return the space of vectors of a ``size`` at the quadrature points of a ``degree``; collective."""
    return space(mesh, compat.quadrature_element(mesh, degree, size))


def quadrature_degree(degree: int) -> int:
    """Return the degree of quadrature on curved cells of a space of degree p.

    The map of a quarter-point element varies within the cell: degree 2p gives F up to 0.07 % too low. For p = 2,
    degree 4 has points at which the map is singular.
    """
    return max(6, 2 * degree)


def hyperelastic_degree(degree: int) -> int:
    """Return the degree of quadrature on straight cells at large displacements, whose integrands are no polynomials."""
    return 2 * degree - 2 + MORE


# ---- vectors ----------------------------------------------------------------------------------------


@contextmanager
def vector(space: Any) -> Iterator[PETSc.Vec]:
    """Lend a ghosted zero vector on the dofs of ``space``; collective."""
    index_map, width = space.dofmap.index_map, space.dofmap.index_map_bs
    ghosts = np.asarray(index_map.ghosts, dtype=PETSc.IntType)
    size = width * index_map.size_local, None
    # No block size for scalars: PETSc creates ghosted vectors with blocks of one more slowly.
    blocks = {"bsize": width} if width > 1 else {}
    found = PETSc.Vec().createGhost(ghosts, size, comm=space.mesh.comm, **blocks)
    found.set(0.0)
    try:
        yield found
    finally:
        found.destroy()


def fill(function: Any, values: PETSc.Vec, factor: float = 1.0) -> None:
    """Set the dofs of ``function``, ghosts included, to ``factor`` times ``values``; collective."""
    values.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
    with values.localForm() as local:
        function.x.array[:] = factor * local.array if factor != 1.0 else local.array


def assemble(form: Any, result: PETSc.Vec) -> None:
    """Assemble a linear form into ``result``; collective."""
    with result.localForm() as local:
        local.set(0.0)
    fem_petsc.assemble_vector(result, form)
    add_from_ghosts(result)


def add_from_ghosts(values: PETSc.Vec) -> None:
    """Add the ghost entries of each rank to their owners; collective."""
    values.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)


def global_sum(comm: MPI.Comm, values: FloatArray) -> FloatArray:
    """Return the sum of ``values`` over all ranks, entry by entry; collective."""
    if comm.size == 1:
        return np.array(values)
    total = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), total)
    return total


# ---- the compiler -----------------------------------------------------------------------------------


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Silence the form compiler, which logs to the root logger."""
    before = logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(before)


def _code(comm: MPI.Comm, expression: Any, signature: str) -> compat.Code:
    """Return the compiled code of ``expression``, identified by its ``signature``; collective.

    Either all ranks search the cache folder or none does: what they hold in memory may differ.
    """
    options = _options()
    key = options["cache_dir"], signature
    if comm.size > 1 or key not in _known:
        with quiet_compiler(), _sources_stay(comm):
            found = compat.compile_code(comm, expression, options)
        if comm.size > 1:
            return found
        _known[key] = found
    return _known[key]


def _options() -> dict[str, Any]:
    return {"cache_dir": str(form_cache()), "cffi_extra_compile_args": list(FLAGS), "timeout": 120}


def form_cache() -> Path:
    """Return the cache folder of compiled forms; one for each processor type, since the code is built for it."""
    return _of_forms(cache_folder())


@cache
def _of_forms(folder: Path) -> Path:
    return folder / "forms" / _processor()


@cache
def _processor() -> str:
    """Return a name of the processor's type."""
    try:
        text = Path("/proc/cpuinfo").read_text()
        features = next(line for line in text.splitlines() if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        features = ""
    return hashlib.sha256(features.encode()).hexdigest()[:12]


@contextmanager
def compiling() -> Iterator[None]:
    """Hold the lock of the cache; the system releases it when the process ends, in whatever way.

    A process killed while compiling leaves a source file without its completion mark, and every later run would wait
    for the mark in vain. A mark without its source makes every later run fail. The holder of the lock removes both.
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
        _locked.add(folder)
        try:
            yield
        finally:
            _locked.remove(folder)


@contextmanager
def _sources_stay(comm: MPI.Comm) -> Iterator[None]:
    """Share the lock of the cache on the rank that compiles: nobody then removes the source file that it works on."""
    folder = form_cache()
    if comm.rank or folder in _locked:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        yield
