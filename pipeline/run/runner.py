"""Carry out the steps of a plan on one communicator: mesh, operators, solves, and a record of each."""

import statistics
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial

from mpi4py import MPI

from pipeline.mesh.distribute import BodyMesh
from pipeline.mesh.generate import MeshError
from pipeline.plan import estimate
from pipeline.plan.plan import Plan
from pipeline.plan.steps import MeshStep, OperatorStep, Solve, mesh_steps
from pipeline.plan.symmetry import model_planes
from pipeline.run.body import Body, CaseFailure, body_of, check_memory, lacks_memory, solve_body
from pipeline.run.compile import prepare
from pipeline.run.measure import TIMES, add_times, record_of, record_of_meridian
from pipeline.run.memory import FreeMemory, PeakMemory, give_back
from pipeline.run.mesh_cache import MeshCache
from pipeline.run.meshing import meridian_of, mesh_case, on_first_rank
from pipeline.run.progress import Progress
from pipeline.run.provenance import provenance
from pipeline.run.record import Record
from pipeline.run.reduce import reduced_records
from pipeline.solve.axisymmetric import solve_axisymmetric
from pipeline.solve.elasticity import ElasticBody
from pipeline.solve.linear import SolveError, is_direct
from pipeline.solve.spaces import Spaces
from pipeline.study.sweep import Case

# An error bar above this says that the force is not known: it may be more than twice the true one.
_WORST_BAR = 1.0
Keep = Callable[[Record], None]


