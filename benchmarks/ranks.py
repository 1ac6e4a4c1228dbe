"""What a second rank is worth: a study of many small cases, and one large solve.

    python -m benchmarks.ranks           on an idle machine with at least two cores; writes results/ranks.json

Each figure is the median of runs that alternate between one rank and two. Start-up is not counted; the mesh of the
large case, which gmsh makes on one rank, is reported apart.
"""

import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

from benchmarks import soak
from pipeline.plan.plan import Plan, make_plan
from pipeline.run.execute import compute
from pipeline.study.load import parse
from pipeline.verify.machine import MPI_ENVIRONMENT

_REPEATS, _CASES = 3, 60
LARGE = {
    "body": {"shape": "box", "size": ["60 mm", "60 mm", "20 mm"], "fixed": "bottom"},
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"action": "pierce", "shape": "disc", "radius": "2 mm", "depth": "0.2 mm", "at": ["3 mm", "5 mm"]},
    "mesh": {"epsilon": "full", "fine": "1.5 mm", "coarse": "6 mm", "rim": "0.1 mm", "growth": 0.4, "degree": 2},
    "solve": {"exact": False},
}


def plans() -> dict[str, Plan]:
    """Return what is run: many small cases; one of half a million unknowns."""
    return {"many": make_plan(parse(soak.study(_CASES))), "large": make_plan(parse(LARGE))}


def measure(name: str) -> dict[str, Any]:
    """Run one plan on all ranks and return its seconds; collective."""
    comm = MPI.COMM_WORLD
    compute(make_plan(parse(soak.study(2))), comm)  # imports, forms
    comm.barrier()
    start = time.perf_counter()
    records = compute(plans()[name], comm)
    wall = time.perf_counter() - start
    (first, *_) = records.values()
    solve = first.time_assemble + first.time_setup + first.time_solve
    failed = sum(not record.is_ok for record in records.values())
    return {
        "wall": wall,
        "mesh": first.time_mesh,
        "solve": solve,
        "bar": first.time_error,
        "dofs": first.dofs,
        "cases": len(records),
        "failed": failed,
        "force": first.force,
    }


def _run(name: str, ranks: int) -> dict[str, Any]:
    command = ["/usr/bin/mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, "-m", "benchmarks.ranks", name]
    done = subprocess.run(command, env=os.environ | MPI_ENVIRONMENT, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def _medians(runs: list[dict[str, Any]]) -> dict[str, float]:
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def main(output: Path = Path("results")) -> dict[str, Any]:
    """Measure, print and write the speed-ups."""
    result: dict[str, Any] = {}
    for name in ("many", "large"):
        runs: dict[int, list[dict[str, Any]]] = {1: [], 2: []}
        for _ in range(_REPEATS):
            for ranks, found in runs.items():
                found.append(_run(name, ranks))
        one, two = (_medians(runs[ranks]) for ranks in (1, 2))
        result[name] = {
            "one": one,
            "two": two,
            "speedup": {k: one[k] / two[k] for k in ("wall", "mesh", "solve", "bar")},
        }
        ups = ", ".join(f"{key} × {value:.2f}" for key, value in result[name]["speedup"].items())
        print(f"{name}: {one['cases']:.0f} cases, {one['wall']:.1f} s on one rank, {two['wall']:.1f} s on two: {ups}")
    output.mkdir(exist_ok=True)
    (output / "ranks.json").write_text(json.dumps(result, indent=2))
    return result


if __name__ == "__main__":
    if len(sys.argv) > 1:
        found = measure(sys.argv[1])
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(found))
    else:
        main()
