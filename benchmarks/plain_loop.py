"""A study without this program: the loop that an experienced FEniCSx user writes, timed against the program's run.

The loop meshes, assembles and solves every case by itself (:mod:`benchmarks.plain_case`): nothing is shared, without
error bars, F_exact, or output files. The program runs the same study with all of that, as ``epsmesh run --fresh`` does,
start-up included. It runs it again without F_exact, and a part of it with every case solved whole and separately, which
shows what the reductions save. All use cached compiled forms.

``python -m benchmarks.plain_loop [STUDY]`` needs an idle machine, and takes an hour or two for figure3.toml.
``--sample 24`` times that many cases, spread over the sizes of meshes, and extrapolates.
"""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from benchmarks.machine import machine
from benchmarks.plain_case import MOST_DIRECT, SOLVERS, Solved, solve
from benchmarks.processor import ROOT, command
from benchmarks.tables import markdown, options, write
from epsmesh.arrays import FloatArray
from epsmesh.plan import estimate
from epsmesh.plan.plan import make_plan
from epsmesh.plan.shard import Shard
from epsmesh.report.publish import publish
from epsmesh.run.reading import open_to_read
from epsmesh.study.case import Case
from epsmesh.study.read import read_study
from epsmesh.study.sweep import Study

# Study that compiles all forms of a run, in seconds.
_WARM_UP = ROOT / "studies" / "quick.toml"
# Largest difference between plain elements and quarter-point elements, by their errors at the rim.
_DIFFER = 0.02
_WITH = "this program, error bars and F_exact"
_WHOLE = "the same, every case whole and separately"


