"""Memory: the peak of a stretch of work, and what there is."""

import os
from contextlib import suppress
from pathlib import Path

import psutil
from mpi4py import MPI


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


def available_memory(comm: MPI.Comm) -> float:
    """Return the bytes that are free for the ranks of ``comm``, all their machines together; collective."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    free = _free() if machine.rank == 0 else 0.0
    machine.Free()
    return float(comm.allreduce(free))


def _free() -> float:
    """Return the bytes that are free on this machine, within what Slurm grants the job on it: more would end it."""
    free = float(psutil.virtual_memory().available)
    each_cpu = float(os.environ.get("SLURM_MEM_PER_CPU") or 0) * float(os.environ.get("SLURM_CPUS_ON_NODE") or 1)
    granted = 1e6 * (float(os.environ.get("SLURM_MEM_PER_NODE") or 0) or each_cpu)  # 0: all there is
    return min(free, max(0.0, granted - psutil.Process().memory_info().rss)) if granted else free


def _peak_of_process() -> int:
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return int(psutil.Process().memory_info().rss)
