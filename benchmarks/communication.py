"""What ranks tell each other in one iteration, and how the work is shared out: one large case on 1 to 8 ranks.

    python -m benchmarks.communication [--ranks 1 2 4 8] [--fine "3 mm"] [--degree 2]

Messages, bytes and reductions are counted at MPI's own interface (``communication.c``), and so is the processor's time
outside of it: that tells what each rank computes, on a machine that is busy or has fewer cores than ranks, too. The
forces must agree. Writes results/communication.json and .md.
"""

import argparse
import ctypes
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.ranks import LARGE
from pipeline import stages
from pipeline.run.meshing import mesh_case
from pipeline.solve.krylov import LinearSolver
from pipeline.solve.loads import Loads
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.quasi_static import QuasiStaticProblem
from pipeline.solve.spaces import Conditions, Spaces
from pipeline.study.load import parse
from pipeline.verify.machine import MPI_ENVIRONMENT, machine

_TOLERANCE = 1e-8
_MPI = ("messages", "bytes", "reductions")
_STAGES = ("assembly", "set-up", "interpolation", "iterations", "residuals")
_BAR = "error bar"


def measure(fine: str, degree: int) -> dict[str, Any]:
    """Solve the case on all ranks; return what was counted, the largest of all ranks and their sum; collective."""
    comm = MPI.COMM_WORLD
    study = LARGE | {"mesh": LARGE["mesh"] | {"fine": fine, "degree": degree}}
    case = parse(study).case(())
    body = mesh_case(case, (), comm)
    law, loads = MaterialLaw.of_moduli(10e3, 0.3), Loads.along((0.0, 0.0, -0.2e-3))
    with Spaces(body) as spaces, _watched() as sent, QuasiStaticProblem(spaces, degree, Conditions()) as problem:
        solution = problem.solve(law, loads, method="iterative", estimate=True)
        work = _stages()
    local = {name: sent[name] / sent["iterations"] for name in _MPI} | work
    return {
        "ranks": comm.size,
        "dofs": solution.dofs,
        "iterations": solution.iterations,
        "force": solution.reaction[2],
        "bar": solution.bar,
        "most": {name: comm.allreduce(value, op=MPI.MAX) for name, value in local.items()},
        "sum": {name: comm.allreduce(value) for name, value in local.items()},
    }


def _stages() -> dict[str, float]:
    """Return the processor's seconds of the stages of the solve, and of those of its error bar."""
    found = {name: seconds for name, seconds, _ in stages.table()}
    solve = sum(found.get(name, 0.0) for name in _STAGES)
    bar = sum(seconds for name, seconds in found.items() if name.startswith(_BAR))
    return {"assembly": found["assembly"], "iterating": found["iterations"], "solve": solve, _BAR: bar}


def _counted() -> np.ndarray:
    result = np.zeros(4)
    ctypes.CDLL(None).counted(ctypes.c_void_p(result.ctypes.data))
    return result


@contextmanager
def _watched() -> Iterator[dict[str, float]]:
    """Count what is sent in iterations of conjugate gradients; make stages count the processor's time outside MPI."""
    sent, iterate = dict.fromkeys((*_MPI, "iterations"), 0.0), LinearSolver.solve

    def counted(solver: LinearSolver, *arguments: Any, **options: Any) -> int:
        before = _counted()
        iterations = iterate(solver, *arguments, **options)
        for name, more in zip(_MPI, _counted() - before, strict=False):
            sent[name] += more
        sent["iterations"] += iterations
        return iterations

    clock = stages.time
    LinearSolver.solve = counted  # type: ignore[method-assign]
    stages.time = SimpleNamespace(perf_counter=lambda: float(_counted()[3]))  # type: ignore[assignment]
    stages.seconds.clear()
    stages._since[0] = float(_counted()[3])
    try:
        yield sent
    finally:
        LinearSolver.solve, stages.time = iterate, clock  # type: ignore[method-assign]


def _run(ranks: int, library: Path, fine: str, degree: int) -> dict[str, Any]:
    command = [
        "/usr/bin/mpirun",
        "--oversubscribe",
        "--mca",
        "mpi_yield_when_idle",
        "1",
        "-n",
        str(ranks),
        "-x",
        f"LD_PRELOAD={library}",
        sys.executable,
        "-m",
        "benchmarks.communication",
        "--worker",
        fine,
        str(degree),
    ]
    done = subprocess.run(command, env=os.environ | MPI_ENVIRONMENT, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def table(runs: list[dict[str, Any]]) -> str:
    """Return the runs as a table, of the busiest rank if nothing else is said."""
    alone = runs[0]["most"]
    lines = [
        "| ranks | iterations | messages an iteration | kB an iteration | kB of all ranks | reductions "
        "| s of assembly, iterations | work of the solve shared out | of its error bar |",
        "|---" * 9 + "|",
    ]
    for run in runs:
        most, total = run["most"], run["sum"]
        lines.append(
            f"| {run['ranks']} | {run['iterations']} | {most['messages']:.0f} | {most['bytes'] / 1e3:.0f} "
            f"| {total['bytes'] / 1e3:.0f} | {most['reductions']:.1f} "
            f"| {most['assembly']:.2f}, {most['iterating']:.2f} | {alone['solve'] / most['solve']:.2f} "
            f"| {alone[_BAR] / most[_BAR]:.2f} |"
        )
    return "\n".join(lines)


def main(ranks: list[int], fine: str, degree: int, output: Path = Path("results")) -> None:
    """Measure, print and write the table."""
    with TemporaryDirectory() as folder:
        library = Path(folder) / "communication.so"
        source = Path(__file__).with_suffix(".c")
        subprocess.run(["mpicc", "-O2", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
        runs = [_run(count, library, fine, degree) for count in ranks]
    text = table(runs)
    print(f"{runs[0]['dofs']} dofs of degree {degree}\n{text}")
    forces = [run["force"] for run in runs]
    print(f"forces differ by {max(forces) / min(forces) - 1:.1e}")
    output.mkdir(exist_ok=True)
    (output / "communication.md").write_text(text + "\n")
    (output / "communication.json").write_text(json.dumps({"machine": machine(), "runs": runs}, indent=2))
    if max(forces) / min(forces) - 1 > _TOLERANCE:
        raise SystemExit("the forces do not agree")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--fine", default="3 mm")
    parser.add_argument("--degree", type=int, default=2)
    parser.add_argument("--worker", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        found = measure(given.worker[0], int(given.worker[1]))
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(found))
    else:
        main(given.ranks, given.fine, given.degree)
