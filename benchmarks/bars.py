"""Do error bars hold: random scenes of every feature of the program, on good and naive meshes, against finer solutions.

    python -m benchmarks.bars [--only FEATURE ...] [--seeds FIRST:END] [--minutes N] [--output FOLDER]

Scenes, and what is solved as their truth, are those of :mod:`benchmarks.drawn`; a seed gives the same scene each time.
With ``--only``, each has one of these features: ``--only grasp pull "support that lets go"``. Rows go to NAME.jsonl,
where a later call goes on.
"""

import copy
import itertools
import json
import math
import resource
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, Protocol

import numpy as np
from scipy.stats import binomtest

from benchmarks.drawn import Drawn, more_steps, scene, truths
from benchmarks.tables import markdown, options, write
from tests.isolated import isolated
from tests.pairs import FEATURES, Study, tools
from tests.same.outcome import Outcome, solve
from tests.same.scenes import seconds, write_files

SEEDS = tomllib.loads((Path(__file__).parent / "seeds.toml").read_text(encoding="utf-8"))
# Limits: coverage of a class of this many scenes, and of all of them.
HELD, ALL_HELD, ENOUGH = 0.95, 0.97, 40
_KNOWN = 1 / 3  # the truth's own bar may be this share of the scene's at most
_LONG = 60.0  # seconds that the truth may take, as planned
_LIMIT = 120  # seconds of the processor after which a scene is given up
_COLUMNS = {"class": "", "scenes": "d", "held": "d", "share": ".1%", "95 %": "", "bar / error": ".2f", "worst": ".2f"}

Values = dict[str, float]


class Look(AbstractContextManager[Any], Protocol):
    """What follows a scene's solve, and then reads off its results and those of its truth what is wanted of them."""

    def read(self, found: Outcome, truth: Outcome) -> dict[str, Any]:
        """Return what a row keeps as ``raw``: what JSON can write."""


@dataclass(frozen=True)
class Row:
    """A scene: its classes, the relative bar of F, and of each quantity its error, in bars, and its truth's own bar.

    ``result`` is "judged", or why it is not: what became of the scene, or of its truth. ``raw`` is what a caller reads
    off both.
    """

    seed: int
    result: str
    classes: dict[str, str] = field(default_factory=dict)
    bar: float = math.nan
    errors: dict[str, float] = field(default_factory=dict)
    truths: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    raw: dict[str, Any] = field(default_factory=dict)

    @property
    def main(self) -> str:
        """The quantity that the scene is about: the depth where the force is given."""
        return "depth" if "depth" in self.errors else "force"


def judged(
    seed: int,
    folder: Path,
    drawn: Drawn = scene,
    finer_than: Callable[[Study, float], Iterable[Study]] = truths,
    look: Look | None = None,
    longest: float = _LONG,
) -> Row:
    """Solve a scene and its truth, and compare; a process that needs too long is ended by the system.

    Studies ``finer_than`` it, for its relative bar, are tried as its truth if they take at most the ``longest`` time
    (s), as planned. ``look`` follows the scene's solve.
    """
    start = limit_processor()
    study, classes = drawn(seed, folder)
    with look or nullcontext():
        found = solve(copy.deepcopy(study), folder)

    def row(
        result: str, bar: float = math.nan, errors: Values | None = None, known: Values | None = None, **raw: Any
    ) -> Row:
        return Row(seed, result, classes, bar, errors or {}, known or {}, time.process_time() - start, raw)

    if not found.is_taken:
        return row(f"{found.kind}: {' '.join(found.message.split())[:300]}")
    bar, truth = relative_bar(found, _main(study)), truth_of(study, found, folder, finer_than, longest)
    if isinstance(truth, str):
        return row(truth, bar)
    return row("judged", bar, *compared(found, truth), **(look.read(found, truth) if look else {}))


def truth_of(
    study: Study,
    found: Outcome,
    folder: Path,
    finer_than: Callable[[Study, float], Iterable[Study]] = truths,
    longest: float = _LONG,
) -> Outcome | str:
    """Return the finer solution of a scene that was ``found``, known to a third of its bar, or why there is none."""
    name = _main(study)
    reason = "its truth takes too long"
    for finer in finer_than(study, relative_bar(found, name)):
        if seconds(finer, folder) > longest:
            continue
        with more_steps(finer):
            truth = solve(copy.deepcopy(finer), folder)
        if not truth.is_taken:
            reason = f"its truth {truth.kind}: {' '.join(truth.message.split())[:200]}"
        elif compared(found, truth)[1].get(name, math.inf) <= _KNOWN:
            return truth
        else:
            reason = "its truth is not known well enough"
    return reason


