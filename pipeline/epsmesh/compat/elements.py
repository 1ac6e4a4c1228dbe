"""Finite elements, and the dofs of the spaces of functions of them."""

from functools import cache
from typing import Any

import basix
import dolfinx
import numpy as np
import ufl


def element(mesh: Any, family: str, degree: int, shape: tuple[int, ...] = ()) -> Any:
    """Return an element of scalars, vectors or tensors on the cells of ``mesh``."""
    return _element(mesh.ufl_cell(), family, degree, shape)


@cache
def _element(cell: Any, family: str, degree: int, shape: tuple[int, ...]) -> Any:
    if not hasattr(ufl, "VectorElement"):
        name = cell.cellname() if callable(cell.cellname) else cell.cellname
        return basix.ufl.element(family, name, degree, shape=shape)
    if len(shape) == 2:
        return ufl.TensorElement(family, cell, degree, shape)
    return ufl.VectorElement(family, cell, degree, dim=shape[0]) if shape else ufl.FiniteElement(family, cell, degree)


def quadrature_element(mesh: Any, degree: int, size: int) -> Any:
    """Return the element of vectors of a ``size`` at the quadrature points of a ``degree`` in cells of ``mesh``."""
    cell = mesh.ufl_cell()
    if hasattr(ufl, "VectorElement"):
        return ufl.VectorElement("Quadrature", cell, degree, dim=size, quad_scheme="default")
    name = cell.cellname() if callable(cell.cellname) else cell.cellname
    return basix.ufl.quadrature_element(name, value_shape=(size,), degree=degree, scheme="default")


def mixed_element(parts: list[Any]) -> Any:
    """Return the element that has ``parts`` side by side."""
    return ufl.MixedElement(parts) if hasattr(ufl, "MixedElement") else basix.ufl.mixed_element(parts)


@cache
def reference_element(degree: int) -> Any:
    """Return the element of a scalar Lagrange space on the reference tetrahedron, as dolfinx makes it."""
    return basix.create_element(
        basix.ElementFamily.P, basix.CellType.tetrahedron, degree, basix.LagrangeVariant.gll_warped
    )


def equidistant_nodes(degree: int) -> np.ndarray:
    """Return the nodes (n, 3) of a Lagrange element with equidistant nodes, in the order of dolfinx's."""
    variant = basix.LagrangeVariant.equispaced
    return np.asarray(basix.create_element(basix.ElementFamily.P, basix.CellType.tetrahedron, degree, variant).points)


def vtk_order(nodes: int) -> np.ndarray:
    """Return the positions in dolfinx's order of the ``nodes`` of a tetrahedron in the order of VTK."""
    return np.argsort(dolfinx.cpp.io.perm_vtk(dolfinx.cpp.mesh.CellType.tetrahedron, nodes))


def degree(space: Any) -> int:
    """Return the polynomial degree of a Lagrange space."""
    value = space.ufl_element().degree
    return int(value() if callable(value) else value)


def cell_dofs(space: Any) -> np.ndarray:
    """Return the dofs, in blocks, of each local cell (owned and ghosts), shape (cells, blocks per cell)."""
    dofs = space.dofmap.list
    topology = space.mesh.topology.index_map(space.mesh.topology.dim)
    array = dofs.array if hasattr(dofs, "array") else np.asarray(dofs)
    return array.reshape(topology.size_local + topology.num_ghosts, -1)
