"""Memory: the peak of a computation, the available amount, and its return to the system."""

import ctypes
import gc
import time
from contextlib import suppress
from math import inf
from pathlib import Path

import psutil
from mpi4py import MPI

from epsmesh.run.room import machine_room, process_room
from epsmesh.stages import stage

_C = ctypes.CDLL(None)
_kept: list[bool] = []
# M_MMAP_MAX, M_MMAP_THRESHOLD and M_TRIM_THRESHOLD of glibc, and their values: the number of large arrays, their least
# bytes, and the free bytes that stay with the process. gmsh fills an array of 23 MB for each mesh, however small: a
# tenth of the time of a small case, if the system gives its pages each time.
_MOST_MAPPED, _MAPPED_FROM, _TRIMMED_FROM = -4, -3, -1
_MAPPED_ARRAYS, _LARGE, _FREE = 65_536, 2**27, 2**25
# Garbage collections take at most one part in so many of the time, if waiting does no harm.
_RARELY = 50
# Seconds for which free memory is taken to be the same: the whole of a small case.
_FRESH = 0.05
_next: list[float] = [0.0]  # time (s) of the next one


def keep_imports() -> None:
    """Exclude all loaded objects from garbage collection, which would otherwise visit them each time."""
    if not _kept:
        gc.collect()
        gc.freeze()
        _kept.append(True)  # gc.get_freeze_count() takes as long as a collection


def return_large_arrays() -> None:
    """Let the C library return freed memory of large arrays to the system at once.

    libpsm2, which Open MPI loads, switches this off for the whole process: a case then keeps the peak of every stage.
    """
    with suppress(AttributeError):  # other C libraries than glibc
        _C.mallopt(_MOST_MAPPED, _MAPPED_ARRAYS)
        if not _C.mallopt(_MAPPED_FROM, _LARGE):  # glibc before 2.35 takes at most so much
            _C.mallopt(_MAPPED_FROM, _FREE)
        _C.mallopt(_TRIMMED_FROM, _LARGE)


@stage("garbage")
def give_back(comm: MPI.Comm) -> None:
    """Collect garbage and return its memory to the system but for some MB, if the C library can; collective.

    A collection visits all Python objects, also the records of a long run. On one rank it is therefore rare, and frees
    several small meshes at once. On several ranks it is done each time, so that all free their communicators together.
    """
    start = time.perf_counter()
    if comm.size == 1 and start < _next[0]:
        return
    gc.collect()  # dolfinx's meshes hold communicators, and Python's cycles hold the meshes
    with suppress(AttributeError):
        _C.malloc_trim(_FREE)
    end = time.perf_counter()
    _next[0] = end + _RARELY * (end - start)


class PeakMemory:
    """The peak memory of all ranks since this object was made."""

    def __init__(self, comm: MPI.Comm):
        self._comm = comm
        # Linux: writing 5 resets the peak to the present memory.
        with suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")

    def peak(self) -> float:
        """Return the sum over ranks of each one's peak (bytes); collective."""
        return float(self._comm.allreduce(_peak_of_process()))


class FreeMemory:
    """The memory that all ranks together may still allocate."""

    def __init__(self, comm: MPI.Comm):
        """Collective."""
        self._comm, self._last = comm, (-inf, 0.0)
        machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
        self._is_first = machine.rank == 0
        machine.Free()

    def available(self) -> float:
        """Return the available bytes, the same on every rank; collective.

        The least of: free memory of the machines, limits of containers, Slurm's grant, limits of the processes. On one
        rank it is read once in a while.
        """
        now = time.monotonic()
        if self._comm.size > 1 or now - self._last[0] > _FRESH:
            self._last = now, self._read()
        return self._last[1]

    def _read(self) -> float:
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
