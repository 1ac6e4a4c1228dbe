"""Communication and load balance of one iteration: one large case on 1 to 8 ranks, and as many unknowns on each rank.

    python -m benchmarks.communication [--ranks 1 2 4 8] [--fine "3 mm"] [--degree 2]

Messages, bytes and reductions are counted at MPI's profiling interface (``communication.c``). Processor time outside
MPI is measured there, too: it is the computation of each rank, also on a machine that is busy or has fewer cores than
ranks. The forces of the one case must agree.

The last table is no measurement: the time of an iteration on up to 1,000 ranks, from the counts of the largest run and
an assumed network.
"""

import argparse
import ctypes
import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from math import log2
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.machine import machine
from benchmarks.one_run import stages_by
from benchmarks.processor import ask
from benchmarks.scenes import LARGE
from benchmarks.tables import markdown, options, write
from epsmesh import stages
from epsmesh.run.meshing import mesh_case
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.linear_solver import LinearSolver
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.read import parse

_TOLERANCE = 1e-8
# Rim, in units of the elements, and growth of a mesh whose elements are nearly as large everywhere.
_RIM, _GROWTH = 0.5, 0.9
# Assumed network: seconds of a message, bytes a second of a rank.
_LATENCY, _BANDWIDTH = 2e-6, 1e9
# Neighbours of a rank among many, and its surface in that of one of eight, whose other half is the body's.
_NEIGHBOURS, _EIGHT, _INTERIOR = 14, 8, 2.0
# Unknowns and ranks on paper.
_LARGE, _ON_PAPER = (1e7, 1e8), (1, 8, 64, 512, 1000)
_MPI = ("messages", "bytes", "reductions")
_BAR = "error bar"
# Reported times, and the prefixes of their stages' names.
_STAGES: dict[str, tuple[str, ...]] = {
    "assembly": ("assembly",),
    "iterating": ("solve / iterations",),
    "solve": ("assembly", "set-up", "solve"),
    _BAR: (_BAR,),
}


def measure(fine: str, degree: int, scale: float | None) -> dict[str, Any]:
    """Solve the case on all ranks; return the counts, the largest of all ranks and their sum; collective.

    With a ``scale`` elements are as large everywhere, ``fine`` times it: unknowns then go like its third power.
    """
    comm = MPI.COMM_WORLD
    sizes = {"fine": scaled(fine, scale or 1.0), "coarse": scaled(fine, scale or 1.0), "degree": degree}
    if scale is not None:
        sizes |= {"rim": scaled(fine, _RIM * scale), "growth": _GROWTH}
    study = LARGE | {"mesh": LARGE["mesh"] | sizes}
    case = parse(study).case(())
    body = mesh_case(case, (), comm)
    law, movement = MaterialLaw.of_moduli(10e3, 0.3), Movement.along((0.0, 0.0, -0.2e-3))
    with Spaces(body) as spaces, _watched() as sent, QuasiStaticProblem(spaces, degree, Conditions()) as problem:
        solution = problem.solve(law, movement, method="iterative", estimate=True)
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
    """Return the processor seconds of the stages of the solve, and of those of its error bar."""
    return {
        name: sum(seconds for stage, seconds, _ in stages.table() if stage.startswith(begins))
        for name, begins in _STAGES.items()
    }


def _counted() -> np.ndarray:
    result = np.zeros(4)
    ctypes.CDLL(None).counted(ctypes.c_void_p(result.ctypes.data))
    return result


@contextmanager
def _watched() -> Iterator[dict[str, float]]:
    """Count messages in iterations of conjugate gradients; stages then count processor time outside MPI."""
    sent, iterate = dict.fromkeys((*_MPI, "iterations"), 0.0), LinearSolver.solve

    def counted(solver: LinearSolver, *arguments: Any, **options: Any) -> int:
        before = _counted()
        iterations = iterate(solver, *arguments, **options)
        for name, more in zip(_MPI, _counted() - before, strict=False):
            sent[name] += more
        sent["iterations"] += iterations
        return iterations

    LinearSolver.solve = counted  # type: ignore[method-assign]
    try:
        with stages_by(lambda: float(_counted()[3])):
            yield sent
    finally:
        LinearSolver.solve = iterate  # type: ignore[method-assign]


def table(runs: list[dict[str, Any]]) -> str:
    """Return the runs as a table; values are those of the busiest rank unless stated otherwise."""
    alone = runs[0]["most"]
    rows = [
        {
            "ranks": run["ranks"],
            "iterations": run["iterations"],
            "messages an iteration": run["most"]["messages"],
            "kB an iteration": run["most"]["bytes"] / 1e3,
            "kB of all ranks": run["sum"]["bytes"] / 1e3,
            "reductions": run["most"]["reductions"],
            "s of assembly": run["most"]["assembly"],
            "s of iterations": run["most"]["iterating"],
            "speed-up of the solve": alone["solve"] / run["most"]["solve"],
            "of its error bar": alone[_BAR] / run["most"][_BAR],
        }
        for run in runs
    ]
    return markdown(rows, dict(zip(rows[0], ("d", "d", ".0f", ".0f", ".0f", ".1f", *4 * (".2f",)), strict=True)))


