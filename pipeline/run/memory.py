"""Peak memory of a stretch of work, and what is given back after it."""

import ctypes
import gc
from contextlib import suppress
from pathlib import Path

import psutil
from mpi4py import MPI

from pipeline.stages import stage


def keep_imports() -> None:
    """Take what is loaded by now out of the reach of the garbage collector: each collection walks through the rest."""
    if not gc.get_freeze_count():
        gc.collect()
        gc.freeze()


@stage("garbage")
def give_back() -> None:
    """Free what nobody refers to, and return it to the system, where the C library can."""
    gc.collect()  # dolfinx's meshes hold communicators, and Python's cycles hold the meshes
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).malloc_trim(0)


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


def _peak_of_process() -> int:
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return int(psutil.Process().memory_info().rss)
