"""Compiled code, and the forms and spaces that dolfinx makes of it.

Versions differ in how they name the options of their compiler, what they ask of a form, and who marks its cells.
"""

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import dolfinx
import numpy as np
from dolfinx import cpp, fem
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import Int32Array

# The mark of integrals over all cells.
EVERYWHERE = -1
# Of the messages that find out who has which ghosts.
_TAG = 1701

Code = tuple[Any, Any, Any]  # what was compiled, its module, its text
_SCALAR = np.dtype(PETSc.ScalarType)
_IS_OLD = "form_compiler_params" in inspect.signature(dolfinx.jit.ffcx_jit).parameters
_OLD_NAMES = {"float32": "float", "float64": "double", "complex128": "double _Complex"}


def compile_code(comm: MPI.Comm, expression: Any, options: dict[str, Any]) -> Code:
    """Compile a form or an element, with ``options`` for where and how; collective."""
    if _IS_OLD:
        scalar: dict[str, Any] = {"scalar_type": _OLD_NAMES[_SCALAR.name]}
        return dolfinx.jit.ffcx_jit(comm, expression, form_compiler_params=scalar, jit_params=options)
    scalar = {"scalar_type": _SCALAR.type}
    return dolfinx.jit.ffcx_jit(comm, expression, form_compiler_options=scalar, jit_options=options)


class Parts(NamedTuple):
    """What the code of a form acts on, in the order in which the code has it: objects of UFL, which dolfinx's are."""

    spaces: list[Any]
    functions: list[Any]
    constants: list[Any]


def parts_of(expression: Any, compiled: Any) -> Parts:
    """Return the parts of an expression that was ``compiled``."""
    spaces = [argument.ufl_function_space() for argument in expression.arguments()]
    return Parts(spaces, coefficients_of(expression, compiled), list(expression.constants()))


def make_form(parts: Parts, mesh: Any, tags: Any, code: Code, kernels: dict[int, int]) -> Any:
    """Return the form of compiled ``code`` with its ``parts``; ``tags`` are those of the cells, as UFL has them.

    ``kernels`` are addresses of kernels for integrals over cells, by the mark of the cells, instead of the compiled.
    """
    make = _form_of_addresses if kernels else _form_of_code
    parts = Parts(*([one._cpp_object for one in some] for some in parts))
    return make(parts, mesh, _marked(tags), code, kernels)


def general_form(expression: Any, options: dict[str, Any]) -> Any:
    """Compile a form of any integrals by dolfinx's own way, which searches the cache each time; collective."""
    return fem.form(expression, **{"jit_params" if _IS_OLD else "jit_options": options})


def function_space(mesh: Any, element: Any, code: Callable[[], Code]) -> Any:
    """Return the space of functions of ``element``; ``code`` is how it is compiled, where dolfinx asks for that."""
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, element)
    (made, dofmap), module, _ = code()
    cpp_element = _element(int(_address(module, made)))
    # Debian's mesh holds the C++ one, that of others is one.
    cpp_mesh = getattr(mesh, "_mesh", mesh)
    cpp_dofmap = cpp.fem.create_dofmap(mesh.comm, _address(module, dofmap), mesh.topology, cpp_element)
    return fem.FunctionSpace(mesh, element, cpp.fem.FunctionSpace(cpp_mesh, cpp_element, cpp_dofmap))


@cache
def _element(address: int) -> Any:
    """Return the element of compiled code, which stays loaded; dolfinx takes 0.8 ms to make one."""
    return cpp.fem.FiniteElement(address)


