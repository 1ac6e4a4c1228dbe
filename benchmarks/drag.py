"""A tool dragged over the model of a liver for a minute at 1 kHz: continuity, passivity, error bars, latency.

    python -m benchmarks.drag [--model liver] [--seconds 60] [--places 50] [--minutes 60] [--output results]

`drag.c`, beside the evaluator, moves a mass, coupled to a hand by a spring and a damper, along a random smooth path in
and out of contact. Tools: a disc, a ball, and a cone of 70 degrees. For each: the largest change of the force in a
millisecond, and that which the path's speed and the model's gradient allow; the least energy that a touch takes from
the hand, and the energy that is left in the tissue out of contact, as a share of the largest; the time of a query.
``--places`` of the path, with their depths, are solved in full. Solved ones are kept in results/realtime/. After
--minutes of processor time no more are solved. It prints a table, and draws the histogram of times into
OUTPUT/drag.png.
"""

import argparse
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, radians
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.realtime import model_of
from benchmarks.tables import markdown
from benchmarks.touches import groups_of, keep
from epsmesh.arrays import FloatArray
from epsmesh.report.figures.style import COLOURS
from epsmesh_realtime.export.checks import Check, solved
from epsmesh_realtime.export.full import Solver, Tool
from epsmesh_realtime.model import Model

_FOLDER, _SOURCES = Path("results/realtime"), Path(__file__).parents[1] / "pipeline" / "epsmesh_realtime" / "c"
_CHECKS, _SEED = 12, 7
# Radius of the tool and its largest depth, in units of the largest contact at the worst place.
TOOLS = {"disc": (0.55, 0.08), "ball": (1.6, 0.12), "cone": (0.7, 0.1)}
_ANGLE = radians(70)
# Accuracies of the full solves: of discs, and of tools whose contact is found.
_PRECISE, _PRECISE_ROUND = 0.001, 0.01
# Below this depth, in units of the deepest, a place is not solved: contact is then smaller than elements.
_SHALLOW = 0.3
_COLUMNS = (
    "tool", "in contact", "largest force", "largest jump in 1 ms", "allowed there", "touches",
    "least energy lost in one", "largest in mass and spring", "left in tissue", "processor, p50 / p99 / p99.9 µs",
    "elapsed, p50 / p99 µs", "places", "median error", "largest", "within the bar", "median bar",
)  # fmt: skip


@dataclass(frozen=True)
class Drag:
    """What a drag found, for each millisecond: forces (n, 3), in N, on tips (n, 3), in m, and depths (n,), in m.

    ``steep`` (n,), in N/m, is the Frobenius norm of the force's gradient; ``work`` (n,) that of the hand, ``stored``
    (n,) the energy of mass and spring, in J; ``took`` and ``own`` (n,) the elapsed time and that of the processor, in
    µs; ``status`` (n,) the model's.
    """

    status: FloatArray
    tips: FloatArray
    forces: FloatArray
    depths: FloatArray
    steep: FloatArray
    work: FloatArray
    stored: FloatArray
    took: FloatArray
    own: FloatArray

    @property
    def jumps(self) -> FloatArray:
        """The size of the force's change (N) in each millisecond but the first."""
        return np.asarray(np.linalg.norm(np.diff(self.forces, axis=0), axis=1))

    @property
    def rates(self) -> FloatArray:
        """The change that the gradient allows for each of :attr:`jumps`, by the larger one of both ends."""
        steps = np.linalg.norm(np.diff(self.tips, axis=0), axis=1)
        return np.asarray(np.maximum(self.steep[1:], self.steep[:-1]) * steps)

    @property
    def in_tissue(self) -> FloatArray:
        """The energy (J) that the tool has put into the tissue, by the trapezoidal rule."""
        steps = -0.5 * (self.forces[1:] + self.forces[:-1]) * np.diff(self.tips, axis=0)
        return np.concatenate([[0.0], np.cumsum(steps.sum(axis=1))])

    @property
    def left(self) -> float:
        """The largest difference (J) of the tissue's energies while the tool does not touch it."""
        return float(np.ptp(self.in_tissue[self.depths == 0]))

    @property
    def lost(self) -> FloatArray:
        """The energy (J) that each touch took from the hand, without that in mass and spring.

        From one lift-off to the next; not negative if the loop is passive.
        """
        lifted = np.flatnonzero((self.depths[1:] == 0) & (self.depths[:-1] > 0))
        return np.asarray(np.diff((self.work - self.stored)[lifted + 1]))


def built(folder: Path) -> Path:
    """Return the program, compiled into ``folder``."""
    program = folder / "drag"
    sources = [str(_SOURCES / name) for name in ("epsmesh.c", "drag.c")]
    subprocess.run(["cc", "-std=c99", "-O2", *sources, "-o", str(program), "-lm"], check=True)
    return program


def sizes(model: Model, tool: str) -> tuple[float, float]:
    """Return the radius and the largest depth (m) of a tool for a model."""
    most = model.largest * min(model.room(x, y) for x in _ends(model, 0) for y in _ends(model, 1))
    radius, depth = TOOLS[tool]
    return radius * most, depth * most


def _ends(model: Model, axis: int) -> tuple[float, float]:
    return -0.85 * model.table.reach[axis], 0.85 * model.table.reach[axis]


