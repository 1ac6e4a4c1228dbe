"""From a case to the fields that show it: meshed, solved if asked for, gathered on the first rank, made whole."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from pipeline import compat
from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays, MeshError
from pipeline.mesh.of_case import upright
from pipeline.mesh.reflect import reflect, reflect_vectors
from pipeline.plan import estimate
from pipeline.plan.plan import declare, first_attempts, make_plan
from pipeline.plan.steps import Solve
from pipeline.plan.symmetry import mirror_planes, model_planes
from pipeline.run.attempts import Attempts
from pipeline.run.compile import prepare
from pipeline.run.measure import record_of
from pipeline.run.memory import FreeMemory
from pipeline.run.mesh_cache import MeshCache
from pipeline.run.meshing import cached_arrays, on_first_rank
from pipeline.run.problem import (
    CaseFailure,
    check_memory,
    lacks_memory,
    memory_of,
    meridian_problem,
    problem_of,
    solve_problem,
)
from pipeline.run.record import Record
from pipeline.solve import SolveError
from pipeline.solve.compiled import vector_space
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.spaces import Spaces
from pipeline.study.case import Case
from pipeline.study.sweep import Study
from pipeline.view.fields import Fields

Note = Callable[[str], None]


def solve_to_view(study: Study, case: Case) -> Solve:
    """Return how ``case`` is computed to be looked at: in three dimensions, on what symmetry leaves of the body.

    As in a run, its force may come from a meridian (``axisymmetric``), and its far field from a mesh that the places of
    the study share.
    """
    run = next(solve for solve in make_plan(study).solves if case.index in solve.serves)
    solve = next(solve for solve in first_attempts(declare(study)).solves if case.index in solve.serves)
    mirrors = model_planes(case) if case.mesh.model == "auto" else ()
    shown = replace(solve.case, far_region=run.case.far_region)
    return replace(solve, case=shown, mirrors=mirrors, axisymmetric=run.axisymmetric)


def compute_fields(
    solve: Solve,
    comm: MPI.Comm,
    *,
    mesh_only: bool = False,
    bar: bool = False,
    cache: MeshCache | None = None,
    note: Note = lambda text: None,
) -> Fields | None:
    """Return the fields of a case, on rank 0 (None elsewhere); collective.

    Where an accuracy is asked for, meshes are tried and judged as in a run: the fields are those of its mesh, with its
    force; with ``mesh_only``, those of the first mesh. With ``bar`` the force has its error bar, if there is the memory
    for it. ``note`` receives, on every rank, what is being worked on.

    Raises:
        CaseFailure, MeshError, SolveError: on every rank, with what to tell the user.
    """
    # A rank is one thread, as in a run.
    run, solve = solve, replace(solve, axisymmetric=False)
    with threadpool_limits(limits=1, user_api="blas"):
        if mesh_only:
            arrays = _arrays(solve, comm, cache, note)
            return _whole(solve, arrays) if arrays is not None else None
        attempts = Attempts()
        best, fields = _attempt(solve, comm, bar, cache, note)
        record = best
        while attempts.judge(solve, record) is None:
            (solve,) = attempts.take_again()
            try:
                record, found = _attempt(solve, comm, bar, cache, note)
            except (CaseFailure, MeshError, SolveError):
                break  # no finer mesh: a run concludes with the best force so far, too
            if record.force_error < best.force_error:
                best, fields = record, found
        return _with_force_of_meridian(run, fields, comm) if run.axisymmetric else fields


def _with_force_of_meridian(run: Solve, fields: Fields | None, comm: MPI.Comm) -> Fields | None:
    """Return the fields with the force that a run finds on the meridian; collective."""
    prepare(comm, [run])
    problem = meridian_problem(run.case)
    record = on_first_rank(comm, lambda: record_of(run, solve_problem(run.case, problem, estimate=True)))
    if fields is None or record is None:
        return None
    return replace(fields, force=record.force, force_error=record.force_error, on_meridian=True)


def _attempt(
    solve: Solve, comm: MPI.Comm, bar: bool, cache: MeshCache | None, note: Note
) -> tuple[Record, Fields | None]:
    """Solve on one mesh; return the record that a run would have of it and, on rank 0, the fields."""
    case, meshed = solve.case, solve.meshed_case
    arrays = _arrays(solve, comm, cache, note)
    prepare(comm, [solve])
    mesh = distribute(comm, arrays and upright(meshed, arrays))
    with Spaces(mesh) as spaces, problem_of(spaces, meshed) as problem:
        needed, with_bar = memory_of(case, problem.dofs)
        check_memory(FreeMemory(comm), needed, "solving")
        room = bar and not lacks_memory(FreeMemory(comm), with_bar, "")
        note(f"solving for {problem.dofs} unknowns")
        # Of a history, fields are those of the elastic body.
        still = replace(case, probe=case.probe.model_copy(update={"history": None}))
        solution = solve_problem(still, problem, estimate=room or solve.goal is not None, meshed=meshed)
        points = comm.bcast(len(arrays.points) if arrays is not None else 0)
        displacement, strain = _gathered(mesh, problem, points)
        if case.frame.turn is not None:
            displacement = displacement @ case.frame.turn  # back to the body's coordinates
    record = record_of(solve, solution)
    if arrays is None:
        return record, None
    fields = _whole(solve, arrays, displacement, strain)
    return record, replace(fields, dofs=solution.dofs, force=record.force, force_error=record.force_error)


def _arrays(solve: Solve, comm: MPI.Comm, cache: MeshCache | None, note: Note) -> MeshArrays | None:
    """Return, on rank 0, the mesh of the part of the body that is modelled; of a half ball, where a run makes it."""
    case = solve.meshed_case
    check_memory(FreeMemory(comm), estimate.case_memory(case, share=0.5 ** len(solve.mirrors)), "this case")
    note("meshing")
    return on_first_rank(comm, lambda: cached_arrays(case, solve.mirrors, cache))


def _gathered(mesh: BodyMesh, problem: QuasiStaticProblem, points: int) -> tuple[FloatArray, FloatArray]:
    """Return, on rank 0, the displacement of every point of the mesh as it was made, and the strain of every cell.

    A displacement of higher degree is interpolated to the order of the mesh: exact at its nodes.
    """
    displacement, principal = problem.fields()
    owned = mesh.owned_cells
    order = 1 if compat.geometry_dofs(mesh.mesh).shape[1] == 4 else 2
    nodal = fem.Function(vector_space(mesh.mesh, order))
    nodal.interpolate(displacement)
    # Nodes of the geometry and dofs of that order come in the same order within a cell.
    nodes = compat.geometry_dofs(mesh.mesh)[:owned].reshape(-1)
    dofs = compat.cell_dofs(nodal.function_space)[:owned].reshape(-1)
    numbers, first = np.unique(_input_numbers(mesh.mesh)[nodes], return_index=True)
    values = np.asarray(nodal.x.array).reshape(-1, 3)[dofs[first]]
    strain = np.abs(principal).max(axis=1)
    at_points = _assembled(mesh.comm, points, numbers, values)
    return at_points, _assembled(mesh.comm, mesh.cells, compat.original_cells(mesh.mesh)[:owned], strain)


def _input_numbers(mesh: Any) -> IntArray:
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)


def _assembled(comm: MPI.Comm, size: int, numbers: IntArray, values: FloatArray) -> FloatArray:
    """Return, on rank 0, one array of every rank's ``values``, each at its number; collective."""
    result = np.empty((size if comm.rank == 0 else 0, *values.shape[1:]))
    for place, content in comm.gather((numbers, values)) or ():
        result[place] = content
    return result


def _whole(
    solve: Solve, arrays: MeshArrays, displacement: FloatArray | None = None, strain: FloatArray | None = None
) -> Fields:
    """Reflect what was modelled into the whole body."""
    case, mirrors = solve.case, solve.mirrors
    if displacement is not None:
        displacement = reflect_vectors(arrays, displacement, mirrors)
    if strain is not None:
        strain = np.tile(strain, 2 ** len(mirrors))
    whole = reflect(arrays, mirrors)
    points = whole.points + np.subtract(case.frame.point, solve.meshed_case.frame.point)
    fields = Fields(case, points, whole.cells, whole.facets, mirror_planes(case), displacement, strain)
    if whole.regions is None:
        return fields
    # Where layers fill the body nothing is left of the tissue that has number 0.
    present, regions = np.unique(whole.regions, return_inverse=True)
    names = "tissue", *(region.name for region in case.body.regions)
    return replace(fields, regions=regions, region_names=tuple(names[number] for number in present))
