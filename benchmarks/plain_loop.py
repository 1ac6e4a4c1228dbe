"""A study without this program: the loop that a capable FEniCSx user writes, timed against the program's whole run.

Every case is meshed, assembled and solved by itself (:mod:`benchmarks.plain_case`): nothing is shared, no error bars,
no F_exact, no file is written. The program runs the same study with all of that, as ``epsmesh run --fresh`` does,
start-up included, and once more without F_exact. Compiled forms are in their caches for both.

``python -m benchmarks.plain_loop [STUDY]`` wants an idle machine, and takes an hour or two for figure3.toml;
``--sample 24`` times so many cases, spread over the sizes of meshes, and extrapolates.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from benchmarks.plain_case import MOST_DIRECT, SOLVERS, Solved, solve
from benchmarks.processor import processor_seconds
from pipeline.plan import estimate
from pipeline.study.load import load
from pipeline.study.sweep import Case, Study
from pipeline.verify.machine import machine

ROOT = Path(__file__).parents[1]
# Compiles what a run of the program needs, in seconds.
_WARM_UP = ROOT / "studies" / "quick.toml"
# Plain elements and quarter-point ones leave different errors at the rim.
_DIFFER = 0.02


def chosen(study: Study, count: int | None) -> list[tuple[Case, float]]:
    """Return the cases to time and how many cases each stands for: ``count`` of them, or all.

    Cases are sorted by the size of their mesh, then by ν, cut into ``count`` runs of like length, and the middle of
    each is taken.
    """
    cases = sorted(study.cases(), key=lambda case: (estimate.cells(case), case.material.poisson, case.index))
    strata = np.array_split(np.arange(len(cases)), min(count or len(cases), len(cases)))
    return [(cases[stratum[len(stratum) // 2]], float(len(stratum))) for stratum in strata]


def run_program(study: Study, folder: Path, *, exact: bool) -> dict[str, Any]:
    """Run the program afresh on a study; return seconds, processor seconds, and the dataset's path."""
    text = study.text
    if not exact:
        text = re.sub(r"^exact\b.*$", "", text, flags=re.MULTILINE)
        text, found = re.subn(r"^\[solve\]", "[solve]\nexact = false", text, flags=re.MULTILINE)
        text = text if found else f"{text}\n[solve]\nexact = false\n"
    file = folder / f"{study.name}.toml"
    file.write_text(text)
    used, start = processor_seconds(), time.perf_counter()
    _epsmesh(file, folder)
    seconds, used = time.perf_counter() - start, processor_seconds() - used
    return {"seconds": seconds, "cpu": used, "dataset": folder / f"{study.name}.nc"}


def _epsmesh(file: Path, folder: Path) -> None:
    command = [sys.executable, "-m", "pipeline", "run", str(file), "--fresh", "--quiet"]
    places = ["--store", str(folder / "cases.sqlite"), "--output", str(folder), "--meshes", str(folder / "meshes")]
    path = os.pathsep.join(part for part in (str(ROOT), os.environ.get("PYTHONPATH", "")) if part)
    done = subprocess.run([*command, *places], env=os.environ | {"PYTHONPATH": path}, check=False)
    if done.returncode > 1:
        raise RuntimeError(f"the program ended with status {done.returncode}")


def run_loop(cases: Sequence[tuple[Case, float]], solver: str, most_direct: int) -> list[Solved]:
    """Solve every case by itself, and tell of each."""
    found = []
    for number, (case, _) in enumerate(cases):
        solved = solve(case, solver, most_direct)
        if number == 0:  # the first one has loaded and compiled
            solved = solve(case, solver, most_direct)
        found.append(solved)
        print(
            f"{number + 1:4}/{len(cases)} {solved.seconds:8.2f} s {solved.cpu:8.2f} s cpu {solved.dofs:9d} dofs "
            f"{solved.iterations:4d} its  F {solved.force:.6g} N  {solved.case}",
            flush=True,
        )
    return found


def compare(dataset: Path, solved: Sequence[Solved]) -> list[float]:
    """Return by how much each plain F differs from the program's, relative to it."""
    with xr.open_dataset(dataset) as data:
        forces = data["force"].values
    return [one.force / float(forces[one.index]) - 1 for one in solved]


