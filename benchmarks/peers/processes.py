"""Processes of the compared programs: how each is started, and what it returns."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from shutil import which
from tempfile import TemporaryFile
from typing import Any

from benchmarks.processor import MPIRUN, ROOT

PEERS_PYTHON = ROOT / ".venv-peers" / "bin" / "python"
MODULES = {"program": "program", "NGSolve": "ngsolve_model", "scikit-fem": "skfem_model", "CalculiX": "ccx_model"}
PEERS = ("NGSolve", "scikit-fem", "CalculiX")
# Programs of one thread here.
SERIAL = ("scikit-fem", "CalculiX")


def ask(program: str, job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a program's answers to ``job``, each as soon as it exists; threads, or ranks, are the job's.

    Raises:
        RuntimeError: if it crashes, with the end of its output; or if its venv does not exist.
    """
    if program in PEERS and not PEERS_PYTHON.exists():
        raise RuntimeError(f"{PEERS_PYTHON} does not exist: scripts/peers.sh makes it")
    python = str(PEERS_PYTHON if program in PEERS else sys.executable)
    ranks = job.get("threads", 1) if program == "program" else 1
    launcher = [*MPIRUN, str(ranks)] if ranks > 1 else []
    command = [*launcher, python, "-m", f"benchmarks.peers.{MODULES[program]}"]
    with (
        TemporaryFile("w+") as errors,
        subprocess.Popen(
            command,
            cwd=ROOT,
            env=_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        ) as process,
    ):
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(job))
        process.stdin.close()
        for line in process.stdout:
            yield json.loads(line)
        if process.wait():
            errors.seek(0)
            raise RuntimeError(f"{program} ended with status {process.returncode}: {errors.read()[-2000:]}")


def installed() -> list[str]:
    """Return the programs without those that scripts/peers.sh could not install."""
    return [program for program in MODULES if program != "CalculiX" or which("ccx")]


def _environment() -> dict[str, str]:
    """Restrict every library to one thread; ranks and NGSolve's tasks are set separately."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    # The other programs' venv has no epsmesh: known forces import its types.
    own = (str(ROOT), str(ROOT / "pipeline"), os.environ.get("PYTHONPATH", ""))
    path = os.pathsep.join(part for part in own if part)
    return os.environ | dict.fromkeys(names, "1") | root | {"PYTHONPATH": path}
