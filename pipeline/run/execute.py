"""Carry out a plan on a communicator: mesh, operators, solves, and a record on disk after each of them."""

import gc
import statistics
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from math import inf
from typing import Any

import psutil
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from pipeline.mesh.curve import curve
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.mesh.generate import MeshArrays, MeshError, generate
from pipeline.mesh.size import Sizes
from pipeline.plan import estimate
from pipeline.plan.plan import MeshStep, OperatorStep, Plan, Solve
from pipeline.run.memory import PeakMemory
from pipeline.run.progress import Progress
from pipeline.run.provenance import provenance
from pipeline.run.record import Record
from pipeline.scene.model import Scene
from pipeline.solve.elasticity import ElasticBody, Solution
from pipeline.solve.forms import prepare
from pipeline.solve.linear import SolveError, is_direct
from pipeline.solve.space import Contact
from pipeline.study.sweep import Case

# A case may take this share of the memory that is free when it begins.
_MEMORY_SHARE = 0.9

Keep = Callable[[Record], None]


class CaseFailure(Exception):
    """A case cannot be computed, for a reason that all ranks have agreed on."""


def execute(plan: Plan, comm: MPI.Comm, keep: Keep, progress: Progress) -> int:
    """Carry out ``plan``; collective. ``keep`` is called on rank 0 with each record, as soon as it exists.

    Returns the number of cases that failed, the same on every rank: each has a record with its message, and the
    rest went on.
    """
    runner = _Runner(comm, keep, progress, timed=plan.study.solve.timing)
    if plan.solves:
        prepare(comm, {solve.case.mesh.degree for solve in plan.solves})
    # A rank is one thread: OpenBLAS's own would wait for work by spinning, and take the other ranks' cores.
    with threadpool_limits(limits=1, user_api="blas"):
        for step in plan.meshes:
            repeats = step.case.solve.repeats if runner.timed else 1
            runner.run(step, repeats)
            gc.collect()  # dolfinx's meshes hold communicators, and Python's cycles hold the meshes
    return runner.failed


