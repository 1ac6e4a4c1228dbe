"""Free memory of the machine, by the tightest limit for this process, and its load."""

import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from math import inf, nan
from pathlib import Path

import psutil

# A case may use this share of the memory that is free at its start.
MEMORY_SHARE = 0.9
# In cgroup v1, a larger number means no limit.
_NO_LIMIT = 2**60


def machine_load() -> float:
    """Return the running and waiting processes per core, over the last minute; NaN if unknown."""
    with suppress(OSError):
        return os.getloadavg()[0] / (os.cpu_count() or 1)
    return nan


def machine_room() -> float:
    """Return the bytes that all processes on this machine together may still allocate, by the tightest limit."""
    return min(float(psutil.virtual_memory().available), container_room(), granted_room())


def container_room(table: Path = Path("/proc/self/cgroup"), root: Path = Path("/sys/fs/cgroup")) -> float:
    """Return the bytes that this process's control groups leave, infinity without limits.

    A group's limit applies to all groups below it, so the tightest counts. Memory of the file cache counts as free.
    """
    return min(_rooms(table, root), default=inf)


def _rooms(table: Path, root: Path) -> Iterator[float]:
    with suppress(OSError):
        for group in _groups(table.read_text(), root):
            yield _room_of_group(*group)


@cache
def _groups(text: str, root: Path) -> tuple[tuple[Path, str, str, str], ...]:
    """Return the folders of the control groups in a table, and the names of their files."""
    found: list[tuple[Path, str, str, str]] = []
    for line in text.splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            base, names = root, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            base, names = root / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        group = base / path.strip("/")
        # In a container the path is the machine's, but the container's own group is mounted.
        found += [(folder, *names) for folder in (group, *group.parents) if folder.is_relative_to(base)]
    return tuple(found)


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
    """Return the bytes that this process's own limit leaves, infinity without a limit."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return inf if limit == resource.RLIM_INFINITY else float(limit - psutil.Process().memory_info().vms)


def granted_room() -> float:
    """Return the bytes that Slurm grants the job on this machine, less those of this process."""
    each_cpu = _number_of("SLURM_MEM_PER_CPU") * (_number_of("SLURM_CPUS_ON_NODE") or 1.0)
    granted = 1e6 * (_number_of("SLURM_MEM_PER_NODE") or each_cpu)  # 0: the whole machine
    return max(0.0, granted - psutil.Process().memory_info().rss) if granted else inf


def _number_of(name: str) -> float:
    """Return the number in an environment variable, 0 without one, or if it is not a finite positive number."""
    with suppress(ValueError):
        number = float(os.environ.get(name) or 0)
        return number if 0 < number < inf else 0.0
    return 0.0
