"""Run the steps of a plan on one communicator: mesh, operators, solves, and a record of each."""

import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from math import nan
from typing import TypeVar

from mpi4py import MPI

from epsmesh.mesh.distribute import BodyMesh
from epsmesh.plan import estimate
from epsmesh.plan.plan import Plan
from epsmesh.plan.steps import MOST_DOFS, MeshStep, OperatorStep, Solve, mesh_steps
from epsmesh.plan.symmetry import model_planes
from epsmesh.run.attempts import Attempts
from epsmesh.run.basis import reduced_records
from epsmesh.run.begun import Begun
from epsmesh.run.compile import prepare
from epsmesh.run.failure import AloneError, Attempt, Failure
from epsmesh.run.far_field import share_far_fields
from epsmesh.run.measure import TIMES, record_of
from epsmesh.run.memory import FreeMemory, PeakMemory, give_back
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.meshing import mesh_case, on_first_rank
from epsmesh.run.outputs import with_fields
from epsmesh.run.problem import (
    check_memory,
    lacks_memory,
    memory_of,
    memory_of_basis,
    meridian_problem,
    problem_of,
    solve_problem,
)
from epsmesh.run.progress import MESHING, Progress
from epsmesh.run.provenance import provenance
from epsmesh.run.record import BARS, Record
from epsmesh.run.room import machine_load
from epsmesh.solve.contact.sweep import NEAR
from epsmesh.solve.newton import LargeError
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.unloaded import show_image
from epsmesh.stages import Times, recorded
from epsmesh.states import FAILED, PARTIAL

T = TypeVar("T")
Keep = Callable[[Record], None]


@dataclass(frozen=True)
class Meshed:
    """A mesh that solves share: its spaces, the times of its making, and the peak memory since its start."""

    spaces: Spaces
    times: Times
    memory: PeakMemory


