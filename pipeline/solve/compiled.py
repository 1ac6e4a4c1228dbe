"""Forms and spaces of dolfinx made of compiled code that is looked up once; dolfinx itself stays as it is.

``fem.form`` asks the folder of compiled code each time, which takes 5 ms, and knows no kernels but the generated ones.
Here the same compiler is called, what it gives is remembered, and the C++ objects are made of it: of the compiled
form, or, with kernels of our own, of the addresses of kernels, as dolfinx offers it for kernels that users write.
"""

import inspect
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import dolfinx
import numpy as np
from dolfinx import cpp, fem
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import Int32Array
from pipeline.solve.cache import form_cache

# The mark of integrals over all cells.
EVERYWHERE = -1

_Code = tuple[Any, Any, Any]  # what was compiled, its module, its text
_SCALAR = np.dtype(PETSc.ScalarType)
_IS_OLD = "form_compiler_params" in inspect.signature(dolfinx.jit.ffcx_jit).parameters
_OLD_NAMES = {"float32": "float", "float64": "double", "complex128": "double _Complex"}
_known: dict[tuple[str, str], _Code] = {}


def form(expression: Any, name: str = "", kernels: dict[int, int] | None = None) -> Any:
    """Return the form of ``expression``, compiled if it is not yet; collective.

    ``name`` tells it from all others with other code in this process; without one, UFL finds out in a millisecond.
    ``kernels`` are addresses of kernels for integrals over cells, by the mark of the cells: this form uses them in the
    place of the generated ones. It then has integrals over cells alone, and no functions as coefficients.
    """
    ((domain, tags),) = expression.subdomain_data().items()
    mesh = domain.ufl_cargo()
    code = _code(mesh.comm, expression, name)
    make = _form_of_addresses if kernels else _form_of_code
    return make(expression, mesh, _marked(tags.get("cell")), code, kernels or {})