class StepRunner:
    """Carries out mesh steps on one communicator. ``keep`` is called on its rank 0 with each record.

    ``ranks`` is how many the whole run has.
    """

    def __init__(self, plan: Plan, comm: MPI.Comm, keep: Keep, progress: Progress, cache: MeshCache | None, ranks: int):
        self.comm, self._timed, self._records = comm, plan.study.solve.timing, dict[str, Record]()
        self._plan, self._keep, self._progress = plan, keep, progress
        self._cache = None if self._timed else cache
        self._provenance = provenance(ranks)
        self._free = FreeMemory(comm)
        self._retries: list[Solve] = []
        self._attempts: dict[str, list[Record]] = {}

    def run(self, step: MeshStep) -> None:
        """Compute every case of a mesh step, and record each; collective.

        Those that miss their goal are tried again at once, with the next mesh.
        """
        self._run(step)
        give_back()
        if self._retries:
            retries, self._retries = tuple(self._retries), []
            prepare(self.comm, retries)
            for again in mesh_steps(retries, shared=self._plan.shared):
                self.run(again)

    def _run(self, step: MeshStep) -> None:
        memory = PeakMemory(self.comm)
        first = step.solves[0]
        if first.axisymmetric:
            for solve in step.solves:
                self._progress.note(solve.label)
                self._record_one(solve, partial(self._solve_meridian, solve, memory))
            return
        if self._timed and not first.is_reference:
            self._record_one(first, lambda: self._repeat(first, memory))
            return
        meshed: list[tuple[BodyMesh, float]] = []
        if not self._guard(step.solves, lambda: meshed.append(self._mesh(step.case, step.mirrors))):
            return
        ((mesh, seconds),) = meshed
        with Spaces(mesh) as spaces:
            for operator in step.operators:
                self._run_operator(operator, spaces, seconds, memory)

    def _run_operator(self, step: OperatorStep, spaces: Spaces, mesh_seconds: float, memory: PeakMemory) -> None:
        bodies, mesh = list[Body](), spaces.body
        # Assembling both parts of the operator costs as much as assembling it twice, and memory for three; on one rank
        # assembly is so fast that they are never worth it.
        degree = step.case.mesh.degree
        needed = estimate.enriched_memory(estimate.dofs(mesh.cells, degree), degree, parts=True)
        shared = self.comm.size > 1 and len(step.solves) > 2 and not lacks_memory(self._free, needed, "")
        if not self._guard(
            step.solves, lambda: bodies.append(body_of(spaces, step.case, shared=shared, reuse=self._plan.reuse))
        ):
            return
        with bodies[0] as body:
            if step.solves[0].reduced and isinstance(body, ElasticBody):
                self._run_reduced(step, body, mesh, mesh_seconds, memory)
                return
            for solve in step.solves:
                self._progress.note(solve.label)
                self._record_one(solve, partial(self._solve, solve, body, mesh, mesh_seconds, memory))

    def _run_reduced(
        self, step: OperatorStep, body: ElasticBody, mesh: BodyMesh, mesh_seconds: float, memory: PeakMemory
    ) -> None:
        def compute(solve: Solve) -> Record | None:
            self._progress.note(solve.label)
            self._record_one(solve, partial(self._solve, solve, body, mesh, mesh_seconds, memory))
            record = self._records[solve.key]
            return record if record.is_ok else None

        tolerance = self._plan.study.planning.tolerance
        self._guard((), lambda: reduced_records(step.solves, body, tolerance, compute, self._finish))

    def _solve(self, solve: Solve, body: Body, mesh: BodyMesh, seconds: float, memory: PeakMemory) -> Record:
        case, degree = solve.case, solve.case.mesh.degree
        direct = is_direct(case.solve.method, body.dofs, degree)
        check_memory(self._free, estimate.solving_memory(body.dofs, degree, direct=direct), "solving")
        missing = ""
        untimed = solve.is_reference or not self._timed
        if untimed:
            missing = lacks_memory(self._free, estimate.enriched_memory(body.dofs, degree), "the error bar")
        wanted = untimed and not missing
        solution = solve_body(case, body, estimate=wanted)
        return replace(self._stamp(record_of(solve, solution, mesh.cells, seconds), memory), message=missing)

    def _solve_meridian(self, solve: Solve, memory: PeakMemory) -> Record:
        """Solve a round scene in two dimensions, on the first rank; collective."""
        case = solve.case
        compute = partial(
            solve_axisymmetric, meridian_of(case), case.material.poisson, case.probe.contact == "bonded",
            young=case.material.young, depth=case.probe.depth,
        )  # fmt: skip
        record = on_first_rank(self.comm, lambda: record_of_meridian(solve, compute()))
        return self._stamp(self.comm.bcast(record), memory)

    def _stamp(self, record: Record, memory: PeakMemory) -> Record:
        date = datetime.now(UTC).isoformat(timespec="seconds")
        return replace(record, memory=memory.peak(), group=self.comm.size, provenance=self._provenance | {"date": date})

    def _repeat(self, solve: Solve, memory: PeakMemory) -> Record:
        """Compute a case afresh several times; its times are the medians. The error bar comes after them."""
        records = [self._compute(solve, memory) for _ in range(solve.case.solve.repeats)]
        medians = {n: statistics.median(getattr(r, n) for r in records) for n in TIMES}
        self._timed = False
        try:
            bar = self._compute(replace(solve, mirrors=model_planes(solve.case.probe)), memory)
        finally:
            self._timed = True
        return replace(
            records[-1], **medians, force_error=bar.force_error, time_error=bar.time_total + bar.time_error,
            message=bar.message,
        )  # fmt: skip

    def _compute(self, solve: Solve, memory: PeakMemory) -> Record:
        """Compute one case afresh, mesh and all; collective."""
        mesh, seconds = self._mesh(solve.case, solve.mirrors)
        with Spaces(mesh) as spaces, body_of(spaces, solve.case, shared=False) as body:
            record = self._solve(solve, body, mesh, seconds, memory)
        del mesh, spaces, body
        give_back()
        return record

    def _mesh(self, case: Case, mirrors: tuple[str, ...]) -> tuple[BodyMesh, float]:
        """Return the distributed mesh of a case and the seconds that it took; collective."""
        self._progress.note(f"meshing: {case}")
        check_memory(self._free, estimate.case_memory(case, share=0.5 ** len(mirrors)), "this case")
        return mesh_case(case, mirrors, self.comm, self._cache)

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
        if solve.goal is not None and record.status == "ok":
            missed = not 0 <= record.force_error <= solve.goal
            if missed and solve.later:
                self._attempts.setdefault(solve.key, []).append(record)
                self._retries.append(solve.again())
                return
            # What several meshes took together says nothing of what one takes.
            record = replace(add_times(record, self._attempts.pop(solve.key, [])), kind="")
            if missed and not solve.is_reference:
                message = f"error bar {record.force_error:.2g} on the finest mesh tried: accuracy {solve.goal:g} missed"
                record = replace(record, status="failed", message=record.message or message)
        if record.is_ok and record.force_error > _WORST_BAR and not solve.is_reference:
            message = (
                f"error bar {100 * record.force_error:.0f} %: the mesh is too coarse for this scene; use a smaller rim"
            )
            record = replace(record, status="failed", message=message)
        self._records[record.key] = record
        if self.comm.rank == 0:
            self._keep(record)
