"""A study from plan to dataset, on a communicator: store, execution, interruption, results."""

import signal
import threading
import time
import traceback
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from epsmesh.alone import Alone, Jobs
from epsmesh.errors import CompilerError
from epsmesh.launcher import is_launched
from epsmesh.plan.cost import CostModel
from epsmesh.plan.plan import Plan, leave_out_stored, make_plan
from epsmesh.plan.shard import Shard
from epsmesh.printable import counted
from epsmesh.report.publish import Results, ResultsError, publish
from epsmesh.run.begun import ENDING, Begun, fail_begun, store_done
from epsmesh.run.completion import complete
from epsmesh.run.merge import merge
from epsmesh.run.outbox import Outbox
from epsmesh.run.outcome import count_states, failures
from epsmesh.run.progress import Progress, Terminal
from epsmesh.run.reading import open_to_read
from epsmesh.run.record import Record
from epsmesh.run.registry import Registered
from epsmesh.run.store import Store, StoreError
from epsmesh.stages import stage
from epsmesh.states import SKIPPED
from epsmesh.study.sweep import Study

if TYPE_CHECKING:
    import xarray as xr
    from mpi4py import MPI

Show = Callable[[Plan], Terminal]

# Seconds that the first rank has, when a parallel run is interrupted, to write what is finished.
_GRACE = 15
# Within so many seconds a second signal is the first one again: sent to a group of processes, and passed on by one.
_ECHO = 0.5


@dataclass
class Opened:
    """The case store of a run, on rank 0 (None elsewhere), the records read from it, and the folder of its meshes."""

    store: Store | None = None
    meshes: Path | None = None
    records: dict[str, Record] = field(default_factory=dict)
    begun: Begun = field(default_factory=Begun)
    again: frozenset[str] = frozenset()  # cases with which a process ended once: they come last
    notices: tuple[str, ...] = ()  # what the user should know of the store
    is_fresh: bool = False  # nothing is read from it


@dataclass(frozen=True)
class Outcome:
    """What came of a run. ``failures`` (case, message) and ``results`` are rank 0's, the rest is every rank's."""

    counts: dict[str, int]
    failures: tuple[tuple[str, str], ...]
    results: Results
    interrupted: bool


def world() -> "MPI.Comm":
    """Return the communicator of all ranks: what a run is given, unless its caller says otherwise.

    Without MPI, what needs no solver goes on alone.

    Raises:
        ModuleNotFoundError: if there are several ranks, and no MPI.
    """
    try:
        from epsmesh.mpi import MPI  # noqa: PLC0415 (it starts as it is imported)
    except ModuleNotFoundError:
        if is_launched():
            raise
        return cast("MPI.Comm", Alone())
    return MPI.COMM_WORLD


def prepare(
    study: Study,
    comm: "MPI.Comm",
    store_path: Path,
    *,
    fresh: bool = False,
    without: Collection[str] = (),
    meshes: Path | None = None,
    shard: Shard | None = None,
    beside: Sequence[Path] = (),
) -> tuple[Plan, Opened]:
    """Open the case store and plan, on every rank alike, what is not on record; collective.

    ``fresh`` computes again what is stored; a timing study always does, but for F_exact. ``without`` names reductions
    that are not to be used. A ``shard`` plans its own part only, and reads the stores ``beside`` its own, too; a whole
    study takes the records of those, its shards', into its store. A case with which the process of an earlier run ended
    is tried again, after all others. If a process ended with it twice it has failed: this run leaves it out, and the
    next one tries it again.

    Raises:
        StoreError: on every rank, if the store cannot be used.
    """
    opened, message, cost = Opened(meshes=meshes, begun=Begun(store_path), is_fresh=fresh), "", CostModel()
    declared = make_plan(study, without=without, shard=shard)
    own = declared.all_keys if declared.part is None else declared.part
    if comm.rank == 0:
        try:
            opened.store = Store(store_path)
            merged = merge(beside, opened.store) if beside and not (shard or fresh) else ()
            store_done(opened.store)
            cost = opened.store.cost_model()
            if not fresh:
                wanted = own - {*declared.keys} if study.solve.timing else own
                found = opened.store.get(wanted)
                opened.records = {key: record for key, record in found.items() if record.is_ok}
                for path in beside if shard else ():
                    opened.records = _known_beside(path, wanted) | opened.records
            ended = fail_begun(opened.store, own)
            opened.again = ended.again - opened.records.keys()
            what_ended = _what_ended(len(ended.failed.keys() - opened.records.keys()), len(opened.again))
            opened.records = ended.failed | opened.records
            problems = [problem for source in merged for problem in source.problems]
            opened.notices = tuple(filter(None, (opened.store.notice, *problems, what_ended)))
        except StoreError as error:
            message = str(error)
    message, stored, cost = comm.bcast((message, sorted(opened.records), cost))
    if message:
        raise StoreError(message)
    return replace(leave_out_stored(declared, stored, without), cost=cost), opened