def chosen(study: Study, count: int | None) -> list[tuple[Case, float]]:
    """Return the cases to time and the number of cases that each represents: ``count`` of them, or all.

    Cases are sorted by the size of their mesh, then by ν, and divided into ``count`` groups of similar length; the
    middle case of each is taken.
    """
    cases = sorted(study.cases(), key=lambda case: (estimate.cells(case), case.material.poisson, case.index))
    strata = np.array_split(np.arange(len(cases)), min(count or len(cases), len(cases)))
    return [(cases[stratum[len(stratum) // 2]], float(len(stratum))) for stratum in strata]


def run_program(study: Study, folder: Path, *, exact: bool = True, parts: int = 0) -> dict[str, Any]:
    """Run the program on a study without stored results; return seconds, processor seconds, and the dataset's path.

    With ``parts``, no reductions are used, one of that many parts of similar cost is run, and its time multiplied.
    """
    text = study.text
    if not exact:
        text = re.sub(r"^exact\b.*$", "", text, flags=re.MULTILINE)
        text, found = re.subn(r"^\[solve\]", "[solve]\nexact = false", text, flags=re.MULTILINE)
        text = text if found else f"{text}\n[solve]\nexact = false\n"
    folder.mkdir()
    file = folder / f"{study.name}.toml"
    file.write_text(text)
    places = ["--store", str(folder / "cases.sqlite"), "--meshes", str(folder / "meshes")]
    how = ["--without", "all", "--shard", f"1/{parts}", *places[2:]] if parts else ["--fresh", *places]
    words = ("run", str(file), "--output", str(folder), "--quiet", *how)
    seconds, used = command(*words, folder=folder, most=1)
    if parts:
        plan = make_plan(read_study(file), without=("all",))
        with open_to_read(Shard(1, parts).store(folder, plan.study)) as store:
            publish(plan, store.get(plan.all_keys), {}, folder)
    often = max(parts, 1)
    return {"seconds": often * seconds, "cpu": often * used, "dataset": folder / f"{study.name}.nc"}


def run_loop(cases: Sequence[tuple[Case, float]], solver: str, most_direct: int) -> list[Solved]:
    """Solve every case by itself, and print a line for each."""
    found = []
    for number, (case, _) in enumerate(cases):
        solved = solve(case, solver, most_direct)
        if number == 0:  # the first run has loaded libraries and compiled forms
            solved = solve(case, solver, most_direct)
        found.append(solved)
        print(
            f"{number + 1:4}/{len(cases)} {solved.seconds:8.2f} s {solved.cpu:8.2f} s cpu {solved.dofs:9d} dofs "
            f"{solved.iterations:4d} its  F {solved.force:.6g} N  {solved.case}",
            flush=True,
        )
    return found


def forces(dataset: Path) -> FloatArray:
    """Return F (N) of all cases; NaN where there is none."""
    with xr.open_dataset(dataset) as data:
        return np.array(data["force"].values)


def report(study: Study, result: dict[str, Any]) -> str:
    """Return the comparison in markdown."""
    loop, measured = result["plain_loop"], result["measured"]
    rows = [
        {
            "": name,
            "time (s)": own["seconds"],
            "processor time (s)": own["cpu"],
            "ratio": loop["seconds"] / own["seconds"],
            "ratio, processor": loop["cpu"] / own["cpu"],
        }
        for name, own in {"plain loop, no error bars, no F_exact": loop, **result["program"]}.items()
    ]
    columns = {"": "", "time (s)": ".0f", "processor time (s)": ".0f", "ratio": ".1f", "ratio, processor": ".1f"}
    parts = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in loop["parts"].items())
    worst = max(measured, key=lambda one: abs(one["deviation"]))
    return (
        f"`{study.name}`: {result['cases']} cases, {len(measured)} of them timed in the plain loop.\n\n"
        f"{markdown(rows, columns)}\nParts of the plain loop: {parts}.\n\n"
        f"Its F differs from the program's by {100 * result['median_deviation']:.2f} % in the median, at most by "
        f"{100 * worst['deviation']:+.2f} % ({worst['case']}).\n\n"
        f"Reductions change F by {result['reduced']:.1e} at most.\n"
    )


def totals(cases: Sequence[tuple[Case, float]], solved: Sequence[Solved]) -> dict[str, Any]:
    """Return the cost of the whole loop, each case counted for all cases that it represents."""

    def total(value: Callable[[Solved], float]) -> float:
        return sum(weight * value(one) for (_, weight), one in zip(cases, solved, strict=True))

    parts = {name: total(lambda one, name=name: one.parts[name]) for name in solved[0].parts}
    return {"seconds": total(lambda one: one.seconds), "cpu": total(lambda one: one.cpu), "parts": parts}


def main() -> int:
    """Run all; return 1 if the forces differ by more than the elements explain."""
    parser = options(__doc__)
    parser.add_argument("study", nargs="?", type=Path, default=ROOT / "studies" / "figure3.toml")
    parser.add_argument("--sample", type=int, help="time so many cases only, and extrapolate")
    parser.add_argument("--parts", type=int, default=4, help="of these, one is run without reductions")
    parser.add_argument("--solver", choices=SOLVERS, default="gamg", help="for what is too large for a direct solve")
    parser.add_argument("--most-direct", type=int, default=MOST_DIRECT, help="unknowns up to which MUMPS solves")
    asked = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    study = read_study(asked.study)
    cases = chosen(study, asked.sample)
    ways: dict[str, dict[str, Any]] = {
        _WITH: {},
        "this program, error bars": {"exact": False},
        _WHOLE: {"parts": asked.parts},
    }
    with TemporaryDirectory() as folder:
        run_program(read_study(_WARM_UP), Path(folder, "warm-up"))
        program = {}
        for number, (name, how) in enumerate(ways.items()):
            program[name] = run_program(study, Path(folder, str(number)), **how)
            print(f"{name}: {program[name]['seconds']:.0f} s, {program[name]['cpu']:.0f} s cpu", flush=True)
        with threadpool_limits(limits=1):
            solved = run_loop(cases, asked.solver, asked.most_direct)
        with_all, _, whole = (forces(own.pop("dataset")) for own in program.values())
    deviations = [one.force / float(with_all[one.index]) - 1 for one in solved]
    result = {
        "study": study.name,
        "cases": len(list(study.cases())),
        "machine": machine(),
        "solver": asked.solver,
        "most_direct": asked.most_direct,
        "program": program,
        "plain_loop": totals(cases, solved),
        "reduced": float(np.nanmax(np.abs(whole / with_all - 1))),
        "median_deviation": float(np.median(np.abs(deviations))),
        "measured": [
            asdict(one) | {"stands_for": weight, "deviation": deviation}
            for (_, weight), one, deviation in zip(cases, solved, deviations, strict=True)
        ],
    }
    text = report(study, result)
    write("plain_loop", asked.output, result, text)
    print(f"\n{text}")
    return int(max(map(abs, deviations)) > _DIFFER)


if __name__ == "__main__":
    raise SystemExit(main())
