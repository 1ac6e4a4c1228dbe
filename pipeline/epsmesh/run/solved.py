"""One case solved as a run solves it, with its fields in hand: meshes are tried and judged as in a run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from epsmesh.arrays import BoolArray
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.mesh.generate import MeshArrays, MeshError
from epsmesh.mesh.of_case import upright
from epsmesh.plan import estimate
from epsmesh.plan.plan import declare, first_attempts, make_plan
from epsmesh.plan.steps import Solve
from epsmesh.plan.symmetry import model_planes
from epsmesh.run.attempts import Attempts
from epsmesh.run.compile import prepare
from epsmesh.run.measure import record_of
from epsmesh.run.memory import FreeMemory, return_large_arrays
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.meshing import cached_arrays, on_first_rank
from epsmesh.run.problem import (
    CaseFailure,
    check_memory,
    conditions_of,
    lacks_memory,
    law_of,
    memory_of,
    meridian_problem,
    problem_of,
    solve_problem,
)
from epsmesh.run.record import Record
from epsmesh.run.threads import one_thread
from epsmesh.shapes.grasp import MIDDLE
from epsmesh.solve import SolveError
from epsmesh.solve.cell_values import clear_cells
from epsmesh.solve.compiled import compiling
from epsmesh.solve.points.state import State, compile_stress
from epsmesh.solve.spaces import Spaces
from epsmesh.study.capabilities.refusals import refused
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study

Note = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Solved:
    """A case that was solved in three dimensions: how (``solve``), its ``record`` and the fields of the last attempt.

    ``arrays`` is the mesh of the modelled part as it was made, on rank 0 only. The ``state`` is in the body's
    coordinates. ``dofs`` counts the unknowns of the whole body. The force of the record ``on_meridian`` is that of the
    axisymmetric scene in the half plane. ``finer`` are the fields in elements of one degree more, where the error bar
    of the force has them, and ``clear`` the owned cells away from singular edges.
    """

    solve: Solve
    record: Record
    state: State
    arrays: MeshArrays | None
    dofs: int
    on_meridian: bool = False
    finer: State | None = None
    clear: BoolArray | None = None


def solve_alone(study: Study, case: Case) -> Solve:
    """Return how ``case`` is computed to have its fields: in three dimensions, on what symmetry leaves of the body.

    As in a run, its force may come from a meridian (``axisymmetric``), and its far field from a mesh that the places of
    the study share.
    """
    run = next(solve for solve in make_plan(study).solves if case.index in solve.serves)
    solve = next(solve for solve in first_attempts(declare(study)).solves if case.index in solve.serves)
    # Fields have both jaws.
    planes = tuple(plane for plane in model_planes(case) if plane != MIDDLE)
    mirrors = planes if case.mesh.model == "auto" else ()
    shown = replace(solve.case, far_region=run.case.far_region)
    return replace(solve, case=shown, mirrors=mirrors, axisymmetric=run.axisymmetric)


def solve_fields(
    solve: Solve,
    comm: MPI.Comm,
    *,
    bar: bool = True,
    influence: bool = False,
    cache: MeshCache | None = None,
    note: Note = lambda text: None,
) -> Solved:
    """Return the solution of a case; collective.

    With an accuracy, meshes are tried and judged as in a run: the fields are those of its mesh, with its force. With
    ``bar`` the force has its error bar, if there is the memory for it. ``influence``: with it, where the scene has one.
    ``note`` receives, on every rank, what is being worked on.

    Raises:
        CaseFailure: if the memory is too small.
        MeshError: if the first mesh fails.
        SolveError: if the first solve fails.
    """
    return_large_arrays()
    run, solve = solve, replace(solve, axisymmetric=False)
    attempt = partial(_attempt, comm=comm, bar=bar, influence=influence, cache=cache, note=note)
    with one_thread():
        attempts = Attempts()
        best = latest = attempt(solve)
        while (judged := attempts.judge(solve, latest.record)) is None:
            (solve,) = attempts.take_again()
            try:
                latest = attempt(solve)
            except (CaseFailure, MeshError, SolveError):
                break  # no finer mesh: a run concludes with the best force so far, too
            if latest.record.force_error < best.record.force_error:
                best = latest
        if judged is not None and not judged.is_ok:
            best = replace(best, record=replace(best.record, status=judged.status, message=judged.message))
        return _with_force_of_meridian(run, best, comm) if run.axisymmetric else best


def _with_force_of_meridian(run: Solve, solved: Solved, comm: MPI.Comm) -> Solved:
    """Return the solution with the record that a run finds on the meridian; collective."""
    prepare(comm, [run])
    problem = meridian_problem(run.case, run.goal)
    record = on_first_rank(comm, lambda: record_of(run, solve_problem(run.case, problem, estimate=True, goal=run.goal)))
    return replace(solved, record=comm.bcast(record), on_meridian=True)


def _attempt(
    solve: Solve, *, comm: MPI.Comm, bar: bool, influence: bool, cache: MeshCache | None, note: Note
) -> Solved:
    """Solve on one mesh; return the record that a run would have of it, and the fields; collective."""
    case, meshed = solve.case, solve.meshed_case
    arrays = modelled_arrays(solve, comm, cache, note)
    prepare(comm, [solve])
    mesh = distribute(comm, arrays and upright(meshed, arrays))
    with Spaces(mesh) as spaces, problem_of(spaces, meshed) as problem:
        needed, with_bar = memory_of(case, problem.dofs)
        available = FreeMemory(comm).available()
        check_memory(available, needed, "solving")
        room = bar and not lacks_memory(available, with_bar, "")
        part = ("", " of half of the body", " of a quarter of the body")[len(solve.mirrors)]
        note(f"solving for {problem.dofs:,} unknowns{part}")
        # Of a history, fields are those of the elastic body.
        still = replace(case, probe=case.probe.model_copy(update={"history": None}), outputs=())
        has_bar = room or solve.goal is not None
        influence = influence and not refused("influence", still)
        solution = solve_problem(still, problem, estimate=has_bar, meshed=meshed, keep=True, influence=influence)
        state, finer, mesh = problem.state(), problem.finer_state, problem.spaces.body
    compile_law(comm, state)
    clear = clear_cells(mesh, conditions_of(case).front, wholly=True)
    put_back(case, meshed, mesh, [state] if finer is None else [state, finer])
    law = law_of(still, in_body=True)
    state, finer = replace(state, law=law), finer and replace(finer, law=law)
    return Solved(solve, record_of(solve, solution), state, arrays, solution.dofs, finer=finer, clear=clear)


def modelled_arrays(solve: Solve, comm: MPI.Comm, cache: MeshCache | None, note: Note) -> MeshArrays | None:
    """Return, on rank 0, the mesh of the part of the body that is modelled; of a half ball, where a run makes it."""
    case = solve.meshed_case
    check_memory(
        FreeMemory(comm).available(), estimate.case_memory(case, share=0.5 ** len(solve.mirrors)), "this case", case
    )
    note("meshing")
    return on_first_rank(comm, lambda: cached_arrays(case, solve.mirrors, cache))


def compile_law(comm: MPI.Comm, state: State) -> None:
    """Compile what the stress of large displacements needs, under the lock of the cache; collective."""
    if comm.rank == 0 and not state.law.is_linear:
        with compiling():
            compile_stress(state)
    comm.barrier()


def put_back(case: Case, meshed: Case, mesh: BodyMesh, states: Sequence[State]) -> Callable[[], None]:
    """Bring mesh and displacements from the solver's frame to the body's coordinates, and to the place of ``case``.

    Return a function that undoes it for the mesh.
    """
    places: list[Any] = [mesh.mesh.geometry.x, *([] if mesh.imaged is None else [mesh.imaged])]
    before = [x.copy() for x in places]
    if (turn := case.frame.turn) is not None:
        for x in places:
            x[:] = x @ turn
        for state in states:
            values = state.displacement.x.array
            values[:] = (values.reshape(-1, 3) @ turn).reshape(-1)
    if (shift := np.subtract(case.frame.point, meshed.frame.point)).any():
        for x in places:
            x[:] += shift

    def undo() -> None:
        for x, earlier in zip(places, before, strict=True):
            x[:] = earlier

    return undo
