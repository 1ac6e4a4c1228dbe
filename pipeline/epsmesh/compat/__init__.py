"""The one place that knows that versions of dolfinx and gmsh differ (0.5.2 to 0.11; 4.8 to 4.15).

Everything is decided by what a library offers, never by its version number.
"""

from epsmesh import mpi  # noqa: I001, F401 (first of all)
import dolfinx
import gmsh
from petsc4py import PETSc

from epsmesh.compat.code import (
    EVERYWHERE,
    Code,
    Parts,
    coefficients_of,
    compile_code,
    function_space,
    general_form,
    kernels_of,
    make_form,
    parts_of,
    renumbered_space,
)
from epsmesh.compat.elements import (
    cell_dofs,
    degree,
    element,
    equidistant_nodes,
    mixed_element,
    quadrature_element,
    reference_element,
    vtk_order,
)
from epsmesh.compat.matrices import add_from_ghosts, add_matrix, assemble_matrix, dirichletbc, ghosted_vector
from epsmesh.compat.meshes import (
    cell_tags,
    create_mesh,
    facet_tags,
    geometry_dofs,
    gmsh_session,
    inside_face,
    original_cells,
    partition,
    triangle_nodes,
)

__all__ = [
    "EVERYWHERE",
    "Code",
    "Parts",
    "add_from_ghosts",
    "add_matrix",
    "assemble_matrix",
    "cell_dofs",
    "cell_tags",
    "coefficients_of",
    "compile_code",
    "create_mesh",
    "degree",
    "dirichletbc",
    "element",
    "equidistant_nodes",
    "facet_tags",
    "function_space",
    "general_form",
    "geometry_dofs",
    "ghosted_vector",
    "gmsh_session",
    "inside_face",
    "kernels_of",
    "make_form",
    "mixed_element",
    "original_cells",
    "partition",
    "parts_of",
    "quadrature_element",
    "reference_element",
    "renumbered_space",
    "triangle_nodes",
    "versions",
    "vtk_order",
]


def versions() -> dict[str, str]:
    """Return the versions of the libraries that a force depends on."""
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    return {"dolfinx": str(dolfinx.__version__), "petsc": petsc, "gmsh": str(gmsh.__version__)}