def report(study: Study, result: dict[str, Any]) -> str:
    """Return the comparison in markdown."""
    loop, program = result["plain_loop"], result["program"]
    lines = [
        f"`{study.name}`: {result['cases']} cases, {len(result['measured'])} of them timed in the plain loop.",
        "",
        "| | time (s) | processor time (s) | ratio | ratio, processor |",
        "|---|---|---|---|---|",
        f"| plain loop, no error bars, no F_exact | {loop['seconds']:.0f} | {loop['cpu']:.0f} | | |",
    ]
    names = {"with F_exact": "this program, error bars and F_exact", "without F_exact": "this program, error bars"}
    for key, name in names.items():
        own = program[key]
        faster = f"{loop['seconds'] / own['seconds']:.1f} | {loop['cpu'] / own['cpu']:.1f}"
        lines.append(f"| {name} | {own['seconds']:.0f} | {own['cpu']:.0f} | {faster} |")
    parts = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in loop["parts"].items())
    worst = max(result["measured"], key=lambda one: abs(one["deviation"]))
    lines += [
        "",
        f"Parts of the plain loop: {parts}.",
        "",
        f"Its F differs from the program's by {100 * result['median_deviation']:.2f} % in the median, at most by "
        f"{100 * worst['deviation']:+.2f} % ({worst['case']}).",
    ]
    return "\n".join(lines) + "\n"


def totals(cases: Sequence[tuple[Case, float]], solved: Sequence[Solved]) -> dict[str, Any]:
    """Return what the whole loop takes, each case counted as often as it stands for others."""

    def total(value: Callable[[Solved], float]) -> float:
        return sum(weight * value(one) for (_, weight), one in zip(cases, solved, strict=True))

    parts = {name: total(lambda one, name=name: one.parts[name]) for name in solved[0].parts}
    return {"seconds": total(lambda one: one.seconds), "cpu": total(lambda one: one.cpu), "parts": parts}


def main() -> int:
    """Time both; return 1 if their forces differ by more than the elements explain."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", nargs="?", type=Path, default=ROOT / "studies" / "figure3.toml")
    parser.add_argument("--sample", type=int, help="time so many cases only, and extrapolate")
    parser.add_argument("--solver", choices=SOLVERS, default="gamg", help="for what is too large for a direct solve")
    parser.add_argument("--most-direct", type=int, default=MOST_DIRECT, help="unknowns up to which MUMPS solves")
    parser.add_argument("--output", type=Path, default=Path("results"))
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    study = load(options.study)
    cases = chosen(study, options.sample)
    with TemporaryDirectory() as folder:
        _epsmesh(_WARM_UP, Path(folder, "warm-up"))
        program = {}
        for key, exact in (("without F_exact", False), ("with F_exact", True)):
            place = Path(folder, key.replace(" ", "-"))
            place.mkdir()
            program[key] = run_program(study, place, exact=exact)
            print(f"this program, {key}: {program[key]['seconds']:.0f} s, {program[key]['cpu']:.0f} s cpu", flush=True)
        with threadpool_limits(limits=1):
            solved = run_loop(cases, options.solver, options.most_direct)
        deviations = compare(program["with F_exact"].pop("dataset"), solved)
    program["without F_exact"].pop("dataset")
    result = {
        "study": study.name,
        "cases": len(list(study.cases())),
        "machine": machine(),
        "solver": options.solver,
        "most_direct": options.most_direct,
        "program": program,
        "plain_loop": totals(cases, solved),
        "median_deviation": float(np.median(np.abs(deviations))),
        "measured": [
            asdict(one) | {"stands_for": weight, "deviation": deviation}
            for (_, weight), one, deviation in zip(cases, solved, deviations, strict=True)
        ],
    }
    text = report(study, result)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "plain_loop.json").write_text(json.dumps(result, indent=1) + "\n")
    (options.output / "plain_loop.md").write_text(text)
    print(f"\n{text}")
    return int(max(map(abs, deviations)) > _DIFFER)


if __name__ == "__main__":
    raise SystemExit(main())
