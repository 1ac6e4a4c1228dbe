"""Two thousand cases, each with a mesh of its own, in one process: memory stays flat, no communicator runs out.

    python -m benchmarks.soak [CASES]            mpirun -n 2 python -m benchmarks.soak

Prints the resident memory of the first rank as it goes; exit status 1 if a case fails, or if the memory grows by more
than 50 kB a case after a fifth of the way: a record, and the types that ctypes keeps of gmsh's arrays, take half of it.
"""

import sys
import time

import psutil
from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import execute
from pipeline.run.progress import Silent
from pipeline.run.record import Record
from pipeline.study.load import parse

CASES = 2_000
_GROWTH = 50e3  # bytes a case


def study(cases: int) -> dict[str, object]:
    """Return a study of small scenes, no two of which share a mesh."""
    radii = [f"{2 + i / cases:.6f} mm" for i in range(cases)]
    return {
        "body": {"shape": "box", "size": ["30 mm", "30 mm", "15 mm"], "fixed": "bottom"},
        "material": {"young": "10 kPa", "poisson": 0.4},
        "probe": {"action": "pierce", "shape": "disc", "radius": radii, "depth": "0.1 mm"},
        "mesh": {"epsilon": "full", "fine": "6 mm", "coarse": "6 mm", "rim": "1 mm", "growth": 0.9, "degree": 1,
                 "model": "3d"},
        "solve": {"exact": False},
    }  # fmt: skip


def main(cases: int) -> int:
    """Run the soak; collective. Returns the exit status."""
    comm, start = MPI.COMM_WORLD, time.perf_counter()
    plan = make_plan(parse(study(cases)))
    kept: list[Record] = []
    memory: list[float] = []

    def keep(record: Record) -> None:
        kept.append(record)
        if len(kept) % max(cases // 20, 1) == 0:
            memory.append(psutil.Process().memory_info().rss)
            print(f"{len(kept):6} cases {time.perf_counter() - start:7.0f} s {memory[-1] / 1e6:7.0f} MB", flush=True)

    failed = execute(plan, comm, keep, Silent())
    rest = comm.gather(psutil.Process().memory_info().rss)
    if comm.rank != 0:
        return 0
    first = len(memory) // 5
    growth = (memory[-1] - memory[first]) / (cases * (len(memory) - 1 - first) / len(memory))
    print(f"{len(kept)} cases, {len(plan.meshes)} meshes, {failed} failed; memory grew by {growth / 1e3:.0f} kB a case")
    print("MB of each rank at the end:", *(round(size / 1e6) for size in rest or ()))
    return int(failed > 0 or len(kept) < cases or growth > _GROWTH)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else CASES))
