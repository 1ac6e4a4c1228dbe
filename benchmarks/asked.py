"""What an accuracy gives: error bar and true error over the required accuracy, on random scenes of each tool.

    python -m benchmarks.asked [--tools NAME ...] [--count N] [--seed N]

Scenes are those of :mod:`benchmarks.families`, solved in three dimensions, or on their meridian, with accuracies of 2
to 0.1 %. The truth is axisymmetric where it can be, otherwise solved with an accuracy of 0.03 %. It takes five minutes
on an idle machine.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.families import FAMILIES, Dice, Thrown
from benchmarks.machine import machine
from benchmarks.scenes import record_of
from benchmarks.tables import markdown, options, write
from epsmesh.run.record import Record
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.verification.sections import Section

ASKED = (2e-2, 1e-2, 5e-3, 3e-3, 1e-3)
SEED, COUNT = 5101, 5
# Scenes drawn for one that is asked for, at most.
_MOST_DRAWN = 400


@dataclass(frozen=True)
class Tool:
    """Scenes of a ``family`` under probes of a shape; ``truth`` is the accuracy of the converged force.

    ``without`` names reductions that are not used.
    """

    family: str
    shape: str
    truth: str = "0.01 %"
    picks: Callable[[Section], bool] = lambda _: True
    without: tuple[str, ...] = ("axisymmetric",)


def _off_centre(scene: Section) -> bool:
    return scene["body"]["shape"] == "box" or "at" in scene["probe"]


TOOLS = {
    "disc, round scene": Tool("proportions", "disc"),
    "disc, box or off centre": Tool("design", "disc", "0.03 %", _off_centre),
    "blade": Tool("design", "blade", "0.03 %"),
    "ball": Tool("tools", "sphere"),
    "cone": Tool("tools", "cone"),
    "disc in contact": Tool("tools", "disc"),
    "disc, on the meridian": Tool("proportions", "disc", without=()),
    "ball, on the meridian": Tool("tools", "sphere", without=()),
    "friction, on the meridian": Tool("friction", "sphere", "0.1 %", without=()),
}


@dataclass(frozen=True)
class Trial:
    """One scene with an accuracy: bar and true error relative to F, processor time (s) and unknowns."""

    tool: str
    asked: float
    bar: float
    error: float
    seconds: float
    dofs: int
    message: str


def trials(tool: str, count: int, seed: int) -> Iterator[Trial]:
    """Yield the trials of ``count`` random scenes of a tool, for each accuracy; without those that have no truth."""
    random = np.random.default_rng(seed)
    for scene in _scenes(TOOLS[tool], count, random):
        truth, _ = _solve(scene, TOOLS[tool].truth, ())
        if not truth.is_ok:
            continue
        for asked in ASKED:
            found, seconds = _solve(scene, f"{100 * asked:g} %", TOOLS[tool].without)
            error = abs(found.force / truth.force - 1)
            yield Trial(tool, asked, found.force_error, error, seconds, found.dofs, found.message)


def _scenes(tool: Tool, count: int, random: np.random.Generator) -> Iterator[Section]:
    found = 0
    for _ in range(_MOST_DRAWN * count):
        scene = _thrown(tool, random)[0]
        if scene["probe"]["shape"] != tool.shape or not tool.picks(scene):
            continue
        try:
            parse({**scene, "mesh": {"accuracy": "1 %"}})
        except StudyError:  # an invalid draw, such as a footprint over the edge
            continue
        yield scene
        found += 1
        if found == count:
            return


def _thrown(tool: Tool, random: np.random.Generator) -> Thrown:
    return FAMILIES[tool.family].draw(Dice(random))


def _solve(scene: Section, accuracy: str, without: tuple[str, ...]) -> tuple[Record, float]:
    start = time.process_time()
    record = record_of({**scene, "mesh": {"accuracy": accuracy}, "solve": {"exact": False}}, without)
    return record, time.process_time() - start


def table(found: Sequence[Trial]) -> str:
    """Return, in markdown, medians and 90 % values by tool, and by accuracy."""
    rows = []
    for name in (*TOOLS, *ASKED):
        own = [trial for trial in found if name in (trial.tool, trial.asked)]
        if own:
            bars, errors = (np.array([getattr(t, key) / t.asked for t in own]) for key in ("bar", "error"))
            rows.append(
                {
                    "tool, or accuracy": name if isinstance(name, str) else f"{100 * name:g} %",
                    "cases": len(own),
                    "bar / asked": _both(bars),
                    "error / asked": _both(errors),
                    "error below bar": f"{int(np.sum(errors <= bars))} of {len(own)}",
                    "reached": int(np.sum(bars <= 1)),
                    "processor time": f"{np.median([t.seconds for t in own]):.2f} s",
                }
            )
    return markdown(rows, dict.fromkeys(rows[0], ""))


def _both(values: np.ndarray) -> str:
    return f"{np.median(values):.2f}, {np.percentile(values, 90):.2f}"


def main(arguments: list[str]) -> int:
    """Run, print, write asked.json and asked.md; return 1 if more than 5 % of the errors exceed their bars."""
    parser = options(__doc__)
    parser.add_argument("--tools", nargs="+", choices=list(TOOLS), default=list(TOOLS))
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes of each tool")
    parser.add_argument("--seed", type=int, default=SEED)
    chosen = parser.parse_args(arguments)
    found: list[Trial] = []
    for tool in chosen.tools:
        for trial in trials(tool, chosen.count, chosen.seed):
            found.append(trial)
            print(
                f"{tool:24} {100 * trial.asked:4g} %  bar {100 * trial.bar:7.4f} %  error {100 * trial.error:7.4f} %  "
                f"{trial.seconds:5.2f} s  {trial.message}",
                flush=True,
            )
    text = table(found)
    content = {"machine": machine(), "seed": chosen.seed, "trials": [asdict(trial) for trial in found]}
    write("asked", chosen.output, content, text)
    print("", text, sep="\n")
    return int(sum(trial.error > trial.bar for trial in found) > 0.05 * len(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