def dragged(program: Path, file: Path, model: Model, tool: str, seconds: float, *, paced: bool) -> Drag:
    """Return a drag of a tool over a model's ``file``."""
    kind = list(TOOLS).index(tool)
    asked = [str(program), str(file), str(kind), *map(repr, sizes(model, tool)), f"{seconds:g}", str(_SEED + kind)]
    done = subprocess.run([*asked, "1" if paced else "0"], check=True, capture_output=True, text=True)
    rows = np.loadtxt(done.stdout.splitlines())
    status, rest = rows[:, 0], rows[:, 7:]
    return Drag(status, rows[:, 1:4], rows[:, 4:7], *rest.T)


def places(model: Model, found: Drag, tool: str, count: int) -> list[Check]:
    """Return random places of a drag, in contact, as touches that are not solved yet."""
    rng, (radius, deepest) = np.random.default_rng(_SEED), sizes(model, tool)
    kind = list(TOOLS).index(tool)
    ticks = rng.permutation(np.flatnonzero((found.status == 0) & (found.depths > _SHALLOW * deepest)))[:count]
    asked = []
    for tip in found.tips[ticks]:
        _, at, depth = model.foot(tip.tolist())
        x, y, _ = (at - model.origin) @ model.axes.T
        name = {"ball": "sphere"}.get(tool, tool)
        angle = _ANGLE if tool == "cone" else 0.0
        what = Tool(name, radius, angle, contact="frictionless" if tool == "disc" else "unilateral")
        nan = float("nan")
        asked.append(Check(float(x), float(y), radius, depth, model.poisson, nan, nan, nan, nan, kind, what))
    return asked


def _row(tool: str, found: Drag, checks: list[Check]) -> dict[str, str]:
    worst = int(np.argmax(found.jumps))
    energy = found.in_tissue
    errors, bars = np.abs([check.error for check in checks]), [check.bar for check in checks]
    own, took = (np.percentile(times, [50, 99, 99.9]) for times in (found.own, found.took))
    held, shares = str(sum(check.is_covered for check in checks)), [""] * 3
    if checks:
        shares = [f"{100 * value:.2g} %" for value in (np.median(errors), max(errors), np.median(bars))]
    return dict(
        zip(
            _COLUMNS,
            [
                tool,
                f"{100 * np.mean(found.status == 0):.0f} %",
                f"{1e3 * np.linalg.norm(found.forces, axis=1).max():.3g} mN",
                f"{1e3 * found.jumps[worst]:.2g} mN",
                f"{1e3 * found.rates[worst]:.2g} mN",
                str(len(found.lost)),
                f"{1e6 * found.lost.min():.2g} µJ",
                f"{1e6 * found.stored.max():.2g} µJ",
                f"{found.left / np.ptp(energy):.1e}",
                f"{own[0]:.1f} / {own[1]:.1f} / {own[2]:.1f}",
                f"{took[0]:.1f} / {took[1]:.1f}",
                str(len(checks)),
                *shares[:2],
                held,
                shares[2],
            ],
            strict=True,
        )
    )


def draw(found: Mapping[str, Drag], path: Path) -> None:
    """Draw the histograms of the processor times."""
    figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
    edges = np.geomspace(0.5, 50, 90)
    for colour, (tool, one) in zip(COLOURS, found.items(), strict=False):
        axes.hist(
            one.own, edges, histtype="step", color=colour, label=f"{tool}: p99 {np.percentile(one.own, 99):.1f} µs"
        )
    axes.set(xscale="log", yscale="log", xlabel="processor time of a query, µs", ylabel="milliseconds of the drag")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Drag, solve, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="liver", help="of `benchmarks.realtime`")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--places", type=int, default=50, help="solved in full, of all tools")
    parser.add_argument("--minutes", type=float, default=inf, help="of processor time for full solves")
    parser.add_argument("--output", type=Path, default=Path("results"))
    asked = parser.parse_args()
    model, scope = model_of(asked.model, _FOLDER, _CHECKS)
    end, found, rows = time.process_time() + 60 * asked.minutes, {}, []
    with TemporaryDirectory() as folder:
        program = built(Path(folder))
        for tool in TOOLS:
            found[tool] = dragged(program, _FOLDER / f"{asked.model}.epsm", model, tool, asked.seconds, paced=True)
    shares = [asked.places - 2 * (asked.places // 3), asked.places // 3, asked.places // 3]
    for (tool, one), count in zip(found.items(), shares, strict=True):
        path = _FOLDER / f"{asked.model}.drag.{tool}.jsonl"
        accuracy = _PRECISE if tool == "disc" else _PRECISE_ROUND
        solver = Solver(scope.sections, scope.file, scope.young, accuracy)
        known = groups_of(path)
        for number, place in enumerate(places(model, one, tool, count)):
            if number not in known and time.process_time() < end:
                known[number] = solved(model, solver, place, None)
                keep(path, number, known[number])
        rows.append(_row(tool, one, [check for group in known.values() for check in group]))
    asked.output.mkdir(parents=True, exist_ok=True)
    print(markdown(rows, dict.fromkeys(_COLUMNS, "")))
    draw(found, asked.output / "drag.png")


if __name__ == "__main__":
    main()
