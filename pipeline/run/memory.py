"""Peak memory of a stretch of work, how much there is, and what is given back."""

import ctypes
import gc
import time
from contextlib import suppress
from pathlib import Path

import psutil
from mpi4py import MPI

from pipeline.run.room import machine_room, process_room
from pipeline.stages import stage

_C = ctypes.CDLL(None)
_kept: list[bool] = []
# Collections take no more than one part in so many of the time, where nothing is lost by waiting.
_RARELY = 50
_next: list[float] = [0.0]  # time (s) of the next one


def keep_imports() -> None:
    """Take what is loaded by now out of the reach of the garbage collector: each collection walks through the rest."""
    if not _kept:
        gc.collect()
        gc.freeze()
        _kept.append(True)  # to count what is frozen takes as long as a collection


@stage("garbage")
def give_back(comm: MPI.Comm) -> None:
    """Free what nobody refers to, and return it to the system, where the C library can; collective.

    A collection walks through all that Python holds, the records of a long run among it. So small meshes wait for one
    another on one rank; on several all free their communicators at once.
    """
    start = time.perf_counter()
    if comm.size == 1 and start < _next[0]:
        return
    gc.collect()  # dolfinx's meshes hold communicators, and Python's cycles hold the meshes
    with suppress(AttributeError):
        _C.malloc_trim(0)
    end = time.perf_counter()
    _next[0] = end + _RARELY * (end - start)


class PeakMemory:
    """The most memory that all ranks together have held since this object was made."""

    def __init__(self, comm: MPI.Comm):
        self._comm = comm
        # Linux: 5 sets the peak back to what the process holds now.
        with suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")

    def peak(self) -> float:
        """Return the sum over ranks of each one's peak (bytes); collective."""
        return float(self._comm.allreduce(_peak_of_process()))


class FreeMemory:
    """What the ranks together may still take."""

    def __init__(self, comm: MPI.Comm):
        """Collective."""
        self._comm = comm
        machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
        self._is_first = machine.rank == 0
        machine.Free()

    def available(self) -> float:
        """Return it in bytes, the same on every rank; collective.

        What the machines have free, or, if less, what containers, Slurm's grant or the limits of the processes leave.
        """
        free = machine_room() if self._is_first else 0.0
        return float(min(self._comm.allreduce(free), self._comm.allreduce(process_room())))


def _peak_of_process() -> int:
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return int(psutil.Process().memory_info().rss)