class StepRunner:
    """Runs mesh steps on one communicator; call ``free`` at the end, collectively.

    ``keep`` is called on its rank 0 with each record; ``begun`` notes the cases under way, on each rank; ``ranks`` is
    the number of ranks of the whole run.
    """

    def __init__(
        self,
        plan: Plan,
        comm: MPI.Comm,
        *,
        keep: Keep,
        progress: Progress,
        begun: Begun,
        cache: MeshCache | None,
        ranks: int,
    ):
        self._plan, self._comm, self._keep, self._progress, self._cache = plan, comm, keep, progress, cache
        self._begun, self._attempt = begun, Attempt(comm)
        self._provenance = provenance(ranks)
        self._free = FreeMemory(comm)
        self._attempts = Attempts()
        self._has_far_fields = False
        self._records: dict[str, Record] = {}
        self._keys: list[str] = []

    def run(self, step: MeshStep) -> None:
        """Compute every case of a mesh step, and record each; collective.

        A case whose error bar exceeds its accuracy is tried again at once, with the next mesh.
        """
        todo = [step]
        while todo:
            following = todo.pop(0)
            found = self._caught(partial(self._way_of(following), following, PeakMemory(self._comm)))
            if isinstance(found, Failure):
                self._fail([solve for solve in following.solves if not self._is_settled(solve)], found)
            give_back(self._comm)
            if again := self._attempts.take_again():
                prepare(self._comm, again)
                todo += mesh_steps(again, shared=self._plan.shared)

    def free(self) -> None:
        """Free the communicators; collective."""
        self._attempt.free()

    def _is_settled(self, solve: Solve) -> bool:
        """Return whether a solve has its record, or will get it on another mesh."""
        return solve.key in self._records or self._attempts.has_next(solve)

    def _way_of(self, step: MeshStep) -> Callable[[MeshStep, PeakMemory], None]:
        if step.axisymmetric:
            return self._on_meridians
        return self._timed if step.case.solve.timing else self._on_mesh

    def _on_mesh(self, step: MeshStep, memory: PeakMemory) -> None:
        """Mesh once, and solve every operator on it."""
        self._begin(*step.solves)
        with recorded() as times:
            mesh = self._caught(lambda: self._mesh(step.solves[0]))
        if isinstance(mesh, Failure):
            self._fail(step.solves, mesh)
            return
        with Spaces(mesh) as spaces:
            for operator in step.operators:
                self._operate(operator, Meshed(spaces, times, memory))

    def _operate(self, step: OperatorStep, meshed: Meshed) -> None:
        """Solve every material of an operator, or a few of them and the others by a reduced basis."""
        self._begin(*step.solves)
        first = step.solves[0]
        condense, reuse = self._condenses(step, meshed.spaces.body), self._plan.reuse
        problem = self._caught(lambda: problem_of(meshed.spaces, first.meshed_case, reuse=reuse, condense=condense))
        if isinstance(problem, Failure):
            self._fail(step.solves, problem)
            return
        if step.case.has_own_far_field:
            self._share_far_fields()
        with problem:
            if first.reduced:
                self._reduce(step, problem, meshed)
            for solve in _in_order(step, condensed=condense) if reuse or condense else step.solves:
                if solve.key not in self._records:
                    self._record(solve, partial(self._solve, solve, problem, meshed))
        show_image(problem.spaces.body)

    def _share_far_fields(self) -> None:
        """Compute the far fields of all places at once; if this fails, each is computed alone. Collective."""
        plan = self._plan
        if plan.shared and not self._has_far_fields:
            self._has_far_fields = True
            self._caught(lambda: share_far_fields(solve.case for solve in plan.solves))

    def _reduce(self, step: OperatorStep, problem: QuasiStaticProblem, meshed: Meshed) -> None:
        """Solve a few cases and get the others from their reduced basis; if it fails, they remain to be solved."""

        def compute(solve: Solve) -> Record | None:
            self._record(solve, partial(self._solve, solve, problem, meshed))
            record = self._records[solve.key]
            return record if record.is_ok else None

        tolerance = self._plan.study.planning.reduced_basis_error
        if missing := lacks_memory(self._free.available(), memory_of_basis(step.case, problem.dofs), "it"):
            found: Failure | None = Failure(missing)
        else:
            found = self._caught(lambda: reduced_records(step.solves, problem, tolerance, compute, self._finish))
        if isinstance(found, Failure):
            self._progress.note(f"no reduced basis, each case is solved: {found.message}")

    def _on_meridians(self, step: MeshStep, memory: PeakMemory) -> None:
        """Solve axisymmetric scenes in two dimensions, on the first rank, each on its own mesh."""
        for solve in step.solves:
            self._record(solve, partial(self._solve_meridian, solve, memory))

    def _timed(self, step: MeshStep, memory: PeakMemory) -> None:
        for solve in step.solves:
            self._record(solve, partial(self._repeated, solve, memory))

    def _repeated(self, solve: Solve, memory: PeakMemory) -> Record:
        """Compute a case from scratch several times; its times are the medians. The error bar follows, untimed.

        With an accuracy, the error bar is part of the timed work.
        """
        has_goal = solve.goal is not None
        records = [self._afresh(solve, memory, has_bar=has_goal) for _ in range(solve.case.solve.repeats)]
        medians = {n: statistics.median(getattr(r, n) for r in records) for n in (*TIMES, "time_error")}
        record = replace(records[-1], **medians, time_spread=_spread([r.time_total for r in records]))
        if has_goal:
            return record
        other = self._afresh(replace(solve, mirrors=model_planes(solve.case)), memory)
        seconds = other.time_total + other.time_error
        bars = {name: getattr(other, name) for name in BARS}
        return replace(record, **bars, time_error=seconds, message=other.message)

    def _afresh(self, solve: Solve, memory: PeakMemory, *, has_bar: bool = True) -> Record:
        """Compute one case from scratch, with its mesh; collective."""
        with recorded() as times:
            mesh = self._mesh(solve)
        with Spaces(mesh) as spaces, problem_of(spaces, solve.meshed_case) as problem:
            record = self._solve(solve, problem, Meshed(spaces, times, memory), has_bar=has_bar)
        del mesh, spaces, problem
        give_back(self._comm)
        return record

    def _solve(self, solve: Solve, problem: QuasiStaticProblem, meshed: Meshed, *, has_bar: bool = True) -> Record:
        """Return the record of a solve, with its error bar if the memory is enough; collective.

        Raises:
            CaseFailure: if there is too little memory for the solve, or for the error bar that an accuracy needs.
        """
        needed, with_bar = memory_of(solve.case, problem.dofs)
        available = self._free.available()
        check_memory(available, needed, "solving")
        if has_bar and solve.goal is not None:
            check_memory(available, with_bar, "the error bar that proves the accuracy")
        missing = lacks_memory(available, with_bar, "the error bar") if has_bar else ""
        has_bar = has_bar and not missing
        solution = solve_problem(solve.case, problem, estimate=has_bar, meshed=solve.meshed_case)
        record = record_of(solve, solution, meshed.times.mesh)
        record, notes = with_fields(solve, problem, problem.spaces, record, has_bar=has_bar)
        missing = "; ".join(filter(None, (missing, notes, solution.contact.note if solution.contact else "")))
        stamped = self._stamp(record, meshed.memory)
        return replace(stamped, message=missing, surface_deviation=meshed.spaces.body.deviation)

    def _solve_meridian(self, solve: Solve, memory: PeakMemory) -> Record:
        problem = meridian_problem(solve.case, solve.goal)

        def compute() -> Record | LargeError:
            try:
                return record_of(solve, solve_problem(solve.case, problem, estimate=True, goal=solve.goal))
            except LargeError as error:
                return error

        found = self._comm.bcast(on_first_rank(self._comm, compute))
        if isinstance(found, LargeError):  # with the depth that its path reached
            raise found
        return self._stamp(found, memory)

    def _mesh(self, solve: Solve) -> BodyMesh:
        """Return the distributed mesh of a solve; collective. Timing studies do not use the cache."""
        case = solve.meshed_case
        self._progress.note(f"{MESHING}{solve.label}")
        check_memory(
            self._free.available(), estimate.case_memory(case, share=0.5 ** len(solve.mirrors)), "this case", case
        )
        return mesh_case(case, solve.mirrors, self._comm, None if case.solve.timing else self._cache)

    def _condenses(self, step: OperatorStep, mesh: BodyMesh) -> bool:
        """Return whether many depths are solved by condensation: of a small body, on one rank; collective."""
        size = estimate.dofs(mesh.cells, step.case.mesh.degree)
        needed = estimate.solving_memory(size, step.case.mesh.degree, direct=True)
        is_small = self._comm.size == 1 and size <= MOST_DOFS
        return (
            self._plan.condensed
            and step.is_condensed
            and is_small
            and not lacks_memory(self._free.available(), needed, "")
        )

    def _stamp(self, record: Record, memory: PeakMemory) -> Record:
        date = datetime.now(UTC).isoformat(timespec="seconds")
        where = self._provenance | {"date": date}
        return replace(record, memory=memory.peak(), load=machine_load(), group=self._comm.size, provenance=where)

    def _record(self, solve: Solve, compute: Callable[[], Record]) -> None:
        """Compute and keep a record, or a record of the failure."""
        self._progress.note(solve.label)
        self._begin(solve)
        found = self._caught(compute)
        if isinstance(found, Failure):
            self._fail((solve,), found)
        else:
            self._finish(solve, found)

    def _begin(self, *solves: Solve) -> None:
        self._keys = [solve.key for solve in solves if not self._is_settled(solve)]
        self._begun.name(self._keys)

    def _fail(self, solves: Sequence[Solve], failure: Failure) -> None:
        for solve in solves:
            record = Record(solve.key, FAILED, failure.message, provenance=self._provenance)
            self._finish(solve, record if failure.reached is None else _partial(solve, record, *failure.reached))

    def _finish(self, solve: Solve, record: Record) -> None:
        """Keep a record, unless another mesh follows."""
        judged = self._attempts.judge(solve, record)
        if judged is not None:
            self._records[judged.key] = judged
            if self._comm.rank == 0:
                self._begun.done(judged)
                self._keep(judged)

    def _caught(self, compute: Callable[[], T]) -> T | Failure:
        """Return the result of ``compute``, or why it failed; collective.

        If the other ranks do not answer, the run ends, and the next run reads which cases failed, and why.
        """
        try:
            return self._attempt(compute)
        except AloneError as error:
            self._begun.name(self._keys, str(error))
            raise


