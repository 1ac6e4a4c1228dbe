"""Methods of measurement: processor seconds, alternating runs, and separate processes.

Other programs on the machine affect processor time far less than elapsed time.
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
# Debian's own mpirun: another one on PATH would not match Debian's mpi4py.
MPIRUN = ("/usr/bin/mpirun", "--oversubscribe", "-n")
Answer = TypeVar("Answer")


def processor_seconds() -> float:
    """Return the processor seconds of this process and of finished children."""
    used = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def by_turns(ways: Mapping[str, Callable[[], Answer]], repeats: int) -> dict[str, list[Answer]]:
    """Return the results of each way in each of ``repeats``; ways alternate, so that other load affects all equally."""
    found: dict[str, list[Answer]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            found[name].append(way())
    return found


def median_seconds(ways: Mapping[str, Callable[[], Any]], repeats: int) -> dict[str, float]:
    """Return the median of each way's processor seconds in this process; ways alternate."""

    def timed(way: Callable[[], Any]) -> float:
        start = time.process_time()
        way()
        return time.process_time() - start

    found = by_turns({name: partial(timed, way) for name, way in ways.items()}, repeats)
    return {name: statistics.median(seconds) for name, seconds in found.items()}


def command(*words: str, folder: Path, ranks: int = 0, most: int = 0, **environment: str) -> tuple[float, float]:
    """Run a command of the program in ``folder``, on ``ranks``; return its elapsed and its processor seconds.

    Raises:
        RuntimeError: if it ends with a status above ``most``.
    """
    many = [*MPIRUN, str(ranks), sys.executable, "-m", "mpi4py"] if ranks else [sys.executable]
    paths = os.environ | MPI_ENVIRONMENT | {"PYTHONPATH": str(ROOT)} | environment
    start, before = time.perf_counter(), processor_seconds()
    whole = [*many, "-m", "epsmesh", *words]
    done = subprocess.run(whole, check=False, stdout=subprocess.DEVNULL, cwd=folder, env=paths)
    if done.returncode > most:
        raise RuntimeError(f"{' '.join(words)}: status {done.returncode}")
    return time.perf_counter() - start, processor_seconds() - before


def ask(
    words: Sequence[str],
    ranks: int = 0,
    tree: Path = ROOT,
    launcher: Sequence[str] = (),
    longest: float | None = None,
) -> Any:
    """Run Python with ``words`` in a separate process, or on ``ranks``; return the last line that it prints, JSON.

    It has one thread, and imports from the checkout ``tree``. mpirun, with further arguments ``launcher``, binds each
    rank to a core: compare two ranks with one rank, not with no mpirun.

    Raises:
        RuntimeError: if it fails, with its output, or takes more than ``longest`` seconds.
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
    """Return cost and results of a run of ``study`` in a separate process: see :mod:`benchmarks.one_run`.

    Raises:
        RuntimeError: as :func:`ask` does.
    """
    worker = str(Path(__file__).with_name("one_run.py"))
    found: dict[str, Any] = ask([worker, json.dumps(study), json.dumps(how)], ranks, tree, longest=longest)
    return found


def run(study: dict[str, Any], ranks: int = 0, tree: Path = ROOT, **how: Any) -> dict[str, Any]:
    """Return the same as :func:`alone`, for a study whose cases must all succeed.

    Raises:
        RuntimeError: if a case fails.
    """
    found = alone(study, ranks, tree, **how)
    if found["message"]:
        raise RuntimeError(found["message"])
    return found
