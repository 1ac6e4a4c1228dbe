"""Run a plan on a communicator, and return the record of each case as soon as it exists."""

from collections.abc import Collection, Mapping

from mpi4py import MPI

from epsmesh.plan.plan import Plan
from epsmesh.plan.schedule import schedule
from epsmesh.plan.steps import mesh_steps
from epsmesh.run.begun import Begun
from epsmesh.run.compile import prepare
from epsmesh.run.completion import complete
from epsmesh.run.desk import Desk, Keep, apart
from epsmesh.run.groups import run_phase
from epsmesh.run.memory import FreeMemory, keep_imports, return_large_arrays
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.progress import Progress
from epsmesh.run.record import Record
from epsmesh.run.runner import StepRunner
from epsmesh.run.stop import waves
from epsmesh.run.threads import one_thread


def execute(
    plan: Plan,
    comm: MPI.Comm,
    keep: Keep,
    progress: Progress,
    *,
    known: Mapping[str, Record] | None = None,
    cache: MeshCache | None = None,
    begun: Begun | None = None,
    last: Collection[str] = (),
) -> int:
    """Run ``plan``; collective. ``keep`` is called on rank 0 with each record, as soon as it arrives there.

    ``known`` are rank 0's stored records of the plan; ``cache`` caches meshes; ``begun`` notes the cases under way, on
    each rank. Steps with keys in ``last`` (rank 0's) run after the others. Returns the number of failed cases, the same
    on every rank; each has a record with its message.
    """
    keep_imports()
    return_large_arrays()
    records, delayed = comm.bcast((dict(known or {}), frozenset(last)))
    desk = Desk(plan, keep if comm.rank == 0 else None, progress, records)

    def make(group: MPI.Comm, post: Keep) -> StepRunner:
        notes = begun or Begun()
        return StepRunner(plan, group, keep=post, progress=progress, begun=notes, cache=cache, ranks=comm.size)

    with one_thread():
        for wave in waves(plan, plan.solves):
            todo = tuple(solve for solve in wave if not desk.skips(solve))
            prepare(comm, todo)
            memory = FreeMemory(comm).available()
            steps = mesh_steps(todo, shared=plan.shared)
            for group in apart(steps, delayed):
                for phase in schedule(group, comm.size, plan.cost, memory, apart=plan.study.solve.timing):
                    run_phase(comm, phase, make, desk.take)
            desk.records = comm.bcast(desk.records)
    return desk.failed


def compute(plan: Plan, comm: MPI.Comm) -> dict[str, Record]:
    """Run ``plan`` without a store and return its records by key, on every rank; collective.

    Further places along paths are solved, too, and the others interpolated, and depths at given forces are found; not
    the further states of insertions.
    """
    records: dict[str, Record] = {}

    def keep(record: Record) -> None:
        records[record.key] = record

    todo: Plan | None = plan
    while todo:
        execute(todo, comm, keep, Progress())
        records.update(comm.bcast(records))
        todo = complete(plan, records, lambda _: {}) if plan.place_paths or plan.study.seeks_depths else None
    return records