def run(plan: Plan, opened: Opened, comm: "MPI.Comm", output: Path, show: Show | None = None) -> Outcome:
    """Carry out ``plan`` and write ``<study>.nc`` and its figure into ``output``, unless it is a shard's; collective.

    What insertions and interpolated paths need besides is planned once their first solves are known; ``show`` makes the
    progress of each plan.

    Ctrl-C, and the request to end that mpirun or a batch system sends, end it with what is finished written.

    Raises:
        ResultsError: if the results cannot be written.
    """
    start = _now()
    interrupted = _compute(plan, opened, comm, show and show(plan))
    while not interrupted and plan.part is None and (further := _lacking(plan, opened, comm)):
        interrupted = _compute(further, opened, comm, show and show(further))
    results = Results()
    wrong: ResultsError | None = None
    if opened.store is not None:
        opened.store.close()
        if plan.part is None:
            try:
                with stage("results"):
                    results = publish(plan, opened.records, {"start": start, "end": _now()}, output)
            except ResultsError as error:
                wrong = error
    counts = count_states(plan, opened.records)
    if not interrupted:
        counts, wrong = comm.bcast((counts, wrong))
    if wrong:
        raise wrong
    return Outcome(counts, failures(plan, opened.records), results, interrupted)


def solve(study: Study, comm: "MPI.Comm", store: Path, progress: Terminal | None = None) -> "xr.Dataset":
    """Return the dataset of a study on every rank, without writing it: of forces that another result is made of.

    Cases are read from the store, and kept in it, as those of a run; collective.

    Raises:
        StoreError: on every rank, if the store cannot be used.
        KeyboardInterrupt: if it was interrupted; what was finished is on record.
    """
    from epsmesh.report.dataset import build  # noqa: PLC0415 (it loads xarray)

    plan, opened = prepare(study, comm, store)
    with abort_on_exception(comm):
        interrupted = _compute(plan, opened, comm, progress)
        while not interrupted and (further := _lacking(plan, opened, comm)):
            interrupted = _compute(further, opened, comm, None)
        if opened.store is not None:
            opened.store.close()
        if interrupted:
            end_ranks(comm, 130)
            raise KeyboardInterrupt
        dataset: xr.Dataset = comm.bcast(build(plan, opened.records) if comm.rank == 0 else None)
    return dataset


def load_solvers() -> None:
    """Load what solves, which takes seconds, and leave signals to Python.

    As they load, gmsh takes Ctrl-C for itself, and PETSc a reader that goes away for a crash.
    """
    before = signal.getsignal(signal.SIGINT)
    import epsmesh.run.execute  # noqa: F401, PLC0415

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler if before is signal.SIG_DFL else before)
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


def end_ranks(comm: "MPI.Comm", status: int) -> None:
    """End every rank of an interrupted run: some may wait in a call that will never be answered."""
    if comm.size > 1:
        if comm.rank != 0:
            time.sleep(_GRACE)
        comm.Abort(status)


@contextmanager
def abort_on_exception(comm: "MPI.Comm", *agreed: type[Exception]) -> Iterator[None]:
    """End all ranks when one of them meets an error that nobody handles: the others would wait for ever.

    Exceptions that are ``agreed`` are those that every rank raises.
    """
    try:
        yield
    except Exception as error:
        if comm.size == 1 or isinstance(error, (CompilerError, ResultsError, *agreed)):
            raise
        traceback.print_exc()
        comm.Abort(1)


@contextmanager
def ended_at_once() -> Iterator[None]:
    """Let the signals that ask the program to end do so, also in a library's call: for what keeps all it has."""
    with _heard_by(signal.SIG_DFL):
        yield


@contextmanager
def ended_soon() -> Iterator[None]:
    """Turn the signals that ask the program to end into KeyboardInterrupt: for what has no records to write."""

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    with _heard_by(interrupt):
        yield


def _compute(plan: Plan, opened: Opened, comm: "MPI.Comm", progress: Terminal | None) -> bool:
    """Carry out ``plan``, and return whether it was interrupted; collective."""
    if plan.solves and not isinstance(comm, Jobs):
        load_solvers()  # before signals are handled
    try:
        with _interruptible() as signals:
            _execute(plan, opened, comm, progress, signals)
    except KeyboardInterrupt:
        if opened.store:  # what other ranks have finished
            opened.records |= {key: one for key, one in store_done(opened.store).items() if key in plan.all_keys}
        return True
    return False


