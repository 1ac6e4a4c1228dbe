"""Protocol of a program: one job in JSON on its standard input, one line of JSON for each setting when done.

Libraries are loaded, and each setting has run once before it is timed: the mesh is new, forms are compiled.
"""

import gc
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from benchmarks.peers.tasks import TASKS, Task
from benchmarks.processor import processor_seconds


@dataclass(frozen=True)
class Answer:
    """F (E·d·mm), the number of unknowns, and the seconds of parts of the work."""

    force: float
    dofs: int
    parts: dict[str, float]


Solve = Callable[..., Answer]


def answers(solve: Solve, job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield, for each of the job's settings, the result of ``solve(scene, threads, **setting)`` and its cost.

    With ``warm`` each setting runs once before it is timed, otherwise only the first setting does.
    """
    scene, threads = TASKS[job["scene"]], job.get("threads", 1)
    for number, setting in enumerate(job["settings"]):
        try:
            if job.get("warm", True) or number == 0:
                solve(scene, threads, **setting)
            found = _timed(solve, scene, threads, setting)
        except Exception as error:  # a failed setting does not end the others
            found = {"failed": f"{type(error).__name__}: {error}"}
        yield {"setting": setting, **found}


def _timed(solve: Solve, scene: Task, threads: int, setting: dict[str, Any]) -> dict[str, Any]:
    gc.collect()
    start, cpu = time.perf_counter(), processor_seconds()
    answer = solve(scene, threads, **setting)
    return {"seconds": time.perf_counter() - start, "cpu": processor_seconds() - cpu, **asdict(answer)}


def serve(solve: Solve, share: Callable[[Any], Any] = lambda job: job, *, speaks: bool = True) -> None:
    """Answer the job on standard input. Output of the libraries goes to standard error.

    Of several ranks the one that ``speaks`` reads and answers; ``share`` broadcasts the job to the others.
    """
    job = share(json.load(sys.stdin) if speaks else None)
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for answer in answers(solve, job):
        if speaks:
            print(json.dumps(answer), file=out, flush=True)


class Parts:
    """Splits time into named parts."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def end(self, name: str) -> None:
        """Count the time since the last call as ``name``."""
        now = time.perf_counter()
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now