def renumbered_space(space: Any, dofs: np.ndarray, owned: int, ghosts: np.ndarray, owners: np.ndarray) -> Any:
    """Return a space of scalars like ``space``, but with other ``dofs`` (cells, dofs a cell), local numbers.

    This rank owns the first ``owned``; ``ghosts`` are the global numbers of the others, which ``owners`` own.
    """
    mesh = space.mesh
    tag = (_TAG,) if "tag" in str(cpp.common.IndexMap.__init__.__doc__) else ()  # since 0.11
    index_map = cpp.common.IndexMap(mesh.comm, owned, ghosts.astype(np.int64), owners.astype(np.int32), *tag)
    offsets = np.arange(0, dofs.size + 1, dofs.shape[1], dtype=np.int32)
    rows = cpp.graph.AdjacencyList_int32(np.ascontiguousarray(dofs.reshape(-1), dtype=np.int32), offsets)
    dofmap = cpp.fem.DofMap(space.dofmap.dof_layout, index_map, 1, rows, 1)
    inner = space._cpp_object
    shape = [inner.value_shape] if hasattr(inner, "value_shape") else []  # of dolfinx 0.8 and 0.9
    made = type(inner)(inner.mesh, inner.element, dofmap, *shape)
    return fem.FunctionSpace(mesh, space.ufl_element(), made)


def _form_of_code(parts: Parts, mesh: Any, tags: Any, code: Code, _: dict[int, int]) -> Any:
    """Make the C++ form as ``fem.form`` does after it has compiled."""
    compiled, module, _ = code
    (spaces, coefficients, constants), address = parts, _address(module, compiled)
    if _IS_OLD:
        marked = {fem.IntegralType.cell: tags}
        return _wrapped(code, address, spaces, coefficients, constants, marked, mesh)
    cells = {fem.IntegralType.cell: [(m, _cells(mesh, tags, m)) for m in sorted(kernels_of(code)) if m != EVERYWHERE]}
    maps = _entity_maps()
    forms = [address] if isinstance(maps, list) else address  # since 0.10 one for each kind of cells
    return _wrapped(code, forms, spaces, coefficients, constants, cells, maps, mesh)


def _form_of_addresses(parts: Parts, mesh: Any, tags: Any, code: Code, kernels: dict[int, int]) -> Any:
    """Make the C++ form of kernels: those of ``kernels``, and the generated ones for other marks."""
    generated = kernels_of(code)
    chosen = generated | {mark: kernel for mark, kernel in kernels.items() if mark in generated}
    spaces, coefficients, constants = parts
    if _IS_OLD:
        marked = {fem.IntegralType.cell: (list(chosen.items()), tags)}
        return _wrapped(code, spaces, marked, coefficients, constants, False, mesh)
    used = np.arange(len(coefficients), dtype=np.int8)
    # Since 0.10 integrals are numbered one after the other, whatever their marks.
    numbers = range(len(chosen)) if _has_entity_maps() else chosen
    found = [(n, kernel, _cells(mesh, tags, m), used) for n, (m, kernel) in zip(numbers, chosen.items(), strict=True)]
    integrals = {fem.IntegralType.cell: found}
    return _wrapped(code, spaces, integrals, coefficients, constants, False, _entity_maps(), mesh)


def _wrapped(code: Code, *arguments: Any) -> Any:
    """Return the C++ form made of ``arguments``, in dolfinx's own class for it, which keeps the code."""
    compiled, module, text = code
    if not _IS_OLD:
        return fem.Form(_form_class()(*arguments), compiled, text, module)
    made = _form_class()(*arguments)
    made._ufcx_form, made._code = compiled, text
    return made


@cache
def _form_class() -> Any:
    """Return the class of the C++ form, in old versions one that holds its code, too."""
    kind = getattr(cpp.fem, f"Form_{_SCALAR.name}")
    return type("Form", (fem.FormMetaClass, kind), {"__init__": kind.__init__}) if _IS_OLD else kind


def kernels_of(code: Code) -> dict[int, int]:
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


def coefficients_of(expression: Any, compiled: Any) -> list[Any]:
    """Return the functions (UFL) of an expression, in the order in which its compiled code has them."""
    name = "original_coefficient_position"
    positions = getattr(compiled, name if _IS_OLD else name + "s")
    functions = expression.coefficients()
    return [functions[positions[i]] for i in range(compiled.num_coefficients)]


def _entity_maps() -> Any:
    """Return no maps between meshes: since 0.10 those are in a list."""
    return [] if _has_entity_maps() else {}


def _has_entity_maps() -> bool:
    return hasattr(cpp.mesh, "EntityMap")


def _address(module: Any, compiled: Any) -> Any:
    return module.ffi.cast("uintptr_t", module.ffi.addressof(compiled))
