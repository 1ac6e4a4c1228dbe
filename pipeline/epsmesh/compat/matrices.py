"""Conditions on dofs, matrices with them, and vectors with ghosts."""

import inspect
from typing import Any

import numpy as np
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

_DIAGONAL = "diag" if "diag" in inspect.signature(fem_petsc.assemble_matrix).parameters else "diagonal"

_ADD = (la.InsertMode if hasattr(la, "InsertMode") else la.ScatterMode).add


def dirichletbc(value: Any, dofs: np.ndarray, space: Any) -> Any:
    """Return a condition on ``dofs`` of ``space``.

    dolfinx 0.5 finds out by an error, which takes as long as a small solve, that it wants the C++ object.
    """
    return fem.dirichletbc(value, dofs, space._cpp_object if hasattr(fem.bcs, "DirichletBCMetaClass") else space)


def assemble_matrix(form: Any, bcs: list[Any], diagonal: float, into: PETSc.Mat | None = None) -> PETSc.Mat:
    """Assemble a matrix with the rows and columns of ``bcs`` replaced by ``diagonal``; collective.

    ``into`` is a matrix of the same form, whose values go.
    """
    matrix = fem_petsc.create_matrix(form, "aij") if into is None else into
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


def ghosted_vector(index_map: Any, size: int, kind: np.dtype[Any]) -> Any:
    """Return dolfinx's vector of ``size`` numbers of a ``kind`` for each point, owned ones and ghosts; collective."""
    return la.vector(index_map, size, dtype=kind)


def add_from_ghosts(vector: Any) -> None:
    """Add what each rank has at ghosts of dolfinx's ``vector`` to their owners; collective."""
    vector.scatter_reverse(_ADD)
