"""Patch test and rates of convergence of the elements themselves, on meshes that the program makes."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc

from pipeline import compat
from pipeline.mesh.curve import curve
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import generate
from pipeline.mesh.size import Sizes
from pipeline.scene.model import Scene
from pipeline.solve.compiled import form, vector_space
from pipeline.solve.forms import ElasticForms, strain
from pipeline.solve.physics import MaterialLaw
from tests.cases import study

LAME = (2.0, 1.0)


def make_mesh(degree: int, size: float, rim: float) -> BodyMesh:
    case = study().case(())
    sizes = Sizes(np.inf, size, size, rim, 0.8)
    scene = Scene(case.body, case.probe, rim_segments=sizes.rim_segments(case.probe), straight=degree == 1)
    arrays = generate(scene, sizes)
    return distribute(MPI.COMM_SELF, arrays if degree == 1 else curve(arrays, scene))


def boundary_dofs(space) -> np.ndarray:
    facets = mesh.exterior_facet_indices(space.mesh.topology)
    return fem.locate_dofs_topological(space, space.mesh.topology.dim - 1, facets)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_patch(degree):
    """A linear displacement leaves no force on any inner dof, on a graded mesh with curved elements."""
    space = vector_space(make_mesh(degree, 5e-3, 0.5e-3).mesh, degree)
    forms = ElasticForms(space)
    forms.set_law(MaterialLaw.of(*LAME))
    gradient = np.array([[0.3, -0.2, 0.1], [0.4, 0.1, -0.5], [0.2, 0.6, -0.3]])
    forms.displacement.interpolate(lambda x: gradient @ x)
    residual = np.asarray(fem.assemble_vector(forms.action).array).reshape(-1, 3)
    inner = np.ones(len(residual), dtype=bool)
    inner[boundary_dofs(space)] = False
    assert inner.any()
    assert np.abs(residual[inner]).max() < 1e-10 * np.abs(residual).max()


def manufactured_error(degree: int, size: float) -> tuple[float, int]:
    """Return the energy-norm error of a smooth displacement, held on the whole boundary, and the number of cells."""
    body = make_mesh(degree, size, size)
    space = vector_space(body.mesh, degree)
    forms = ElasticForms(space)
    forms.set_law(MaterialLaw.of(*LAME))
    k = 2 * np.pi / 40e-3

    def exact(x, sin, cos):
        return sin(k * x[0]) * cos(k * x[2]), cos(k * x[1]), sin(k * (x[0] + x[1] + x[2]))

    x = ufl.SpatialCoordinate(body.mesh)
    u = ufl.as_vector(exact(x, ufl.sin, ufl.cos))
    stress = LAME[0] * ufl.div(u) * ufl.Identity(3) + 2 * LAME[1] * strain(u)
    dx = ufl.dx(metadata={"quadrature_degree": 6})
    load = form(-ufl.inner(ufl.div(stress), ufl.TestFunction(space)) * dx)
    held = fem.Function(space)
    held.interpolate(lambda p: np.array(exact(p, np.sin, np.cos)))
    condition = fem.dirichletbc(held, boundary_dofs(space))
    matrix = compat.assemble_matrix(forms.stiffness, [condition], 1.0)
    b = np.asarray(fem.assemble_vector(load).array).copy()
    forms.displacement.x.array[:] = 0.0
    dofs = (3 * boundary_dofs(space)[:, None] + np.arange(3)).reshape(-1)
    forms.displacement.x.array[dofs] = held.x.array[dofs]
    b -= np.asarray(fem.assemble_vector(forms.action).array)
    b[dofs] = held.x.array[dofs]
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.pc.setType("lu")
    solver.pc.setFactorSolverType("mumps")
    rhs, solution = PETSc.Vec().createWithArray(b), matrix.createVecRight()
    solver.solve(rhs, solution)
    forms.displacement.x.array[:] = solution.array
    e = forms.displacement - u
    density = LAME[0] * ufl.div(e) ** 2 + 2 * LAME[1] * ufl.inner(strain(e), strain(e))
    return fem.assemble_scalar(form(density * dx)) ** 0.5, body.cells


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_rate_of_convergence(degree):
    """The error in the energy norm falls like h^p, h from the number of cells."""
    sizes = (6e-3, 5e-3, 4e-3, 3e-3) if degree < 3 else (10e-3, 8e-3, 6e-3, 5e-3)
    errors, cells = zip(*(manufactured_error(degree, size) for size in sizes), strict=True)
    slope = np.polyfit(-np.log(cells) / 3, np.log(errors), 1)[0]
    assert slope == pytest.approx(degree, abs=0.35), errors