def _lacking(plan: Plan, opened: Opened, comm: "MPI.Comm") -> Plan | None:
    """Return the plan of what is needed besides ``plan`` and what is not stored; collective: see ``complete``.

    Each rank makes it from the same records: a body with search trees cannot be sent.
    """

    def get(keys: Collection[str]) -> dict[str, Record]:
        found: dict[str, Record] = {}
        if opened.store:
            stored = {} if opened.is_fresh else opened.store.get(keys)
            ended = fail_begun(opened.store, keys)
            found = ended.failed | {key: record for key, record in stored.items() if record.is_ok}
            opened.again = (opened.again | ended.again) - found.keys()
        return comm.bcast(found)

    known = comm.bcast(opened.records)
    return complete(plan, opened.records if comm.rank == 0 else known, get)


def _execute(plan: Plan, opened: Opened, comm: "MPI.Comm", progress: Terminal | None, signals: list[int]) -> None:
    registered = Registered(opened.store.path, plan, progress or Progress()) if opened.store else None
    if not plan.solves:
        with registered or nullcontext():
            return
    outbox = Outbox(opened.store, plan) if opened.store else None

    def keep(record: Record) -> None:
        assert outbox is not None
        if record.status != SKIPPED:  # why it was depends on this study
            outbox.put(record)
        opened.records[record.key] = record
        if signals:
            raise KeyboardInterrupt

    if isinstance(comm, Jobs):
        from epsmesh.run import jobs  # noqa: PLC0415

        assert opened.store and outbox and registered
        # Forked before the progress has a thread; ended when all records are in the store.
        workers = jobs.Workers(plan, comm.count, opened.store.path, opened.meshes)
        with workers, progress or nullcontext(), registered, outbox:
            ended = partial(fail_begun, opened.store)
            jobs.execute(plan, workers, keep, registered, ended, known=opened.records, last=opened.again)
        return
    from epsmesh.run.execute import execute  # noqa: PLC0415
    from epsmesh.run.mesh_cache import MeshCache  # noqa: PLC0415

    cache = MeshCache(opened.meshes) if opened.meshes else None
    with progress or nullcontext(), registered or nullcontext(), opened.begun as begun:
        with outbox or nullcontext():
            execute(
                plan,
                comm,
                keep,
                registered or Progress(),
                known=opened.records,
                cache=cache,
                begun=begun,
                last=opened.again,
            )
        comm.barrier()  # each rank keeps its own files until all records are in the store


@contextmanager
def _interruptible() -> Iterator[list[int]]:
    """Turn the signals that ask the program to end into KeyboardInterrupt; yield the list of those received.

    An exception raised while Python frees an object is lost: whoever has time looks at the list.
    """
    received: list[int] = []
    first = 0.0

    def interrupt(number: int, _: Any) -> None:
        nonlocal first
        if received and time.monotonic() - first < _ECHO:
            return
        first = time.monotonic()
        received.append(number)
        raise KeyboardInterrupt

    with _heard_by(interrupt):
        yield received


@contextmanager
def _heard_by(handler: Callable[..., None] | signal.Handlers) -> Iterator[None]:
    """Let ``handler`` answer what asks the program to end: Ctrl-C and SIGTERM, and a closed terminal but for nohup."""
    before = {number: signal.getsignal(number) for number in ENDING}
    if before[signal.SIGHUP] is signal.SIG_IGN:
        del before[signal.SIGHUP]
    try:
        for number in before:
            signal.signal(number, handler)
        yield
    finally:
        for number, answer in before.items():
            signal.signal(number, answer)


def _what_ended(failed: int, again: int) -> str:
    """Say that an earlier run was killed while it solved cases that have ``failed``, or are solved ``again``."""
    found = []
    if failed:
        found.append(f"{counted(failed, 'case')} failed, after two attempts; the next run tries again")
    if again:
        found.append(f"{counted(again, 'case')} will be solved after the others")
    return f"an earlier run was killed while it solved cases: {'; '.join(found)}" if found else ""


def _known_beside(path: Path, keys: Collection[str]) -> dict[str, Record]:
    """Return the forces on record in another store; without a readable one the work is done again, no more."""
    try:
        with open_to_read(path) as other:
            return {key: record for key, record in other.get(keys).items() if record.is_ok}
    except StoreError:
        return {}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
