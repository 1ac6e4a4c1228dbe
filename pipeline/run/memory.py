"""Peak memory of a stretch of work."""

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


def _peak_of_process() -> int:
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return int(psutil.Process().memory_info().rss)
