"""Forms and spaces of dolfinx made of compiled code that is looked up once; dolfinx itself stays as it is.

``fem.form`` asks the folder of compiled code each time, which takes 5 ms, and knows no kernels but the generated ones.
Here the same compiler is called, what it gives is remembered by the form's signature, and the C++ objects are made of
it: of the compiled form, or, with kernels of our own, of the addresses of kernels, as dolfinx offers it for kernels
that users write. The folder of compiled code is the project's own.
"""

import fcntl
import hashlib
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI

from pipeline import compat
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
