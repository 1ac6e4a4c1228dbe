"""Run steps side by side in processes of this machine, without MPI's launcher: `epsmesh run -j N`.

The first process loads no solver: it keeps the records, and gives the next step to each worker that is free. Workers
are forked from it, so they have the plan; each solves on one rank, as a run in one process does. If one ends, by a
crash or the out-of-memory killer, another takes its place: the case that it was at is tried again after all others, and
the rest of its step continues.
"""

import ctypes
import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, cast

from epsmesh.plan.plan import Plan
from epsmesh.plan.schedule import group_size
from epsmesh.plan.steps import MeshStep, mesh_steps
from epsmesh.run.begun import ENDING, Begun, Ended
from epsmesh.run.desk import Desk, Keep, apart
from epsmesh.run.progress import Progress
from epsmesh.run.record import Record
from epsmesh.run.room import machine_room
from epsmesh.run.stop import waves

_FORK = multiprocessing.get_context("fork")
# Seconds that a worker has to end when it is asked to; then it is killed.
_GRACE = 5.0
# Linux's prctl: the signal that a process gets when its parent ends.
_SIGNAL_OF_PARENT = 1
# Workers that may end, one after the other, before they begin a case.
_MOST_ENDS = 3
_COMPILE, _RUN, _DONE, _NOTE, _RECORD, _ERROR = range(6)  # kinds of messages

Keys = tuple[str, ...]


class WorkerError(RuntimeError):
    """Workers cannot start, or end before they begin a case."""


def execute(
    plan: Plan,
    workers: "Workers",
    keep: Keep,
    progress: Progress,
    ended: Callable[[Collection[str]], Ended],
    *,
    known: Mapping[str, Record],
    last: Collection[str],
) -> None:
    """Run ``plan``, as :func:`epsmesh.run.execute.execute` does; ``ended`` returns which cases have ended a worker.

    Raises:
        CompilerError: if no C compiler works here.
        StoreError: if the store cannot be written.
        WorkerError: if workers end before they begin a case.
    """
    desk = Desk(plan, keep, progress, dict(known))
    for wave in waves(plan, plan.solves):
        todo = tuple(solve for solve in wave if not desk.skips(solve))
        for _ in workers.serve(_COMPILE, deque([tuple(solve.key for solve in todo)]), 1, desk, progress):
            raise WorkerError("a process ended while it compiled; without --jobs it can be seen why")
        for steps in apart(mesh_steps(todo, shared=plan.shared), last):
            for queue, at_once in _at_once(steps, plan, workers.count):
                _run(workers, queue, at_once, desk, progress, ended)