def limit_processor(most_seconds: int = _LIMIT) -> float:
    """Return the processor's time (s) of this process, which the system ends after ``most_seconds`` more."""
    start = time.process_time()
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(start) + most_seconds, most))
    return start


def _main(study: Study) -> str:
    return "depth" if "force" in tools(study)[0] else "force"


def relative_bar(found: Outcome, name: str) -> float:
    """Return the largest bar of a quantity, relative to it."""
    value = found.values[name]
    with np.errstate(all="ignore"):
        return float(np.nanmax(value.bars / np.abs(value.numbers)))


def compared(found: Outcome, truth: Outcome) -> tuple[Values, Values]:
    """Return of each quantity with a bar the largest error, in bars, and the truth's own bar there."""
    errors, known = {}, {}
    for name, value in found.values.items():
        other = truth.values.get(name)
        has_bar = np.isfinite(value.bars) & (value.bars > 0)
        if other is None or other.numbers.shape != value.numbers.shape or not has_bar.any():
            continue
        off = (np.abs(value.numbers - other.numbers)[has_bar] / value.bars[has_bar]).ravel()
        worst = int(np.argmax(np.where(np.isfinite(off), off, -1)))
        of_truth = (other.bars[has_bar] / value.bars[has_bar]).ravel()[worst]
        if np.isfinite(off[worst]):
            errors[name], known[name] = float(off[worst]), float(of_truth) if np.isfinite(of_truth) else math.inf
    # Where the force is given, it is no result.
    given = ("force", "closed_force") if "depth" in errors else ()
    return {name: error for name, error in errors.items() if not name.startswith(given)}, known


