"""Distribute the steps of a phase over groups of ranks: a free group takes the next step.

The next step is a counter on the first rank, which any rank fetches and raises by one-sided communication. If MPI has
none between machines, steps are distributed in turn, most expensive first. Records are sent to the first rank, which
alone writes to the store; it receives them between its own solves.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Protocol

import numpy as np
from mpi4py import MPI

from epsmesh.plan.schedule import Phase
from epsmesh.plan.steps import MeshStep
from epsmesh.run.record import Record

# Seconds between two polls of an idle rank, so that it leaves its core to others.
_PATIENCE = 2e-3


class Runner(Protocol):
    """Runs steps on a communicator."""

    def run(self, step: MeshStep) -> None:
        """Run a step; collective."""

    def free(self) -> None:
        """Free the communicators; collective."""


def run_phase(
    comm: MPI.Comm,
    phase: Phase,
    make: Callable[[MPI.Comm, Callable[[Record], None]], Runner],
    keep: Callable[[Record], None],
) -> None:
    """Run a phase; collective. ``make`` returns a runner for a communicator and a function that receives its records.

    ``keep`` is called on rank 0 with every record of every group.
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
    """Returns 0, 1, 2, …, each number to one rank; a context manager, collective to enter and to leave.

    ``number`` of ``count`` is this group, for turns without one-sided communication.
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
    """Sends records to rank 0; a context manager, collective to leave: all posted records have then arrived."""

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
        if kind is not None:  # the run ends: keep what has arrived, do not wait for more
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
        """Send a record without waiting; on rank 0, keep it."""
        if self._comm.rank == 0:
            self._keep(record)
        else:
            self._sent.append(self._comm.isend(record, 0))
        self.look()

    def look(self) -> None:
        """On rank 0, keep arrived records; elsewhere, drop delivered requests."""
        if self._comm.rank != 0:
            self._sent = [request for request in self._sent if not request.Test()]
            return
        while self._open and self._comm.iprobe():
            record = self._comm.recv()
            if record is None:
                self._open -= 1
            else:
                self._keep(record)
