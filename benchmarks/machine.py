"""The machine, date and versions of measured times."""

import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

# One thread per rank; Open MPI refuses to run as root without these.
MPI_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


def machine() -> dict[str, Any]:
    """Return processor, cores, memory, load, date and versions."""
    import psutil

    from epsmesh import compat

    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        processor = platform.processor()
    return {
        "processor": processor,
        "cores": psutil.cpu_count() or 0,
        "memory_bytes": psutil.virtual_memory().total,
        "load": psutil.getloadavg()[0],
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        **{f"version_{name}": text for name, text in compat.versions().items()},
    }
