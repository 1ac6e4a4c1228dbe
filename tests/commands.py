"""The command line for the tests: where it runs, and in which environment."""

import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any
from unittest.mock import patch

from typer.main import get_command
from typer.testing import CliRunner, Result

from epsmesh.cli import app, main

ROOT = Path(__file__).parents[1]
# Under pytest, mpi4py may have marked this process's environment as a running MPI job.
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PMI_", "PRTE_"))} | {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMP_NUM_THREADS": "1",
}
# The launcher of the MPI in use: that of the wheels (MPICH) is beside Python, else Debian's (Open MPI).
_BESIDE = Path(sys.executable).parent / "mpiexec"
MPIRUN = [str(_BESIDE), "-n"] if _BESIDE.exists() else ["mpirun", "--oversubscribe", "-n"]


def names() -> list[str]:
    """Return the names of all commands."""
    group: Any = get_command(app)
    return sorted(group.commands)


def epsmesh(*arguments: object) -> Result:
    """Run ``epsmesh`` in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def talk(*arguments: object, encoding: str = "utf-8") -> tuple[int, str, str]:
    """Run ``epsmesh`` in this process, streams and all: return its exit status, and what went to both of them."""
    out, errors = (TextIOWrapper(BytesIO(), encoding=encoding) for _ in range(2))
    with patch.object(sys, "argv", ["epsmesh", *map(str, arguments)]), redirect_stdout(out), redirect_stderr(errors):
        try:
            main()
        except SystemExit as ended:
            status = int(ended.code or 0)
    said = []
    for stream in (out, errors):
        stream.seek(0)
        said.append(stream.read())
    return status, *said


def command(*arguments: object, ranks: int = 1) -> list[str]:
    """Return what starts ``epsmesh`` in a process of its own, on one rank or on several."""
    launcher = [*MPIRUN, str(ranks)] if ranks > 1 else []
    return [*launcher, sys.executable, "-m", "epsmesh", *map(str, arguments)]


def spawn(*arguments: object, ranks: int = 1) -> subprocess.CompletedProcess[str]:
    """Run ``epsmesh`` in a process of its own, to its end."""
    return subprocess.run(
        command(*arguments, ranks=ranks),
        capture_output=True, text=True, env=ENVIRONMENT, check=False, timeout=300, cwd=ROOT,
    )  # fmt: skip


def run_script(script: str, *arguments: object, ranks: int = 1) -> subprocess.CompletedProcess[str]:
    """Run a script of Python in a process of its own, to its end, with the command line ``arguments``."""
    launcher = [*MPIRUN, str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*launcher, sys.executable, "-c", script, *map(str, arguments)], cwd=ROOT, text=True, capture_output=True,
        env=ENVIRONMENT | {"PYTHONPATH": str(ROOT)}, stdin=subprocess.DEVNULL, check=False, timeout=300,
    )  # fmt: skip