def table(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return a line for all scenes, each quantity and each class: scenes, bars that hold, their interval."""
    groups: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        if row.result != "judged":
            continue
        own = row.errors[row.main]
        groups["all"].append(own)
        for slot, name in row.classes.items():
            groups[f"{slot}: {name}"].append(own)
        for name, error in row.errors.items():
            if row.truths[name] <= _KNOWN:
                groups[f"quantity: {name}"].append(error)
    first = groups.pop("all", [])
    return [_line("all", first), *(_line(name, groups[name]) for name in sorted(groups))] if first else []


def interval(held: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of the share of bars that hold (E. B. Wilson, 1927), where ``held`` of ``count`` did."""
    found = binomtest(held, count).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


def _line(name: str, errors: list[float]) -> dict[str, Any]:
    held = sum(error <= 1 for error in errors)
    low, high = interval(held, len(errors))
    return {
        "class": name, "scenes": len(errors), "held": held, "share": held / len(errors),
        "95 %": f"{low:.1%} to {high:.1%}", "bar / error": 1 / max(median(errors), 1e-9),
        "worst": max(errors),
    }  # fmt: skip


def report(rows: list[Row]) -> str:
    """Return the text of the tables."""
    lines, left = table(rows), defaultdict(list)
    for row in rows:
        if row.result != "judged":
            left[row.result.split(":")[0]].append(row)
    missed = [line["class"] for line in lines if line["share"] < (ALL_HELD if line["class"] == "all" else HELD)]
    text = f"{len(rows)} scenes, {sum(row.seconds for row in rows):.0f} s of the processor. "
    text += f"Not judged: {', '.join(f'{len(some)} ({reason})' for reason, some in sorted(left.items())) or 'none'}.\n"
    few = {line["class"] for line in lines if line["scenes"] < ENOUGH}
    text += f"Classes of {ENOUGH} scenes and more below {HELD:.0%}, or all below {ALL_HELD:.0%}: "
    text += f"{', '.join(name for name in missed if name not in few) or 'none'}.\n\n{markdown(lines, _COLUMNS)}"
    outside = [row for row in rows if any(e > 1 for n, e in row.errors.items() if row.truths.get(n, 1) <= _KNOWN)]
    text += "\nOutside their bars:\n\n| seed | scene | error, in bars |\n|---|---|---|\n"
    for row in outside:
        off = ", ".join(f"{name} {error:.2f}" for name, error in row.errors.items() if error > 1)
        text += f"| {row.seed} | {', '.join(row.classes.values())}; bar {row.bar:.2%} | {off} |\n"
    return text


def run(
    seeds: Iterable[int],
    limit: float = math.inf,
    told: Callable[[Row], None] = lambda row: None,
    drawn: Drawn = scene,
    judge: Callable[[int, Path, Drawn], Row] = judged,
) -> list[Row]:
    """Judge the scenes of some seeds, until ``limit`` (s) is over; a scene that ends its process is a row, too."""
    end, rows = time.monotonic() + limit, []
    with tempfile.TemporaryDirectory() as folder:
        write_files(Path(folder))
        timely = itertools.takewhile(lambda _: time.monotonic() < end, seeds)
        for (seed, *_), found in isolated(judge, ((seed, Path(folder), drawn) for seed in timely)):
            rows.append(found if isinstance(found, Row) else Row(seed, "took too long"))
            told(rows[-1])
    return rows


def resumed(
    log: Path,
    seeds: Collection[int],
    limit: float,
    drawn: Drawn = scene,
    judge: Callable[[int, Path, Drawn], Row] = judged,
) -> list[Row]:
    """Return the rows of some seeds in a ``log``, after judging those it lacks for at most ``limit`` (s)."""
    log.parent.mkdir(parents=True, exist_ok=True)
    rows = [Row(**json.loads(line)) for line in log.read_text().splitlines()] if log.exists() else []
    done = {row.seed for row in rows}
    with log.open("a", encoding="utf-8") as file:

        def note(row: Row) -> None:
            print(json.dumps(asdict(row), ensure_ascii=False), file=file, flush=True)
            print(row.seed, ", ".join(row.classes.values()), row.result, _words(row), flush=True)

        rows += run((seed for seed in seeds if seed not in done), limit, note, drawn, judge)
    return [row for row in rows if row.seed in seeds]


def campaign(
    arguments: list[str],
    about: str | None,
    name: str,
    drawn: Drawn,
    told: Callable[[list[Row]], str],
    judge: Callable[[int, Path, Drawn], Row] = judged,
    count: int = 1000,
    choices: Collection[str] = (),
) -> list[Row]:
    """Run the scenes that the options in ``arguments`` name, write and print what is ``told`` of them, return the rows.

    Without the option they are ``count`` of the test. The log is NAME-KIND.jsonl, where KIND says what the seeds are
    for; a later call goes on there. With ``choices``, an option draws the scenes of some of these features alone, in a
    log of their own.
    """
    parser = options(about)
    first, _ = SEEDS["test"]
    if choices:
        parser.add_argument("--only", nargs="+", choices=choices, default=[], metavar="FEATURE", help="of scenes")
    parser.add_argument("--seeds", default=f"{first}:{first + count}", help="FIRST:END")
    parser.add_argument("--minutes", type=float, default=math.inf, help="stop after this time; a later call goes on")
    asked = parser.parse_args(arguments)
    if choices and asked.only:
        drawn = partial(scene, only=tuple(asked.only))
        name = "-".join([name, *(feature.replace(" ", "_") for feature in asked.only)])
    first, end = map(int, asked.seeds.split(":"))
    kind = next((name for name, (low, high) in SEEDS.items() if low <= first < end <= high), "sealed")
    log = asked.output / f"{name}-{kind}.jsonl"
    rows = resumed(log, range(first, end), 60 * asked.minutes, drawn, judge)
    text = told(rows)
    write(name if kind == "test" else f"{name}-{kind}", asked.output, [asdict(row) for row in rows], text)
    print(text)
    return rows


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status: 1 if bars do not hold."""
    features = [feature.name for feature in FEATURES]
    return status(campaign(arguments, __doc__, "bars", scene, report, choices=features))


def status(rows: list[Row]) -> int:
    """Return the exit status: 1 if bars do not hold on all scenes, or on a class of enough of them."""
    lines = table(rows)
    return int(not lines or any(
        line["share"] < HELD for line in lines if line["scenes"] >= ENOUGH or line["class"] == "all"
    ))  # fmt: skip


def _words(row: Row) -> str:
    return " ".join(f"{name} {error:.2f}" for name, error in row.errors.items())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
