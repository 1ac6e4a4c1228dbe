"""Tens of thousands of cases in one run: memory, pace and access to the store must stay constant.

    python -m benchmarks.soak [CASES]            mpirun -n 2 python -m benchmarks.soak

Ten cases on each mesh are solved, with their records in a store on disk. At each twentieth of the run it prints the
resident memory of the first rank, the processor time per case (which hardly depends on other programs), and the median
time to write a record to the store and to find one.

The exit status is 1 if a case fails; if memory grows, after a fifth of the run, by more than 30 kB per mesh (two thirds
of it are types that ctypes keeps of gmsh's arrays) and 4 kB per case (a record takes 3); if the pace of the last two
fifths differs by more than 10 %; or if the store takes more than 10 ms to find a record.
"""

import statistics
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil
from mpi4py import MPI

from benchmarks.scenes import many_small
from benchmarks.tables import options
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import execute
from epsmesh.run.progress import Progress
from epsmesh.run.record import Record
from epsmesh.run.store import Store
from epsmesh.study.read import parse

CASES, _ON_A_MESH = 20_000, 10
_GROWTH, _RECORD = 30e3, 4e3  # bytes per mesh, and per case
_PACE = 0.1
_ANSWER = 10e-3  # s
_MARKS = 20
_ASKED = 50


@dataclass
class Log:
    """Measurements at marks: cases, memory (bytes), processor time (s), and the store's times (s)."""

    store: Store
    every: int
    count: int = 0
    keys: list[str] = field(default_factory=list)
    puts: list[float] = field(default_factory=list)
    marks: list[tuple[int, float, float, float, float]] = field(default_factory=list)
    start: float = field(default_factory=time.perf_counter)

    def keep(self, record: Record) -> None:
        """Store a record; at each mark measure everything."""
        before = time.perf_counter()
        self.store.put(record)
        self.puts.append(time.perf_counter() - before)
        self.count += 1
        self.keys.append(record.key)
        if self.count % self.every:
            return
        answers = []
        for key in self.keys[:: max(len(self.keys) // _ASKED, 1)]:
            before = time.perf_counter()
            assert key in self.store.get([key])
            answers.append(time.perf_counter() - before)
        memory, spent = psutil.Process().memory_info().rss, time.process_time()
        put, found = statistics.median(self.puts), statistics.median(answers)
        self.puts.clear()
        self.marks.append((self.count, memory, spent, put, found))
        each = self.pace(len(self.marks) - 2, len(self.marks) - 1) if len(self.marks) > 1 else spent / self.count
        print(
            f"{self.count:6} cases {time.perf_counter() - self.start:7.0f} s {memory / 1e6:7.0f} MB "
            f"{1e3 * each:6.1f} ms a case; store: {1e3 * put:.2f} ms to write, {1e3 * found:.2f} ms to find",
            flush=True,
        )

    def pace(self, first: int, last: int) -> float:
        """Return the processor time per case (s) between two marks."""
        (n, _, before, *_), (m, _, after, *_) = self.marks[first], self.marks[last]
        return (after - before) / (m - n)


def main(cases: int) -> int:
    """Run the soak test; collective. Return the exit status."""
    comm = MPI.COMM_WORLD
    plan = make_plan(parse(many_small(cases, _ON_A_MESH)))
    with TemporaryDirectory() as folder:
        log = Log(Store(Path(folder) / "cases.sqlite"), max(cases // _MARKS, 1)) if comm.rank == 0 else None
        failed = execute(plan, comm, log.keep if log else lambda _: None, Progress())
        rest = comm.gather(psutil.Process().memory_info().rss)
        if log is None:
            return 0
        log.store.close()
    first, middle, last = len(log.marks) // 5, 3 * len(log.marks) // 5, len(log.marks) - 1
    growth = (log.marks[last][1] - log.marks[first][1]) / (log.marks[last][0] - log.marks[first][0]) * _ON_A_MESH
    early, late = log.pace(first, middle), log.pace(middle, last)
    slowest = max(found for *_, found in log.marks)
    print(
        f"{log.count} cases, {len(plan.meshes)} meshes, {failed} failed; memory grew by {growth / 1e3:.1f} kB a mesh;"
    )
    print(f"{1e3 * early:.1f} ms a case, then {1e3 * late:.1f} ({100 * (late / early - 1):+.1f} %);")
    print(f"the store finds a record in {1e3 * slowest:.2f} ms at most")
    print("MB of each rank at the end:", *(round(size / 1e6) for size in rest or ()))
    wrong = growth > _GROWTH + _ON_A_MESH * _RECORD or abs(late / early - 1) > _PACE or slowest > _ANSWER
    return int(failed > 0 or log.count < cases or wrong)


if __name__ == "__main__":
    parser = options(__doc__, writes=False)
    parser.add_argument("cases", nargs="?", type=int, default=CASES)
    sys.exit(main(parser.parse_args().cases))
