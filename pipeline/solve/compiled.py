"""Forms and spaces of dolfinx made of compiled code that is looked up once; dolfinx itself stays as it is.

``fem.form`` asks the folder of compiled code each time, which takes 5 ms, and knows no kernels but the generated ones.
Here the same compiler is called, what it gives is remembered, and the C++ objects are made of it: of the compiled
form, or, with kernels of our own, of the addresses of kernels, as dolfinx offers it for kernels that users write.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mpi4py import MPI

from pipeline import compat
from pipeline.solve.cache import form_cache

_known: dict[tuple[str, str], compat.Code] = {}


def form(expression: Any, name: str = "", kernels: dict[int, int] | None = None) -> Any:
    """Return the form of ``expression``, compiled if it is not yet; collective.

    ``name`` tells it from all others with other code in this process; without one, UFL finds out in a millisecond.
    ``kernels`` are addresses of kernels for integrals over cells, by the mark of the cells: this form uses them in the
    place of the generated ones. It then has integrals over cells alone, and no functions as coefficients.
    """
    ((domain, tags),) = expression.subdomain_data().items()
    mesh = domain.ufl_cargo()
    code = _code(mesh.comm, expression, name)
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


def _code(comm: MPI.Comm, expression: Any, name: str) -> compat.Code:
    """Return what ``expression`` is compiled to.

    Ranks that compile together must all look into the folder, or none of them: their memories may differ.
    """
    folder = str(form_cache())
    options = {"cache_dir": folder, "cffi_extra_compile_args": ["-O2", "-march=native"], "timeout": 120}
    key = folder, name or expression.signature()
    if comm.size > 1 or key not in _known:
        with quiet_compiler():
            found = compat.compile_code(comm, expression, options)
        if comm.size > 1:
            return found
        _known[key] = found
    return _known[key]
