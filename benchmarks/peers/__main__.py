"""Time to a true error of F in this program, NGSolve, scikit-fem and CalculiX: ``python -m benchmarks.peers``.

Run it on an idle machine. It writes peers.json, peers.md and peers.png into the folder of results.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from itertools import product
from typing import Any

from benchmarks.machine import machine
from benchmarks.peers.figure import draw
from benchmarks.peers.processes import MODULES, SERIAL, ask, installed
from benchmarks.peers.results import TARGETS, Run, breakdown, medians, standings, table, to_json, truths_table
from benchmarks.peers.settings import (
    CONTACT_GRID,
    GRIDS,
    LADDERS,
    LARGE_GRID,
    LARGE_PROGRAM,
    MERIDIAN,
    PROGRAM,
    Settings,
)
from benchmarks.peers.tasks import TASKS
from benchmarks.peers.truth import Truth, converge, known
from benchmarks.tables import options, write

# Runs with more processor seconds vary too little to need repeats.
_LONG = 3.0


def main() -> int:
    """Run the requested comparisons; return 1 if a setting failed or two converged forces differ."""
    asked = _options()
    truths = {name: converge(name) if asked.truth else known(TASKS[name]) for name in asked.scenes}
    print(truths_table(truths), flush=True)
    if asked.scan:
        _scan(asked, truths)
        return 0
    runs: list[Run] = []
    failures: list[dict[str, Any]] = []
    slow: set[str] = set()
    for program, job in _jobs(asked):
        job["settings"] = [setting for setting in job["settings"] if _name(program, job, setting) not in slow]
        for answer in _answers(program, job) if job["settings"] else ():
            if "failed" in answer:
                failures.append({"program": program, "scene": job["scene"], **answer})
                print(f"{program}, {job['scene']}: {answer['setting']}: {answer['failed']}", file=sys.stderr)
                continue
            runs.append(_run(program, job, answer, truths))
            if runs[-1].cpu > _LONG:
                slow.add(_name(program, job, answer["setting"]))
            print(_line(runs[-1]), flush=True)
    runs = medians(runs)
    found = standings(runs)
    texts = [truths_table(truths), table(found), breakdown(found)]
    if asked.cpu:
        texts.insert(2, "Processor time instead of time:\n\n" + table(standings(runs, "cpu")))
    content = to_json(truths, runs, machine() | {"repeats": asked.repeats}, failures)
    write("peers", asked.output, content, "\n\n".join(texts) + "\n")
    print("", *texts, draw(runs, asked.output / "peers.png"), sep="\n\n")
    return int(bool(failures) or not all(truth.agree for truth in truths.values()))


def _options() -> argparse.Namespace:
    parser = options(__doc__)
    parser.add_argument("--scenes", nargs="+", choices=TASKS, default=list(TASKS))
    parser.add_argument("--programs", nargs="+", choices=MODULES, default=installed())
    parser.add_argument("--repeats", type=int, default=3, help="runs of each setting; the median counts")
    parser.add_argument("--truth", action="store_true", help="converge every scene again, in two programs")
    parser.add_argument("--two", action="store_true", help="also on two ranks, NGSolve on two threads")
    parser.add_argument("--cpu", action="store_true", help="also a table of processor times, for a busy machine")
    parser.add_argument("--scan", action="store_true", help="run the grids of settings once, print the best of them")
    return parser.parse_args()


def _jobs(asked: argparse.Namespace) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield programs and jobs, in turn and repeatedly, since the speed of a machine varies."""
    for name, _ in product(asked.scenes, range(asked.repeats)):
        for program in asked.programs:
            if not _settings(program, name, 1):
                continue
            for threads in (1, 2) if asked.two and program not in SERIAL else (1,):
                yield program, {"scene": name, "threads": threads, "settings": _settings(program, name, threads)}


def _name(program: str, job: dict[str, Any], setting: dict[str, Any]) -> str:
    return json.dumps([program, job["scene"], job["threads"], setting])


def _settings(program: str, scene: str, threads: int) -> Settings:
    if program != "program":
        return LADDERS[program].get(scene, ())
    if TASKS[scene].is_large:
        return LARGE_PROGRAM
    return PROGRAM + (MERIDIAN if TASKS[scene].body[0] == "cylinder" and threads == 1 else ())


def _answers(program: str, job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a program's answers; a crash is the last of them, so that the others continue."""
    try:
        yield from ask(program, job)
    except RuntimeError as error:
        yield {"setting": {}, "failed": str(error)}


def _run(program: str, job: dict[str, Any], answer: dict[str, Any], truths: dict[str, Truth]) -> Run:
    error = answer["force"] / truths[job["scene"]].force - 1
    return Run(job["scene"], program, job["threads"], error=error, **answer)


def _line(run: Run) -> str:
    return (
        f"{run.scene:9} {run.program:11} {run.threads} {run.dofs:7d} dofs {100 * run.error:8.3f} % "
        f"{run.seconds:7.2f} s {run.cpu:7.2f} s cpu  {run.setting}"
    )


def _scan(asked: argparse.Namespace, truths: dict[str, Truth]) -> None:
    """Print, for each peer and scene, the settings that reach each true error first, by processor time."""
    for name in asked.scenes:
        for program in (p for p in asked.programs if name in LADDERS.get(p, {})):
            job = {"scene": name, "threads": 1, "settings": _grid(program, name), "warm": False}
            answers = [answer for answer in ask(program, job) if "failed" not in answer]
            runs = sorted((_run(program, job, a, truths) for a in answers), key=lambda run: run.cpu)
            for target in TARGETS:
                print(f"{100 * target:g} %:")
                good = [run for run in runs if abs(run.error) <= target]
                print(*(f"  {_line(run)}" for run in good[:4]), sep="\n", flush=True)


def _grid(program: str, scene: str) -> Settings:
    if program != "NGSolve":
        return GRIDS[program]
    if TASKS[scene].is_large:
        return LARGE_GRID
    return CONTACT_GRID if TASKS[scene].probe[0] == "ball" else GRIDS["NGSolve"]


if __name__ == "__main__":
    raise SystemExit(main())
