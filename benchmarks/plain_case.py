"""One case as an experienced FEniCSx user writes it: gmsh, ``model_to_mesh``, P2, CG with GAMG, reaction.

Geometry and size field are the program's own, of the whole body. Material constants are ``fem.Constant``, so that forms
compile once.
"""

import time
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

import gmsh
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.mesh.size import Sizes, set_size_field
from epsmesh.scene.model import FIXED, PROBE, Scene, build
from epsmesh.solve.compiled import form, vector_space
from epsmesh.study.case import Case

_CG = {"ksp_type": "cg", "ksp_rtol": 1e-8}
_GAMG = {"pc_type": "gamg", "pc_gamg_threshold": 0.01, "mg_levels_ksp_type": "chebyshev"}
SOLVERS: dict[str, dict[str, Any]] = {
    "gamg": _CG | _GAMG | {"mg_levels_pc_type": "jacobi", "mg_levels_ksp_max_it": 2},
    "gamg-default": _CG | {"pc_type": "gamg"},
    "hypre": _CG
    | {
        "pc_type": "hypre",
        "pc_hypre_type": "boomeramg",
        "pc_hypre_boomeramg_strong_threshold": 0.5,
        "pc_hypre_boomeramg_nodal_coarsen": 4,
        "pc_hypre_boomeramg_vec_interp_variant": 3,
        "pc_hypre_boomeramg_coarsen_type": "HMIS",
        "pc_hypre_boomeramg_interp_type": "ext+i",
    },
    "mumps": {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
}
# Number of unknowns up to which MUMPS is as fast: measured on meshes of figure3.toml, as are the options above.
MOST_DIRECT = 150_000
PREFIX = "plain_"


@dataclass(frozen=True)
class Solved:
    """Result of one case: F (N), and its time (s), total and by part."""

    case: str
    index: tuple[int, ...]
    force: float
    dofs: int
    iterations: int
    seconds: float
    cpu: float
    parts: dict[str, float]


def solve(case: Case, solver: str, most_direct: int) -> Solved:
    """Mesh and solve one case: with MUMPS up to ``most_direct`` unknowns, above with one of ``SOLVERS``."""
    times, cpu = [time.perf_counter()], time.process_time()
    mesh, facets = make_mesh(case)
    times.append(time.perf_counter())
    space = vector_space(mesh, case.mesh.degree)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    lam, mu = (fem.Constant(mesh, PETSc.ScalarType(value)) for value in case.material.lame)

    def virtual_work(w: Any) -> Any:
        stress = 2 * mu * ufl.sym(ufl.grad(w)) + lam * ufl.div(w) * ufl.Identity(3)
        return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx

    conditions, probe = _conditions(space, facets, case)
    stiffness = form(virtual_work(u))
    matrix = fem_petsc.assemble_matrix(stiffness, bcs=conditions)
    matrix.assemble()
    no_load = ufl.inner(fem.Constant(mesh, np.zeros(3)), v) * ufl.dx
    rhs = fem_petsc.assemble_vector(form(no_load))
    fem_petsc.apply_lifting(rhs, [stiffness], [conditions])
    rhs.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    fem_petsc.set_bc(rhs, conditions)
    times.append(time.perf_counter())
    displacement = fem.Function(space)
    dofs = 3 * space.dofmap.index_map.size_global
    method = "mumps" if dofs <= most_direct else solver
    iterations = _linear_solve(matrix, rhs, displacement, SOLVERS[method])
    times.append(time.perf_counter())
    # The reaction: the residual of the operator without conditions, summed over the probe's dofs.
    residual = fem_petsc.assemble_vector(form(virtual_work(displacement)))
    force = -float(residual.array.reshape(-1, 3)[probe, 2].sum())
    times.append(time.perf_counter())
    for item in (residual, rhs, matrix):
        item.destroy()
    parts = dict(zip(("mesh", "assemble", "solve", "force"), np.diff(times).tolist(), strict=True))
    cost = time.perf_counter() - times[0], time.process_time() - cpu
    return Solved(str(case), case.index, force, dofs, iterations, *cost, parts)


def make_mesh(case: Case) -> tuple[Any, dict[str, np.ndarray]]:
    """Return the mesh of the whole body, curved on round sides, and its facets on probe and support."""
    settings, probe = case.mesh, case.probe
    epsilon = inf if case.is_full else settings.epsilon
    column = inf if settings.outside == "coarse" else epsilon
    side = min(column, case.body.bend)
    rim = settings.rim_size(probe.half_width)
    sizes = Sizes(epsilon, settings.fine, settings.coarse, rim, settings.growth, side)
    scene = Scene(case.body, probe, case.column, settings.outside == "fixed", sizes.rim_segments(probe))
    with compat.gmsh_session():
        for name in ("SizeExtendFromBoundary", "SizeFromPoints", "SizeFromCurvature"):
            gmsh.option.setNumber(f"Mesh.Mesh{name}", 0)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        rim_curves = build(scene)
        if scene.rim_segments and len(rim_curves) == 1:
            gmsh.model.mesh.setTransfiniteCurve(rim_curves[0], scene.rim_segments + 1)
        set_size_field(sizes, probe, scene.frame, scene.scale)
        gmsh.model.mesh.generate(3)
        if scene.is_cut or isfinite(case.body.bend):
            gmsh.model.mesh.setOrder(2)  # flat sides would make a column thinner, and F 1 % too low
        groups = {gmsh.model.getPhysicalName(2, tag): tag for _, tag in gmsh.model.getPhysicalGroups(2)}
        mesh, tags = model_to_mesh()
    mesh.geometry.x[:] *= scene.scale
    return mesh, {
        name: tags.find(tag) if hasattr(tags, "find") else tags.indices[tags.values == tag]
        for name, tag in groups.items()
    }


def model_to_mesh() -> tuple[Any, Any]:
    """Return dolfinx's mesh of gmsh's current model, and its facets' tags."""
    try:
        from dolfinx.io.gmshio import model_to_mesh
    except ImportError:  # dolfinx 0.10
        from dolfinx.io.gmsh import model_to_mesh
    found = model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=3)
    return (found.mesh, found.facet_tags) if hasattr(found, "facet_tags") else (found[0], found[2])