class _Runner:
    """Carries out mesh steps, one after the other, on all ranks."""

    def __init__(self, comm: MPI.Comm, keep: Keep, progress: Progress, *, timed: bool):
        self.comm, self.timed, self.failed = comm, timed, 0
        self._keep, self._progress = keep, progress
        self._provenance = provenance(comm.size)

    def run(self, step: MeshStep, repeats: int) -> None:
        """Compute every case of a mesh step, and record each; collective."""
        memory = PeakMemory(self.comm)
        if repeats > 1:
            (solve,) = step.solves
            self._record_one(solve, lambda: self._repeat(step, repeats, memory))
            return
        meshed: list[tuple[BodyMesh, float]] = []
        if not self._guard(step.solves, lambda: meshed.append(self._mesh(step.case))):
            return
        ((mesh, seconds),) = meshed
        for operator in step.operators:
            self._run_operator(operator, mesh, seconds, memory)

    def _run_operator(self, step: OperatorStep, mesh: BodyMesh, mesh_seconds: float, memory: PeakMemory) -> None:
        bodies: list[ElasticBody] = []
        shared = len(step.solves) > 1
        if not self._guard(step.solves, lambda: bodies.append(_elastic_body(mesh, step.case, shared=shared))):
            return
        with bodies[0] as body:
            for solve in step.solves:
                self._progress.note(str(solve.case))
                compute = partial(self._solve, solve, body, mesh, mesh_seconds, memory)
                self._record_one(solve, compute)

    def _solve(self, solve: Solve, body: ElasticBody, mesh: BodyMesh, seconds: float, memory: PeakMemory) -> Record:
        case = solve.case
        direct = is_direct(case.solve.method, body.dofs, case.mesh.degree)
        self._check_memory(estimate.solving_memory(body.dofs, case.mesh.degree, direct=direct), "solving")
        solution = body.solve(case.material.lame, method=case.solve.method, tolerance=case.solve.tolerance)
        return self._record(solve, solution, mesh.cells, seconds, memory)

    def _record(self, solve: Solve, solution: Solution, cells: int, seconds: float, memory: PeakMemory) -> Record:
        axis = solve.case.probe.axis
        return Record(
            key=solve.key,
            status="ok",
            force=-sum(f * a for f, a in zip(solution.reaction, axis, strict=True)),
            force_vector=solution.reaction,
            energy=solution.energy,
            max_strain=solution.max_strain,
            balance=solution.balance,
            dofs=solution.dofs,
            cells=cells,
            iterations=solution.iterations,
            memory=memory.peak(),
            time_mesh=seconds,
            time_assemble=solution.time_assemble,
            time_setup=solution.time_setup,
            time_solve=solution.time_solve,
            provenance=self._provenance | {"date": datetime.now(UTC).isoformat(timespec="seconds")},
        )

    def _repeat(self, step: MeshStep, repeats: int, memory: PeakMemory) -> Record:
        """Compute a case afresh several times; its times are the medians."""
        (solve,) = step.solves
        records = []
        for _ in range(repeats):
            mesh, seconds = self._mesh(solve.case)
            with _elastic_body(mesh, solve.case, shared=False) as body:
                records.append(self._solve(solve, body, mesh, seconds, memory))
            del mesh, body
            gc.collect()
        names = ("time_mesh", "time_assemble", "time_setup", "time_solve")
        return replace(records[-1], **{n: statistics.median(getattr(r, n) for r in records) for n in names})

    def _mesh(self, case: Case) -> tuple[BodyMesh, float]:
        """Return the distributed mesh of a case and the seconds that it took; collective."""
        self._progress.note(f"meshing: {case}")
        self._check_memory(estimate.case_memory(case), "this case")
        start = MPI.Wtime()
        arrays = _on_first_rank(self.comm, lambda: _mesh_arrays(case))
        mesh = distribute(self.comm, arrays)
        return mesh, self.comm.allreduce(MPI.Wtime() - start, op=MPI.MAX)

    def _check_memory(self, needed: float, what: str) -> None:
        available = self.comm.bcast(psutil.virtual_memory().available if self.comm.rank == 0 else None)
        if needed > _MEMORY_SHARE * available:
            raise CaseFailure(
                f"{what} needs about {needed / 1e9:.1f} GB of memory, {available / 1e9:.1f} GB are available: "
                "use larger elements, or a smaller epsilon"
            )

    def _record_one(self, solve: Solve, compute: Callable[[], Record]) -> None:
        """Compute and keep a record; if that fails, keep a record of the failure."""
        done: list[Record] = []
        if self._guard((solve,), lambda: done.append(compute())):
            self._finish(solve, done[0])

    def _guard(self, solves: tuple[Solve, ...], compute: Callable[[], None]) -> bool:
        """Run ``compute``; if it fails, record the failure of ``solves``. Return whether it went well; collective.

        Failures that are raised on every rank come here; one that hits a single rank in the middle of a
        collective call leaves the others waiting, so with several ranks it must end the run (the caller aborts).
        """
        try:
            compute()
        except (CaseFailure, MeshError, SolveError) as error:
            message = str(error)
        except (MemoryError, RuntimeError) as error:
            if self.comm.size > 1:
                raise
            message = f"{type(error).__name__}: {error}"
        else:
            return True
        for solve in solves:
            self._finish(solve, Record(solve.key, "failed", message, provenance=self._provenance))
        return False

    def _finish(self, solve: Solve, record: Record) -> None:
        if record.status == "failed":
            self.failed += len(solve.serves)
        if self.comm.rank == 0:
            self._keep(record)
        self._progress.done(str(solve.case), record.message)


def _elastic_body(mesh: BodyMesh, case: Case, *, shared: bool) -> ElasticBody:
    contact = Contact(case.probe.travel, case.probe.contact == "bonded")
    return ElasticBody(mesh, case.mesh.degree, contact, shared=shared)


def _mesh_arrays(case: Case) -> MeshArrays:
    mesh, probe = case.mesh, case.probe
    epsilon = inf if case.is_full else mesh.epsilon
    column = inf if mesh.outside == "coarse" else epsilon
    sizes = Sizes(epsilon, mesh.fine, mesh.coarse, mesh.rim_size(probe.half_width), mesh.growth, column)
    straight = mesh.degree == 1
    scene = Scene(case.body, probe, column, mesh.outside == "fixed", sizes.rim_segments(probe), straight)
    arrays = generate(scene, sizes)
    return arrays if straight else curve(arrays, scene)


def _on_first_rank(comm: MPI.Comm, compute: Callable[[], Any]) -> Any:
    """Return what ``compute`` gives on rank 0, None elsewhere; its failure is raised on every rank."""
    result, message = None, None
    if comm.rank == 0:
        try:
            result = compute()
        except MeshError as error:
            message = str(error)
        except (MemoryError, RuntimeError) as error:
            message = f"{type(error).__name__}: {error}"
    message = comm.bcast(message)
    if message is not None:
        raise MeshError(message)
    return result
