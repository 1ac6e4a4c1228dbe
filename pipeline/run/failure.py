"""Failures of cases: whatever is raised while one is computed fails that case, and the run goes on, on all ranks."""

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from pipeline.launcher import is_interrupt
from pipeline.mesh.generate import MeshError
from pipeline.run.problem import CaseFailure
from pipeline.run.record import UNFORESEEN
from pipeline.run.store import StoreError
from pipeline.solve import SolveError

T = TypeVar("T")

# Seconds that a rank waits with a failure of its own for the others, which may be in a call that needs all ranks. They
# may as well be about to come: at an assembly or a set-up of their own, which on large meshes takes that long. To wait
# in vain costs a run that has ended anyway a minute; not to wait costs one that could go on all its cases.
PATIENCE = 60.0
_PAUSE = 2e-3
_EXPECTED = (CaseFailure, MeshError, SolveError)
# Want of memory, above all, as libraries tell it.
_OF_LIBRARIES = (MemoryError, RuntimeError, ArithmeticError, np.linalg.LinAlgError, OSError)


@dataclass(frozen=True)
class Failure:
    """Why something could not be computed; all ranks agree on it."""

    message: str


class AloneError(RuntimeError):
    """One rank failed while the others are in a call that needs all: the run cannot go on."""


class Attempt:
    """Computes on the ranks of a communicator, and agrees on failures; ``free`` it in the end, collectively."""

    def __init__(self, comm: MPI.Comm):
        """Collective. What is agreed on is told apart from messages of what is computed."""
        self._comm = comm.Dup() if comm.size > 1 else comm
        self._count = 0

    def free(self) -> None:
        """Free the communicator; collective."""
        if self._comm.size > 1:
            self._comm.Free()

    def __call__(self, compute: Callable[[], T]) -> T | Failure:
        """Return what ``compute`` returns, or why it failed, on any rank; collective.

        Raises:
            StoreError: if records cannot be kept: that is no case's failure.
            AloneError: on the rank that failed, if the others cannot be told.
        """
        self._count += 1
        count, found, message = self._count, None, ""
        try:
            found = compute()
        except (StoreError, AloneError):
            raise
        except Exception as error:
            if is_interrupt(error):
                raise
            message = describe(error)
        if self._comm.size > 1:
            message = self._agreed(message, count)
        return Failure(message) if message else found  # type: ignore[return-value]

    def _agreed(self, message: str, count: int) -> str:
        """Return the message of the first rank that has one, "" if none has; collective."""
        comm = self._comm
        # The largest of all: whether one failed, and whether all are at the same attempt.
        mine, largest = np.array([comm.size - comm.rank if message else 0, count, -count]), np.zeros(3, np.int64)
        request, start = comm.Iallreduce(mine, largest, MPI.MAX), time.monotonic()
        if not message:
            request.Wait()
        while not request.Test():
            if time.monotonic() - start > PATIENCE:
                raise AloneError(f"{message}; the other ranks wait in a call that needs this one")
            time.sleep(_PAUSE)
        if largest[1] != -largest[2]:
            raise AloneError(message or "another rank has failed, and is elsewhere")
        return str(comm.bcast(message, comm.size - int(largest[0]))) if largest[0] else ""


def describe(error: Exception) -> str:
    """Return what to say of an error: where it was raised, too, if nobody had foreseen it."""
    if isinstance(error, _EXPECTED):
        return str(error)
    if isinstance(error, _OF_LIBRARIES):
        return f"{type(error).__name__}: {error}"
    (*_, last) = traceback.extract_tb(error.__traceback__)
    return f"{UNFORESEEN}{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})"
