"""What the machine has left: memory, by the tightest of all limits that hold for this process, and cores."""

import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from math import inf, nan
from pathlib import Path

import psutil

# A case may take this share of the memory that is free when it begins.
MEMORY_SHARE = 0.9
# A limit of cgroup v1 above this is none.
_NO_LIMIT = 2**60


def machine_load() -> float:
    """Return the processes a core that ran, or wanted to, over the last minute; not a number where nobody counts."""
    with suppress(OSError):
        return os.getloadavg()[0] / (os.cpu_count() or 1)
    return nan


def machine_room() -> float:
    """Return the bytes that all processes on this machine together may still take, by the tightest of all limits."""
    return min(float(psutil.virtual_memory().available), container_room(), granted_room())


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


def process_room() -> float:
    """Return the bytes that this process's own limit leaves, infinity where it has none."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return inf if limit == resource.RLIM_INFINITY else float(limit - psutil.Process().memory_info().vms)


def granted_room() -> float:
    """Return the bytes of this machine that Slurm grants the job, less what this process holds: more would end it."""
    each_cpu = _told("SLURM_MEM_PER_CPU") * (_told("SLURM_CPUS_ON_NODE") or 1.0)
    granted = 1e6 * (_told("SLURM_MEM_PER_NODE") or each_cpu)  # 0: all there is
    return max(0.0, granted - psutil.Process().memory_info().rss) if granted else inf


def _told(name: str) -> float:
    """Return a number of the environment, 0 where it tells none: who set it may not have been Slurm."""
    with suppress(ValueError):
        number = float(os.environ.get(name) or 0)
        return number if 0 < number < inf else 0.0
    return 0.0
