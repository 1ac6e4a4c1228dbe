"""Compute a study on several ranks, from a program that runs on one: ``mpirun`` starts this module."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.run.record import Record
from pipeline.study.load import parse
from pipeline.verify.machine import MPI_ENVIRONMENT
from pipeline.workflow import world

# Cells are solved in three dimensions, with the mesh that they give; the references of round scenes are not.
PATH = ("axisymmetric",)
_ROOT = Path(__file__).parents[3]
_MARK = "record "
_LAUNCHER = ("OMPI_", "PMIX_", "PRTE_")
_LONGEST = 300  # seconds


def why_not(comm: MPI.Comm) -> str:
    """Return why ranks cannot be started from here, or nothing."""
    if comm.size > 1:
        return "under mpirun already"
    return "" if shutil.which("mpirun") else "there is no mpirun"


def compute_on(ranks: int, scene: dict[str, Any]) -> Record:
    """Return the record of a study of one case, computed on so many ranks."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(_LAUNCHER)}
    environment |= MPI_ENVIRONMENT
    command = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, "-m", __name__, json.dumps(scene)]
    try:
        done = subprocess.run(
            command, env=environment, cwd=_ROOT, capture_output=True, text=True, check=False, timeout=_LONGEST
        )
    except subprocess.TimeoutExpired:
        return Record("", "failed", f"no answer in {_LONGEST} s")
    found = [line for line in done.stdout.splitlines() if line.startswith(_MARK)]
    if done.returncode or not found:
        return Record("", "failed", f"exit status {done.returncode}: {done.stderr[-300:]}")
    return Record.from_json(found[0].removeprefix(_MARK))


def main() -> None:
    """Compute the study that is the argument on all ranks; the first prints its record."""
    comm = world()
    (record,) = compute(make_plan(parse(json.loads(sys.argv[1])), without=PATH), comm).values()
    if comm.rank == 0:
        print(_MARK + record.to_json(), flush=True)


if __name__ == "__main__":
    main()
