"""Cholesky or conjugate gradients? Time and memory of both, over sizes and degrees: ``python benchmarks/solvers.py``.

From this come ``DIRECT_LIMIT`` in ``pipeline/solve/linear.py`` and the bytes per dof in ``pipeline/plan/estimate.py``.
Each row is a process of its own, since a process's peak memory is that of its largest solve.
"""

import argparse
import statistics
import subprocess
import sys

SIZES = {1: (4.0, 2.0, 1.0, 0.7), 2: (8.0, 4.0, 2.0, 1.5), 3: (8.0, 5.0, 3.0, 2.5)}  # mm


def measure(degree: int, size: float, method: str, repeats: int) -> None:
    """Solve one case ``repeats`` times and print a row of the table."""
    from mpi4py import MPI

    from pipeline.run.memory import PeakMemory
    from tests.cases import solve

    base = PeakMemory(MPI.COMM_SELF).peak()
    mesh = {"fine": f"{size} mm", "coarse": f"{size} mm", "rim": f"{min(size, 1.0)} mm", "degree": degree}
    runs = [next(iter(solve(mesh=mesh, solve={"method": method}).values())) for _ in range(repeats)]
    seconds = statistics.median(run.time_setup + run.time_solve for run in runs)
    run = runs[-1]
    per_dof = (max(run.memory for run in runs) - base) / run.dofs
    print(
        f"| {degree} | {run.dofs:7d} | {run.cells / run.dofs:.2f} | {method:9} | {seconds:7.2f} | "
        f"{run.iterations:3d} | {per_dof:6.0f} |",
        flush=True,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--one", nargs=3, metavar=("DEGREE", "SIZE", "METHOD"))
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.one:
        degree, size, method = arguments.one
        measure(int(degree), float(size), method, arguments.repeats)
        return
    names = ("degree", "dofs", "cells/dof", "method", "set-up + solve (s)", "iterations", "bytes/dof")
    print(f"| {' | '.join(names)} |", "|---" * len(names) + "|", sep="\n", flush=True)
    for degree, sizes in SIZES.items():
        for size in sizes:
            for method in ("direct", "iterative"):
                row = [sys.executable, __file__, "--one", str(degree), str(size), method]
                subprocess.run([*row, "--repeats", str(arguments.repeats)], check=False)


if __name__ == "__main__":
    main()
