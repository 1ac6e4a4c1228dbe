"""Share the steps of a phase between groups of ranks: each takes the next one when it is free.

Which step is next is a counter that lives on the first rank and that any rank can fetch and raise without its help.
Where MPI has no such one-sided communication between machines, the steps are dealt out in turn, costliest first.
Records travel to the first rank, which alone writes to the store; it takes them in between its own solves.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Protocol

import numpy as np
from mpi4py import MPI

from pipeline.plan.schedule import Phase
from pipeline.plan.steps import MeshStep
from pipeline.run.record import Record

# Seconds between two looks of a rank that has nothing else to do: it leaves its core to those that have.
_PATIENCE = 2e-3


class Runner(Protocol):
    """What carries out steps on a communicator."""

    def run(self, step: MeshStep) -> None:
        """Carry out a step; collective."""

    def free(self) -> None:
        """Free what belongs to the communicator; collective."""


def run_phase(
    comm: MPI.Comm,
    phase: Phase,
    make: Callable[[MPI.Comm, Callable[[Record], None]], Runner],
    keep: Callable[[Record], None],
) -> None:
    """Carry out a phase; collective. ``make`` returns a runner on a communicator, that posts records to a function.

    ``keep`` is called on rank 0 with every record, from whatever group it comes.
    """
    if phase.size >= comm.size:
        runner = make(comm, keep)
        for step in phase.steps:
            runner.run(step)
        runner.free()
        return
    group = comm.Split(comm.rank // phase.size, comm.rank)
    groups = -(-comm.size // phase.size)
    with Mailbox(comm, keep) as mailbox, Counter(comm, comm.rank // phase.size, groups) as counter:
        runner = make(group, mailbox.post)
        while (number := group.bcast(counter.next() if group.rank == 0 else None)) < len(phase.steps):
            runner.run(phase.steps[number])
            mailbox.look()
        runner.free()
    group.Free()


class Counter:
    """Hands out 0, 1, 2, …, each number to one rank; a context manager, collective to enter and to leave.

    ``number`` of ``count`` is who asks, for turns where there is no one-sided communication.
    """

    def __init__(self, comm: MPI.Comm, number: int, count: int):
        self._comm = MPI.Intracomm(comm)
        self._turn, self._count = number, count
        self._window: MPI.Win | None = None

    def __enter__(self) -> "Counter":
        size = np.dtype(np.int64).itemsize
        try:
            window = MPI.Win.Allocate(size if self._comm.rank == 0 else 0, size, comm=self._comm)
        except MPI.Exception:  # Open MPI over TCP with threads
            window = None
        everywhere = self._comm.allreduce(window is not None, op=MPI.LAND)
        if window is not None and everywhere:
            self._window = window
            if self._comm.rank == 0:
                window.Lock(0)
                window.Put(np.zeros(1, np.int64), 0)
                window.Unlock(0)
            self._comm.barrier()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None and self._window is not None:
            self._window.Free()

    def next(self) -> int:
        """Return the next number."""
        if self._window is None:
            self._turn += self._count
            return self._turn - self._count
        one, number = np.ones(1, np.int64), np.zeros(1, np.int64)
        self._window.Lock(0)
        self._window.Fetch_and_op(one, number, 0)
        self._window.Unlock(0)
        return int(number[0])


class Mailbox:
    """Takes records to rank 0; a context manager, collective to leave: all that was posted has then arrived."""

    def __init__(self, comm: MPI.Comm, keep: Callable[[Record], None]):
        self._keep = keep
        self._comm = comm.Dup()
        self._sent: list[MPI.Request] = []
        self._open = comm.size - 1

    def __enter__(self) -> "Mailbox":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:  # the run ends: what has arrived is kept, nobody waits for the rest
            with suppress(MPI.Exception):
                self.look()
            return
        if self._comm.rank != 0:
            self._sent.append(self._comm.isend(None, 0))
        while self._open if self._comm.rank == 0 else not MPI.Request.Testall(self._sent):
            self.look()
            time.sleep(_PATIENCE)
        ended = self._comm.Ibarrier()
        while not ended.Test():
            time.sleep(_PATIENCE)
        self._comm.Free()

    def post(self, record: Record) -> None:
        """Send a record on its way, or keep it if this is rank 0."""
        if self._comm.rank == 0:
            self._keep(record)
        else:
            self._sent.append(self._comm.isend(record, 0))
        self.look()

    def look(self) -> None:
        """Keep, on rank 0, what has arrived; elsewhere forget what has been delivered."""
        if self._comm.rank != 0:
            self._sent = [request for request in self._sent if not request.Test()]
            return
        while self._open and self._comm.iprobe():
            record = self._comm.recv()
            if record is None:
                self._open -= 1
            else:
                self._keep(record)