def scaled(length: str, factor: float) -> str:
    """Return a length with its unit times a factor."""
    value, unit = length.split()
    return f"{float(value) * factor:.6g} {unit}"


def weak_table(runs: list[dict[str, Any]]) -> str:
    """Return runs with as many unknowns on each rank as a table; values are those of the busiest rank."""
    rows = [
        {
            "ranks": run["ranks"],
            "unknowns": run["dofs"],
            "unknowns a rank": run["dofs"] / run["ranks"],
            "iterations": run["iterations"],
            "kB an iteration": run["most"]["bytes"] / 1e3,
            "computation of an iteration and unknown, relative": _work(run) / _work(runs[0]),
        }
        for run in runs
    ]
    return markdown(rows, dict(zip(rows[0], ("d", ",d", ",.0f", "d", ".0f", ".2f"), strict=True)))


def _work(run: dict[str, Any]) -> float:
    """Return the seconds of the busiest rank in an iteration, for each unknown of a rank."""
    return float(run["most"]["iterating"] * run["ranks"] / run["dofs"] / run["iterations"])


def constants(strong: list[dict[str, Any]]) -> dict[str, float]:
    """Return the constants of the model of an iteration, from runs of one case on ranks, the last one on the most.

    With N unknowns on each of P ranks, of which each has k neighbours, an iteration takes

        work N  +  fixed  +  exchanges k latency  +  surface N^(2/3) / bandwidth  +  reductions latency log₂ P.

    ``work`` is that of one rank alone, ``fixed`` what the busiest of many computes besides; ``exchanges`` are the
    messages to a neighbour, on all levels; ``surface`` is of the bytes to all neighbours.
    """
    alone, last = strong[0], strong[-1]
    each = last["dofs"] / last["ranks"]
    return {
        "work": _work(alone),
        "fixed": max(0.0, last["most"]["iterating"] / last["iterations"] - _work(alone) * each),
        "exchanges": last["most"]["messages"] / (last["ranks"] - 1),
        "surface": last["most"]["bytes"] / each ** (2 / 3),
        "reductions": last["most"]["reductions"],
    }


def on_paper(found: dict[str, float]) -> str:
    """Return the time of an iteration on many ranks, by the model of :func:`constants`, as a table."""
    rows = []
    for dofs in _LARGE:
        for ranks in _ON_PAPER:
            each, many = dofs / ranks, ranks > 1
            surface = found["surface"] * (_INTERIOR if ranks > _EIGHT else 1.0)
            parts = {
                "computation (ms)": 1e3 * found["work"] * each,
                "fixed (ms)": many * 1e3 * found["fixed"],
                "messages (ms)": many * 1e3 * found["exchanges"] * min(ranks - 1, _NEIGHBOURS) * _LATENCY,
                "bytes (ms)": many * 1e3 * surface * each ** (2 / 3) / _BANDWIDTH,
                "reductions (ms)": 1e3 * found["reductions"] * _LATENCY * log2(ranks),
            }
            efficiency = parts["computation (ms)"] / sum(parts.values())
            rows.append({"unknowns": dofs, "ranks": ranks} | parts | {"efficiency": efficiency})
    return markdown(rows, dict(zip(rows[0], (",.0f", "d", *5 * (".3g",), ".0%"), strict=True)))


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4, 8])
    parser.add_argument("--fine", default="3 mm")
    parser.add_argument("--degree", type=int, default=2)
    parser.add_argument("--scale", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--worker", action="store_true", help="on all ranks of this run")
    asked = parser.parse_args()
    if asked.worker:
        found = measure(asked.fine, asked.degree, asked.scale)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(found))
        return
    words = ["-m", "benchmarks.communication", "--worker", "--degree", str(asked.degree), "--fine", asked.fine]
    with TemporaryDirectory() as folder:
        library = Path(folder) / "communication.so"
        source = Path(__file__).with_suffix(".c")
        subprocess.run(["mpicc", "-O2", "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
        launcher = ["--mca", "mpi_yield_when_idle", "1", "-x", f"LD_PRELOAD={library}"]
        runs = [ask(words, count, launcher=launcher) for count in asked.ranks]
        text = table(runs)
        print(f"{runs[0]['dofs']} dofs of degree {asked.degree}\n{text}", flush=True)
        most = max(asked.ranks)
        scales = [(count, ["--scale", f"{(most / count) ** (1 / 3):.6g}"]) for count in asked.ranks]
        weak = [ask([*words, *scale], count, launcher=launcher) for count, scale in scales]
    grown, known = weak_table(weak), constants(runs)
    paper = on_paper(known)
    print(grown, known, paper, sep="\n")
    text = "\n".join((text, grown, paper))
    forces = [run["force"] for run in runs]
    print(f"forces differ by {max(forces) / min(forces) - 1:.1e}")
    write("communication", asked.output, {"machine": machine(), "runs": runs, "weak": weak, "constants": known}, text)
    if max(forces) / min(forces) - 1 > _TOLERANCE:
        raise SystemExit("the forces do not agree")


if __name__ == "__main__":
    main()
