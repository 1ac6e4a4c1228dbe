"""How a benchmark measures: seconds of the processor, ways by turns, and processes of their own.

Other programs on the machine lengthen processor time far less than the time that passes.
"""

import json
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from benchmarks.machine import MPI_ENVIRONMENT

ROOT = Path(__file__).parents[1]
# Debian's own mpirun: another one on PATH would not fit Debian's mpi4py.
MPIRUN = ("/usr/bin/mpirun", "--oversubscribe", "-n")
Answer = TypeVar("Answer")


def processor_seconds() -> float:
    """Return what this process and the children that it waited for have used of processors."""
    used = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def by_turns(ways: Mapping[str, Callable[[], Answer]], repeats: int) -> dict[str, list[Answer]]:
    """Return what each way gives at each of its ``repeats``; ways take turns, to share what else the machine does."""
    found: dict[str, list[Answer]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            found[name].append(way())
    return found


def median_seconds(ways: Mapping[str, Callable[[], Any]], repeats: int) -> dict[str, float]:
    """Return the median of the processor's seconds of this process that each way takes, by turns."""

    def timed(way: Callable[[], Any]) -> float:
        start = time.process_time()
        way()
        return time.process_time() - start

    found = by_turns({name: partial(timed, way) for name, way in ways.items()}, repeats)
    return {name: statistics.median(seconds) for name, seconds in found.items()}


def ask(
    words: Sequence[str],
    ranks: int = 0,
    tree: Path = ROOT,
    launcher: Sequence[str] = (),
    longest: float | None = None,
) -> Any:
    """Run Python with ``words`` in a process of its own, or on ``ranks``; return the last line, JSON, that it prints.

    It has one thread, and imports what it needs from the checkout ``tree``. mpirun, of which ``launcher`` are more
    words, binds each rank to a core: what is compared with two ranks runs on one rank, too, not on none.

    Raises:
        RuntimeError: with what it said, if it fails, or takes more than ``longest`` seconds.
    """
    many = [*MPIRUN, str(ranks), *launcher] if ranks else []
    paths = os.environ | MPI_ENVIRONMENT | {"PYTHONPATH": str(tree)}
    command = [*many, sys.executable, "-m", "mpi4py", *words]
    try:
        done = subprocess.run(
            command, cwd=tree, env=paths, check=False, capture_output=True, text=True, timeout=longest
        )
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"no answer in {longest} s") from None
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)[:200]}: status {done.returncode}\n{done.stdout}{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def alone(
    study: dict[str, Any], ranks: int = 0, tree: Path = ROOT, *, longest: float | None = None, **how: Any
) -> dict[str, Any]:
    """Return what a run of ``study`` takes and gives in a process of its own: see :mod:`benchmarks.one_run`.

    Raises:
        RuntimeError: as :func:`ask` does.
    """
    worker = str(Path(__file__).with_name("one_run.py"))
    found: dict[str, Any] = ask([worker, json.dumps(study), json.dumps(how)], ranks, tree, longest=longest)
    return found


def run(study: dict[str, Any], ranks: int = 0, tree: Path = ROOT, **how: Any) -> dict[str, Any]:
    """Return the same of a study whose cases are all solved.

    Raises:
        RuntimeError: if a case fails.
    """
    found = alone(study, ranks, tree, **how)
    if found["message"]:
        raise RuntimeError(found["message"])
    return found