def _at_once(steps: Sequence[MeshStep], plan: Plan, count: int) -> Iterator[tuple[deque[Keys], int]]:
    """Yield the steps, the costliest first, with the number of workers for which there is memory."""
    room = machine_room()
    estimates = [plan.cost.step(step) for step in steps]
    sizes = [group_size(one, count, inf, room) for one in estimates]
    dearest = sorted(zip(sizes, estimates, steps, strict=True), key=lambda one: -one[1].seconds)
    for size in sorted({*sizes}, reverse=True):
        yield deque(tuple(s.key for s in step.solves) for own, _, step in dearest if own == size), -(-count // size)


def _run(
    workers: "Workers",
    queue: deque[Keys],
    at_once: int,
    desk: Desk,
    progress: Progress,
    ended: Callable[[Collection[str]], Ended],
) -> None:
    """Run steps, some ``at_once``; then, one by one, the cases that ended a worker."""
    again: deque[Keys] = deque()
    ends = 0
    while queue or again:
        if not queue:
            queue, again, at_once = again, deque(), 1
        for keys in workers.serve(_RUN, queue, at_once, desk, progress):  # of a worker that has ended
            left = tuple(key for key in keys if key not in desk.records)
            found = ended(left)
            for record in found.failed.values():
                desk.take(record)
            again.extend((key,) for key in left if key in found.again)
            if rest := tuple(key for key in left if key not in found.again and key not in found.failed):
                queue.append(rest)
            ends = 0 if len(rest) < len(left) else ends + 1
            if ends > _MOST_ENDS:
                raise WorkerError("processes end before they begin a case; without --jobs it can be seen why")


@dataclass
class Workers:
    """``count`` processes that wait for steps of a ``plan``; a context manager, which ends them.

    They note the cases under way beside the ``store``, and cache ``meshes`` in a folder.
    """

    plan: Plan
    count: int
    store: Path
    meshes: Path | None

    def __enter__(self) -> "Workers":
        if "mpi4py.MPI" in sys.modules:
            raise WorkerError("MPI has started in this process, which cannot be forked any more")
        self._processes: dict[Connection, Any] = {}
        for _ in range(self.count):
            self._start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for connection, process in self._processes.items():
            with suppress(OSError):
                connection.send(None) if kind is None else process.terminate()
        for process in self._processes.values():
            process.join(_GRACE)
            process.kill()
            process.join()

    def serve(self, what: int, queue: deque[Keys], at_once: int, desk: Desk, progress: Progress) -> Iterator[Keys]:
        """Compile or run what is in a ``queue``; yield the keys of workers that have ended."""
        busy: dict[Connection, Keys] = {}
        while queue or busy:
            free = [one for one in self._processes if one not in busy]
            for connection in free[: min(at_once - len(busy), len(queue))]:
                busy[connection] = queue.popleft()
                with suppress(OSError):  # it has ended, which is read below
                    connection.send((what, busy[connection]))
            for connection in cast("list[Connection]", wait([*busy])):
                try:
                    kind, found = connection.recv()
                except (EOFError, OSError):
                    self._replace(connection)
                    yield busy.pop(connection)
                    continue
                if kind == _RECORD:
                    desk.take(found)
                elif kind == _NOTE:
                    progress.note(found)
                elif kind == _ERROR:
                    raise found
                else:
                    del busy[connection]

    def _start(self) -> None:
        here, there = _FORK.Pipe()
        process = _FORK.Process(target=_work, args=(self, there), daemon=True)
        process.start()
        there.close()
        self._processes[here] = process

    def _replace(self, connection: Connection) -> None:
        self._processes.pop(connection).join()
        connection.close()
        self._start()


@dataclass
class _Notes(Progress):
    """Progress that tells the first process of the present work."""

    connection: Connection

    def note(self, text: str) -> None:
        """Report the present work."""
        self.connection.send((_NOTE, text))


def _work(workers: Workers, connection: Connection) -> None:
    """Do what the first process asks for, in a process of its own, until it asks for no more, or ends."""
    ctypes.CDLL(None).prctl(_SIGNAL_OF_PARENT, signal.SIGTERM)
    try:
        _serve(workers, connection)
    except (KeyboardInterrupt, EOFError, BrokenPipeError, ConnectionResetError):
        os._exit(0)
    except Exception as error:
        with suppress(OSError):
            connection.send((_ERROR, error))


def _serve(workers: Workers, connection: Connection) -> None:
    from epsmesh.mpi import MPI  # noqa: PLC0415 (only workers load solvers)
    from epsmesh.run.compile import prepare  # noqa: PLC0415
    from epsmesh.run.memory import keep_imports, return_large_arrays  # noqa: PLC0415
    from epsmesh.run.mesh_cache import MeshCache  # noqa: PLC0415
    from epsmesh.run.runner import StepRunner  # noqa: PLC0415
    from epsmesh.run.threads import one_thread  # noqa: PLC0415

    for number in ENDING:  # after gmsh was loaded, which takes Ctrl-C for itself
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # of which PETSc makes a crash
    keep_imports()
    return_large_arrays()
    plan = workers.plan
    solves = {solve.key: solve for solve in plan.solves}
    with Begun(workers.store) as begun, one_thread():
        runner = StepRunner(
            plan,
            MPI.COMM_SELF,
            keep=lambda record: connection.send((_RECORD, record)),
            progress=_Notes(connection),
            begun=begun,
            cache=MeshCache(workers.meshes) if workers.meshes else None,
            ranks=workers.count,
        )
        while asked := connection.recv():
            what, keys = asked
            chosen = [solves[key] for key in keys]
            if what == _COMPILE:
                prepare(MPI.COMM_SELF, chosen)
            else:
                for step in mesh_steps(chosen, shared=plan.shared):
                    runner.run(step)
            connection.send((_DONE, None))
        runner.free()
    MPI.Finalize()


def _leave(*_: Any) -> None:
    raise KeyboardInterrupt