def _conditions(space: Any, facets: dict[str, np.ndarray], case: Case) -> tuple[list[Any], np.ndarray]:
    """Return the boundary conditions, and the blocks of dofs on the probe's footprint."""
    fixed, probe = (fem.locate_dofs_topological(space, 2, facets[name]) for name in (FIXED, PROBE))
    conditions = [fem.dirichletbc(np.zeros(3, dtype=PETSc.ScalarType), fixed, space)]
    if case.probe.contact == "bonded":
        conditions.append(fem.dirichletbc(np.array(case.travel, dtype=PETSc.ScalarType), probe, space))
    else:
        conditions.append(fem.dirichletbc(PETSc.ScalarType(-case.probe.depth), 3 * probe + 2, space.sub(2)))
    return conditions, probe


def _linear_solve(matrix: PETSc.Mat, rhs: PETSc.Vec, displacement: Any, settings: dict[str, Any]) -> int:
    """Solve and return the iterations.

    Raises:
        RuntimeError: if it did not converge.
    """
    options = PETSc.Options()
    for name, value in settings.items():
        options[PREFIX + name] = value
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    modes = _rigid_body_modes(displacement.function_space)
    matrix.setNearNullSpace(modes)
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setOptionsPrefix(PREFIX)
    solver.setOperators(matrix)
    solver.setFromOptions()
    solution = displacement.x.petsc_vec if hasattr(displacement.x, "petsc_vec") else displacement.vector
    solver.solve(rhs, solution)
    displacement.x.scatter_forward()
    reason, iterations = solver.getConvergedReason(), solver.its
    for name in settings:
        options.delValue(PREFIX + name)
    for item in (solver, modes):
        item.destroy()
    if reason <= 0:
        raise RuntimeError(f"the linear solver ended for reason {reason} after {iterations} iterations")
    return iterations


def _rigid_body_modes(space: Any) -> PETSc.NullSpace:
    coordinates = PETSc.Vec().createWithArray(space.tabulate_dof_coordinates().reshape(-1), bsize=3, comm=MPI.COMM_SELF)
    return PETSc.NullSpace().createRigidBody(coordinates)