def _spread(seconds: list[float]) -> float:
    """Return the range of times relative to their median; NaN for one."""
    return (max(seconds) - min(seconds)) / statistics.median(seconds) if len(seconds) > 1 else nan


def _in_order(step: OperatorStep, *, condensed: bool) -> Iterator[Solve]:
    """Yield the solves of an operator; if contact is found or displacements are large, by material and depth.

    With condensation a depth costs less than its error bar, so some depths use the bars of others, which come first.
    """
    if not step.case.way.is_followed:
        yield from step.solves
        return
    for sweep in step.sweeps:
        first = _with_own_bars(sweep) if condensed else ()
        yield from first
        yield from (solve for solve in sweep if solve not in first)


def _with_own_bars(sweep: tuple[Solve, ...]) -> tuple[Solve, ...]:
    """Return the depths with their own error bars: the least, the largest, and the fewest needed in between."""
    chosen = [sweep[0]]
    for this, following in zip(sweep, (*sweep[1:], None), strict=True):
        if following is None or following.case.probe.depth > NEAR * chosen[-1].case.probe.depth:
            chosen.append(this)
    return tuple(dict.fromkeys(chosen))


def _partial(solve: Solve, record: Record, depth: float, force: float) -> Record:
    """Return ``record`` of a solve whose load steps ended at a ``depth`` (m) and ``force`` (N)."""
    young, asked = solve.case.scale.stress, solve.case.scale.length
    return replace(record, status=PARTIAL, young=young, depth=asked, depth_reached=depth, force_reached=force)
