"""Peak memory of a stretch of work, how much there is, and what is given back."""

import ctypes
import gc
import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from math import inf
from pathlib import Path

import psutil
from mpi4py import MPI

from pipeline.stages import stage

_C = ctypes.CDLL(None)
# A limit of cgroup v1 above this is none.
_NO_LIMIT = 2**60
_kept: list[bool] = []


def keep_imports() -> None:
    """Take what is loaded by now out of the reach of the garbage collector: each collection walks through the rest."""
    if not _kept:
        gc.collect()
        gc.freeze()
        _kept.append(True)  # to count what is frozen takes as long as a collection


@stage("garbage")
def give_back() -> None:
    """Free what nobody refers to, and return it to the system, where the C library can."""
    gc.collect()  # dolfinx's meshes hold communicators, and Python's cycles hold the meshes
    with suppress(AttributeError):
        _C.malloc_trim(0)


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
        free = min(psutil.virtual_memory().available, container_room(), _granted()) if self._is_first else 0.0
        return float(min(self._comm.allreduce(free), self._comm.allreduce(_room_of_process())))


def container_room(table: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")) -> float:
    """Return the bytes that this process's control groups leave, infinity where none has a limit.

    The limit of a group holds for all below it, too: the tightest one counts. Memory that only caches files is free.
    """
    return min(_rooms(table, root), default=inf)


def _rooms(table: Path, root: Path) -> Iterator[float]:
    with suppress(OSError):
        for line in table.read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers == "":
                base, names = root, ("memory.max", "memory.current", "inactive_file")
            elif "memory" in controllers.split(","):
                base, names = root / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
            else:
                continue
            group = base / path.strip("/")
            # In a container the path is that of the machine, and what is mounted is the container's own group.
            for folder in (group, *group.parents):
                if folder.is_relative_to(base):
                    yield _room_of_group(folder, *names)


def _room_of_group(folder: Path, limit_name: str, usage_name: str, cache_name: str) -> float:
    try:
        limit = (folder / limit_name).read_text().strip()
        if limit == "max" or int(limit) >= _NO_LIMIT:
            return inf
        usage = int((folder / usage_name).read_text())
        lines = (line.split() for line in (folder / "memory.stat").read_text().splitlines())
        return float(int(limit) - usage + next((int(value) for name, value in lines if name == cache_name), 0))
    except (OSError, ValueError):
        return inf


def _room_of_process() -> float:
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return inf if limit == resource.RLIM_INFINITY else float(limit - psutil.Process().memory_info().vms)


def _granted() -> float:
    """Return the bytes of this machine that Slurm grants the job, less what this process holds: more would end it."""
    each_cpu = float(os.environ.get("SLURM_MEM_PER_CPU") or 0) * float(os.environ.get("SLURM_CPUS_ON_NODE") or 1)
    granted = 1e6 * (float(os.environ.get("SLURM_MEM_PER_NODE") or 0) or each_cpu)  # 0: all there is
    return max(0.0, granted - psutil.Process().memory_info().rss) if granted else inf


def _peak_of_process() -> int:
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    return int(psutil.Process().memory_info().rss)