def space(mesh: Any, element: Any) -> Any:
    """Return the space of functions of ``element`` on ``mesh``; collective."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, element)
    (made, dofmap), module, _ = _code(mesh.comm, element, repr(element))
    cpp_element = cpp.fem.FiniteElement(_address(module, made))
    # Debian's mesh holds the C++ one, that of others is one.
    cpp_mesh = getattr(mesh, "_mesh", mesh)
    cpp_dofmap = cpp.fem.create_dofmap(mesh.comm, _address(module, dofmap), mesh.topology, cpp_element)
    return fem.FunctionSpace(mesh, element, cpp.fem.FunctionSpace(cpp_mesh, cpp_element, cpp_dofmap))


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


def _code(comm: MPI.Comm, expression: Any, name: str) -> _Code:
    """Return what ``expression`` is compiled to.

    Ranks that compile together must all look into the folder, or none of them: their memories may differ.
    """
    folder = str(form_cache())
    options = {"cache_dir": folder, "cffi_extra_compile_args": ["-O2", "-march=native"], "timeout": 120}
    key = folder, name or expression.signature()
    if comm.size > 1 or key not in _known:
        with quiet_compiler():
            if _IS_OLD:
                scalar: dict[str, Any] = {"scalar_type": _OLD_NAMES[_SCALAR.name]}
                found = dolfinx.jit.ffcx_jit(comm, expression, form_compiler_params=scalar, jit_params=options)
            else:
                scalar = {"scalar_type": _SCALAR.type}
                found = dolfinx.jit.ffcx_jit(comm, expression, form_compiler_options=scalar, jit_options=options)
        if comm.size > 1:
            return found
        _known[key] = found
    return _known[key]


def _form_of_code(expression: Any, mesh: Any, tags: Any, code: _Code, _: dict[int, int]) -> Any:
    """Make the C++ form as ``fem.form`` does after it has compiled."""
    compiled, module, _ = code
    name = "original_coefficient_position"
    positions = getattr(compiled, name if _IS_OLD else name + "s")
    functions = expression.coefficients()
    coefficients = [functions[positions[i]]._cpp_object for i in range(compiled.num_coefficients)]
    address, spaces, constants = _address(module, compiled), _spaces(expression), _constants(expression)
    if _IS_OLD:
        marked = {fem.IntegralType.cell: tags}
        return _wrapped(code, address, spaces, coefficients, constants, marked, mesh)
    cells = {fem.IntegralType.cell: [(m, _cells(mesh, tags, m)) for m in sorted(_kernels(code)) if m != EVERYWHERE]}
    maps = _entity_maps()
    forms = [address] if isinstance(maps, list) else address  # since 0.10 one for each kind of cells
    return _wrapped(code, forms, spaces, coefficients, constants, cells, maps, mesh)


def _form_of_addresses(expression: Any, mesh: Any, tags: Any, code: _Code, kernels: dict[int, int]) -> Any:
    """Make the C++ form of kernels: those of ``kernels``, and the generated ones for other marks."""
    chosen = _kernels(code) | {mark: kernel for mark, kernel in kernels.items() if mark in _kernels(code)}
    spaces, constants = _spaces(expression), _constants(expression)
    if _IS_OLD:
        integrals = {fem.IntegralType.cell: (list(chosen.items()), tags)}
        return _wrapped(code, spaces, integrals, [], constants, False, mesh)
    none = np.array([], dtype=np.int8)
    parts = [(mark, kernel, _cells(mesh, tags, mark), none) for mark, kernel in chosen.items()]
    return _wrapped(code, spaces, {fem.IntegralType.cell: parts}, [], constants, False, _entity_maps(), mesh)


def _wrapped(code: _Code, *arguments: Any) -> Any:
    """Return the C++ form made of ``arguments``, in dolfinx's own class for it, which keeps the code."""
    compiled, module, text = code
    kind = getattr(cpp.fem, f"Form_{_SCALAR.name}")
    if not _IS_OLD:
        return fem.Form(kind(*arguments), compiled, text, module)
    made = type("Form", (fem.FormMetaClass, kind), {"__init__": kind.__init__})(*arguments)
    made._ufcx_form, made._code = compiled, text
    return made


def _kernels(code: _Code) -> dict[int, int]:
    """Return the addresses of the generated kernels for cells, by mark."""
    compiled, module, _ = code
    if hasattr(compiled, "form_integrals"):  # since 0.7; integrals over cells come first
        count, marks, integrals = compiled.form_integral_offsets[1], compiled.form_integral_ids, compiled.form_integrals
    else:
        count, marks, integrals = compiled.num_integrals(0), compiled.integral_ids(0), compiled.integrals(0)
    kernels = [getattr(integrals[i], f"tabulate_tensor_{_SCALAR.name}") for i in range(count)]
    return {marks[i]: int(module.ffi.cast("uintptr_t", kernel)) for i, kernel in enumerate(kernels)}


def _cells(mesh: Any, tags: Any, mark: int) -> Int32Array:
    """Return the cells of a mark that this rank owns, ascending."""
    owned = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    return owned if mark == EVERYWHERE else np.intersect1d(owned, tags.find(mark)).astype(np.int32)


def _marked(tags: Any) -> Any:
    """Return the tags of cells of an expression: UFL has one for all of a kind, later versions one for each."""
    return next((found for found in tags if found is not None), None) if isinstance(tags, list) else tags


def _spaces(expression: Any) -> list[Any]:
    return [argument.ufl_function_space()._cpp_object for argument in expression.arguments()]


def _constants(expression: Any) -> list[Any]:
    return [constant._cpp_object for constant in expression.constants()]


def _entity_maps() -> Any:
    """Return no maps between meshes: since 0.10 those are in a list."""
    return [] if hasattr(cpp.mesh, "EntityMap") else {}


def _address(module: Any, compiled: Any) -> Any:
    return module.ffi.cast("uintptr_t", module.ffi.addressof(compiled))
