"""Time to a true error of F in this program, NGSolve and scikit-fem: ``python -m benchmarks.peers``.

Wants an idle machine. Writes peers.json, peers.md and peers.png into the folder of results.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

from benchmarks.peers.figure import draw
from benchmarks.peers.processes import MODULES, ask
from benchmarks.peers.results import TARGETS, Run, breakdown, medians, standings, table, to_json, truths_table
from benchmarks.peers.settings import CONTACT_GRID, GRIDS, LADDERS, MERIDIAN, PROGRAM, Settings
from benchmarks.peers.tasks import TASKS
from benchmarks.peers.truth import Truth, converge, known
from pipeline.verify.machine import machine


def main() -> int:
    """Run everything that is asked for; return 1 if a setting failed or two truths differ."""
    options = _options()
    truths = {name: converge(name) if options.truth else known(TASKS[name]) for name in options.scenes}
    print(truths_table(truths), flush=True)
    if options.scan:
        _scan(options, truths)
        return 0
    runs: list[Run] = []
    failures: list[dict[str, Any]] = []
    for program, job in _jobs(options):
        for answer in _answers(program, job):
            if "failed" in answer:
                failures.append({"program": program, "scene": job["scene"], **answer})
                print(f"{program}, {job['scene']}: {answer['setting']}: {answer['failed']}", file=sys.stderr)
                continue
            runs.append(_run(program, job, answer, truths))
            print(_line(runs[-1]), flush=True)
    runs = medians(runs)
    found = standings(runs)
    texts = [truths_table(truths), table(found), breakdown(found)]
    if options.cpu:
        texts.insert(2, "Processor time instead of time:\n\n" + table(standings(runs, "cpu")))
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "peers.md").write_text("\n\n".join(texts) + "\n")
    content = to_json(truths, runs, machine() | {"repeats": options.repeats}, failures)
    (options.output / "peers.json").write_text(json.dumps(content, indent=1) + "\n")
    print("", *texts, draw(runs, options.output / "peers.png"), sep="\n\n")
    return int(bool(failures) or not all(truth.agree for truth in truths.values()))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", choices=TASKS, default=list(TASKS))
    parser.add_argument("--programs", nargs="+", choices=MODULES, default=list(MODULES))
    parser.add_argument("--repeats", type=int, default=3, help="runs of each setting; the median counts")
    parser.add_argument("--output", type=Path, default=Path("results"))
    parser.add_argument("--truth", action="store_true", help="converge every scene again, in two programs")
    parser.add_argument("--two", action="store_true", help="also on two ranks, NGSolve on two threads")
    parser.add_argument("--cpu", action="store_true", help="also a table of processor times, for a busy machine")
    parser.add_argument("--scan", action="store_true", help="run the grids of settings once, print the best of them")
    return parser.parse_args()


def _jobs(options: argparse.Namespace) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield who is asked for what: all in turn, again and again, as no machine is always as fast."""
    for name, _ in product(options.scenes, range(options.repeats)):
        for program in options.programs:
            if not _settings(program, name, 1):
                continue
            for threads in (1, 2) if options.two and program != "scikit-fem" else (1,):
                yield program, {"scene": name, "threads": threads, "settings": _settings(program, name, threads)}


def _settings(program: str, scene: str, threads: int) -> Settings:
    if program != "program":
        return LADDERS[program].get(scene, ())
    return PROGRAM + (MERIDIAN if TASKS[scene].body[0] == "cylinder" and threads == 1 else ())


def _answers(program: str, job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a program's answers; if it breaks down, that is the last of them: the others go on."""
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


def _scan(options: argparse.Namespace, truths: dict[str, Truth]) -> None:
    """Print, for each peer and scene, the settings that reach each true error soonest, by processor time."""
    for name in options.scenes:
        for program in (p for p in options.programs if name in LADDERS.get(p, {})):
            job = {"scene": name, "threads": 1, "settings": _grid(program, name), "warm": False}
            answers = [answer for answer in ask(program, job) if "failed" not in answer]
            runs = sorted((_run(program, job, a, truths) for a in answers), key=lambda run: run.cpu)
            for target in TARGETS:
                print(f"{100 * target:g} %:")
                good = [run for run in runs if abs(run.error) <= target]
                print(*(f"  {_line(run)}" for run in good[:4]), sep="\n", flush=True)


def _grid(program: str, scene: str) -> Settings:
    return CONTACT_GRID if TASKS[scene].probe[0] == "ball" else GRIDS[program]


if __name__ == "__main__":
    raise SystemExit(main())
