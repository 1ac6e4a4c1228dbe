"""The machine, date, commit and versions of measured times."""

import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
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


def heading(name: str) -> str:
    """Return what stands above the table ``name``: machine, command, commit and date, as in ``benchmarks/results/``."""
    found = machine()
    told = ", ".join(f"{key.removeprefix('version_')} {found[key]}" for key in found if key.startswith("version_"))
    where = f"{found['cores']} cores of {found['processor']}, {found['memory_bytes'] / 1e9:.0f} GB ({told})"
    command = ["git", "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT).stdout.strip() or "unknown"
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    made = spec.name.removesuffix(".__main__") if spec else name
    line = f"Made by `python -m {made}`; commit {commit}, {found['date'][:10]}."
    return f"# {name}\n\nMachine: {where}.\n\n## Table\n\n{line}\n\n"
