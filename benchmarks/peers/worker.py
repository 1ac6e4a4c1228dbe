"""How a program is asked: one job in JSON on its standard input, one line of JSON for each setting that is done.

Libraries are loaded and each setting has run once before it is timed: cold of mesh, warm of compiler.
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


@dataclass(frozen=True)
class Answer:
    """F (E·d·mm), the unknowns it was solved for, and the seconds that parts of the work took."""

    force: float
    dofs: int
    parts: dict[str, float]


Solve = Callable[..., Answer]


def answers(solve: Solve, job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield, for each of the job's settings, what ``solve(scene, threads, **setting)`` gave and what it cost.

    With ``warm`` each setting runs once before it is timed, otherwise the first setting alone does.
    """
    scene, threads = TASKS[job["scene"]], job.get("threads", 1)
    for number, setting in enumerate(job["settings"]):
        try:
            if job.get("warm", True) or number == 0:
                solve(scene, threads, **setting)
            found = _timed(solve, scene, threads, setting)
        except Exception as error:  # one setting that fails is no reason to lose the rest
            found = {"failed": f"{type(error).__name__}: {error}"}
        yield {"setting": setting, **found}


def _timed(solve: Solve, scene: Task, threads: int, setting: dict[str, Any]) -> dict[str, Any]:
    gc.collect()
    start, cpu = time.perf_counter(), time.process_time()
    answer = solve(scene, threads, **setting)
    return {"seconds": time.perf_counter() - start, "cpu": time.process_time() - cpu, **asdict(answer)}


def serve(solve: Solve, share: Callable[[Any], Any] = lambda job: job, *, speaks: bool = True) -> None:
    """Answer the job on standard input. What the libraries themselves print goes to standard error.

    Of several ranks the one that ``speaks`` reads and answers; ``share`` gives the others what it read.
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
