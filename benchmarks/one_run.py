"""One run in a process, or on ranks, of its own: its cost and its results, as a line of JSON.

    python benchmarks/one_run.py STUDY [OPTIONS]        both are JSON: a study, and arguments of ``measure``

It imports only ``epsmesh``, from any checkout, so that two versions can be compared on one machine at one time.
Start-up, compilation and imports at the first solve are not counted.
"""

import json
import resource
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI
from threadpoolctl import threadpool_limits

from epsmesh import stages
from epsmesh.plan import estimate
from epsmesh.plan.plan import make_plan
from epsmesh.run.compile import prepare
from epsmesh.run.execute import compute
from epsmesh.study.read import parse

WARM = {
    "body": {"shape": "box", "size": ["30 mm", "30 mm", "15 mm"], "fixed": "bottom"},
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm"},
    "mesh": {"epsilon": "full", "fine": "6 mm", "coarse": "6 mm", "rim": "1 mm", "growth": 0.9, "degree": 1},
    "solve": {"exact": False},
}
_OF_A_CASE = ("dofs", "iterations", "force", "memory", "time_mesh", "time_assemble", "time_setup", "time_solve")


@contextmanager
def stages_by(clock: Callable[[], float]) -> Iterator[None]:
    """Let stages count the seconds of another ``clock``, starting at zero."""
    before = stages.time
    stages.table()
    stages.seconds.clear()
    stages.time, stages._since[0] = SimpleNamespace(perf_counter=clock), clock()  # type: ignore[assignment]
    try:
        yield
    finally:
        stages.time, stages._since[0] = before, before.perf_counter()


def measure(
    study: Any, without: tuple[str, ...] = (), *, bar: bool = True, by_processor: bool = True
) -> dict[str, Any]:
    """Run a study on all ranks; collective.

    Reductions named ``without`` are left out. Without a ``bar`` the error bar is skipped, as for lack of memory. Times
    of the first case, and of all error bars, are processor times if ``by_processor``.
    """
    comm, used, clock = MPI.COMM_WORLD, time.process_time, time.perf_counter
    if not bar:
        estimate.error_bar_memory = lambda *_, **__: inf
    plan = make_plan(parse(study), without=without)
    prepare(comm, plan.solves)
    with threadpool_limits(limits=1):
        compute(make_plan(parse(WARM)), comm)
        with stages_by(used if by_processor else clock):
            comm.barrier()
            start, before = clock(), used()
            records = compute(plan, comm)
            wall, spent = clock() - start, used() - before
            bars = sum(seconds for stage, seconds, _ in stages.table() if stage.startswith("error bar"))
    first, *_ = records.values()
    return {
        "wall": wall,
        "processor": comm.allreduce(spent),
        "busiest": comm.allreduce(spent, op=MPI.MAX),  # of the ranks
        "bar": bars,
        "peak": comm.allreduce(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss),
        "cases": len(records),
        "solved": sum(record.origin != "interpolated" for record in records.values()),
        "message": next((record.message for record in records.values() if not record.is_ok), ""),
        "force_error": max(record.force_error for record in records.values()),
        "forces": [(records[key].force, records[key].force_error) for key in plan.keys if key in records],
        "record": first.to_json(),
        **{name: getattr(first, name) for name in _OF_A_CASE},
    }


if __name__ == "__main__":
    found = measure(json.loads(sys.argv[1]), **json.loads(sys.argv[2] if len(sys.argv) > 2 else "{}"))
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(found))
