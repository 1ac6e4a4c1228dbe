"""Failures of cases: any exception in a case's computation fails that case, and the run continues on all ranks."""

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from epsmesh.launcher import is_interrupt
from epsmesh.mesh.generate import MeshError
from epsmesh.run.problem import CaseFailure
from epsmesh.run.record import UNFORESEEN
from epsmesh.run.store import StoreError
from epsmesh.solve import SolveError

T = TypeVar("T")

# Seconds that a failed rank waits for the others to agree on the failure. They may be blocked in a collective call that
# needs this rank; or they may only be slow, in an assembly or set-up of a large mesh. In the first case waiting delays
# a lost run by a minute; in the second, not waiting would lose all its cases.
PATIENCE = 60.0
_PAUSE = 2e-3
_EXPECTED = (CaseFailure, MeshError, SolveError)
# Exceptions of libraries, mostly for want of memory.
_OF_LIBRARIES = (MemoryError, RuntimeError, ArithmeticError, np.linalg.LinAlgError, OSError)


@dataclass(frozen=True)
class Failure:
    """Why a computation failed; the same on all ranks.

    ``reached`` are the depth (m) and the force (N) at which a load path ended, None if it is no load path.
    """

    message: str
    reached: tuple[float, float] | None = None


class AloneError(RuntimeError):
    """One rank failed while the others are in a collective call: the run cannot continue."""


class Attempt:
    """Computes on the ranks of a communicator, which agree on failures; call ``free`` at the end, collectively."""

    def __init__(self, comm: MPI.Comm):
        """Collective. A communicator of its own separates agreement from the computation's messages."""
        self._comm = comm.Dup() if comm.size > 1 else comm
        self._count = 0

    def free(self) -> None:
        """Free the communicator; collective."""
        if self._comm.size > 1:
            self._comm.Free()

    def __call__(self, compute: Callable[[], T]) -> T | Failure:
        """Return the result of ``compute``, or why it failed on any rank; collective.

        Raises:
            StoreError: if the store cannot be written: this is not a failure of the case.
            AloneError: on the rank that failed, if the others do not answer.
        """
        self._count += 1
        count, found, message, reached = self._count, None, "", None
        try:
            found = compute()
        except (StoreError, AloneError):
            raise
        except Exception as error:
            if is_interrupt(error):
                raise
            message, reached = describe(error), getattr(error, "reached", None)
        if self._comm.size > 1:
            message = self._agreed(message, count)
        return Failure(message, reached) if message else found  # type: ignore[return-value]

    def _agreed(self, message: str, count: int) -> str:
        """Return the message of the first rank that has one, "" if none has; collective."""
        comm = self._comm
        # A maximum over all ranks: which one failed, and whether all are at the same attempt.
        mine, largest = np.array([comm.size - comm.rank if message else 0, count, -count]), np.zeros(3, np.int64)
        request, start = comm.Iallreduce(mine, largest, MPI.MAX), time.monotonic()
        if not message:
            request.Wait()
        while not request.Test():
            if time.monotonic() - start > PATIENCE:
                raise AloneError(f"{message}; the other ranks wait in a collective call for this one")
            time.sleep(_PAUSE)
        if largest[1] != -largest[2]:
            raise AloneError(message or "another rank failed, and is at another step")
        return str(comm.bcast(message, comm.size - int(largest[0]))) if largest[0] else ""


def describe(error: Exception) -> str:
    """Return the message of an error; for an unexpected one also where it was raised."""
    if isinstance(error, _EXPECTED):
        return str(error)
    if isinstance(error, _OF_LIBRARIES):
        return f"{type(error).__name__}: {error}"
    (*_, last) = traceback.extract_tb(error.__traceback__)
    return f"{UNFORESEEN}{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})"
