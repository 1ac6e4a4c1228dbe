"""The elements alone: patch test, and convergence rates for a manufactured solution."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import log2
from typing import Any

import dolfinx
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.solve.compiled import form, scalar_space, vector_space
from epsmesh.solve.forms import ElasticForms, MixedForms
from epsmesh.solve.physics import MaterialLaw
from epsmesh.study.read import parse
from epsmesh.verify import Row
from tests.verification.sections import cylinder, disc, study

_ROUND_OFF = 1e-10
# Meshes of 2 and 4 cubes a side are coarse for a rate, so it may differ by 15 % from theory.
_RATE_ERROR = 0.15
_CUBES = {1: (6, 12), 2: (3, 6), 3: (2, 4)}
_MIXED_CUBES = {2: (3, 6), 3: (2, 4)}

_STRAIN = "uniform strain is exact in every space"
_THEORY = "error in the energy norm falls like h^p"


def element_rows() -> Iterator[Row]:
    """Yield the rows of the patch test and of the manufactured solutions: a few seconds in total."""
    for degree in (1, 2, 3):
        yield Row("patch test", f"degree {degree}", 0.0, _STRAIN, _patch(degree, mixed=False), _ROUND_OFF)
    for degree in (2, 3):
        yield Row("patch test", f"mixed {degree}", 0.0, _STRAIN, _patch(degree, mixed=True), _ROUND_OFF)
    for degree, cubes in _CUBES.items():
        errors = [_manufactured(degree, n, poisson=0.3, mixed=False) for n in cubes]
        yield _rate(f"degree {degree}, ν = 0.3", degree, errors)
    for degree, cubes in _MIXED_CUBES.items():
        errors = [_manufactured(degree, n, poisson=0.5, mixed=True) for n in cubes]
        yield _rate(f"mixed {degree}, ν = 0.5", degree, errors)


def _rate(path: str, degree: int, errors: list[float]) -> Row:
    return Row("manufactured solution", path, degree, _THEORY, log2(errors[0] / errors[1]), _RATE_ERROR)


def _patch(degree: int, *, mixed: bool) -> float:
    """Return the largest nodal force inside a body in uniform strain, over the largest on its surface.

    The mesh has curved quarter-point elements at the probe's edge.
    """
    sizes = {"epsilon": "full", "fine": "8 mm", "coarse": "8 mm", "rim": "1 mm", "degree": degree}
    case = parse(study(0.4, cylinder(20, 10), disc(3, 0.1), sizes, young=1e3)).case(())
    body = distribute(MPI.COMM_SELF, mesh_arrays(case, ("x", "y")))
    space = vector_space(body.mesh, degree)
    forms = ElasticForms(space)
    forms.set_law(MaterialLaw.of(1.0, 1.0))
    gradient = np.array([[0.2, 0.5, -0.3], [0.1, -0.4, 0.7], [0.6, 0.3, 0.9]])
    forms.displacement.interpolate(lambda x: gradient @ x)
    parts = [forms.action]
    if mixed:
        coupled = MixedForms(forms, scalar_space(body.mesh, degree - 1))
        coupled.pressure.x.array[:] = np.trace(gradient)
        parts.append(coupled.pull)
    vectors = [fem.assemble_vector(part) for part in parts]
    force = np.linalg.norm(np.sum([v.array for v in vectors], axis=0).reshape(-1, 3), axis=1)
    surface = dolfinx.mesh.exterior_facet_indices(body.mesh.topology)
    on_surface = fem.locate_dofs_topological(space, 2, surface)
    inside = np.setdiff1d(np.arange(len(force)), on_surface)
    return float(force[inside].max(initial=0.0) / force.max())


@dataclass(frozen=True)
class _Exact:
    """A smooth displacement, divergence-free for ν = ½, and its load for μ = 1."""

    displacement: Any
    load: Any


def _exact(mesh: Any, lame_lambda: float) -> _Exact:
    x = ufl.SpatialCoordinate(mesh)
    u = ufl.as_vector([ufl.sin(2 * x[1]) * ufl.cos(x[2]), ufl.sin(2 * x[2]) * ufl.cos(x[0]), ufl.sin(2 * x[0])])
    if lame_lambda:
        u = u + ufl.as_vector([ufl.sin(x[0]), x[1] ** 3, ufl.exp(x[2])]) / 3
    stress = lame_lambda * ufl.div(u) * ufl.Identity(3) + 2 * ufl.sym(ufl.grad(u))
    return _Exact(u, -ufl.div(stress))


def _manufactured(degree: int, cubes: int, *, poisson: float, mixed: bool) -> float:
    """Return the error in the energy norm on a cube of ``cubes``³ × 6 tetrahedra with a prescribed surface, μ = 1.

    The mixed element solves for ν = ½, with λ₀ = 1 in K₀, and a solution without dilation.
    """
    mesh = dolfinx.mesh.create_unit_cube(MPI.COMM_SELF, cubes, cubes, cubes)
    lame_lambda = 1.0 if mixed else 2 * poisson / (1 - 2 * poisson)
    space = vector_space(mesh, degree)
    forms = ElasticForms(space)
    forms.set_law(MaterialLaw.of(lame_lambda, 1.0))
    exact = _exact(mesh, 0.0 if mixed else lame_lambda)
    dx = ufl.dx(metadata={"quadrature_degree": 2 * degree + 2})
    load = form(ufl.inner(exact.load, ufl.TestFunction(space)) * dx)
    blocks = [[_sparse(forms.stiffness)]]
    rhs = np.array(fem.assemble_vector(load).array)
    if mixed:
        coupling = _sparse(MixedForms(forms, scalar_space(mesh, degree - 1)).coupling)
        blocks = [[blocks[0][0], coupling.T], [coupling, None]]
        rhs = np.concatenate([rhs, np.zeros(coupling.shape[0])])
    matrix = sp.bmat(blocks, format="csc")
    mesh.topology.create_connectivity(2, 3)
    edge = fem.locate_dofs_topological(space, 2, dolfinx.mesh.exterior_facet_indices(mesh.topology))
    held = (3 * np.asarray(edge)[:, None] + np.arange(3)).reshape(-1)
    if mixed:
        held = np.append(held, len(rhs) - 1)  # pressure is known up to a constant
    forms.displacement.interpolate(_evaluate(mixed))
    values = np.zeros(len(rhs))
    values[held[held < 3 * space.dofmap.index_map.size_local]] = forms.displacement.x.array[
        held[held < 3 * space.dofmap.index_map.size_local]
    ]
    free = np.setdiff1d(np.arange(len(rhs)), held)
    values[free] = spl.spsolve(matrix[free][:, free], (rhs - matrix @ values)[free])
    forms.displacement.x.array[:] = values[: len(forms.displacement.x.array)]
    error = ufl.sym(ufl.grad(forms.displacement - exact.displacement))
    return float(fem.assemble_scalar(form(ufl.inner(error, error) * dx)) ** 0.5)


def _evaluate(mixed: bool) -> Any:
    def displacement(x: np.ndarray) -> np.ndarray:
        u = np.array([np.sin(2 * x[1]) * np.cos(x[2]), np.sin(2 * x[2]) * np.cos(x[0]), np.sin(2 * x[0])])
        return u if mixed else u + np.array([np.sin(x[0]), x[1] ** 3, np.exp(x[2])]) / 3

    return displacement


def _sparse(form: Any) -> sp.csr_matrix:
    matrix: PETSc.Mat = fem_petsc.assemble_matrix(form)
    matrix.assemble()
    pointers, columns, values = matrix.getValuesCSR()
    result = sp.csr_matrix((values, columns, pointers), shape=matrix.getSize())
    matrix.destroy()
    return result
