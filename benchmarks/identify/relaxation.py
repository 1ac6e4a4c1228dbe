"""Coverage of the bars of relaxation by `epsmesh identify`, on synthetic curves of a ball that presses and holds.

    python -m benchmarks.identify.relaxation [--count N] [--seed N] [--store FILE]

Elastic forces are from the integral equation of layered bodies, the hereditary integral is a sum over small steps; the
fit has a surrogate of finite-element solves on the meridian. E, the share and the time of one term are wanted. Contact
point and baseline are unknown, the thickness is known to ± 5 %. The exit status is 1 if fewer bars hold than asked.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np

from benchmarks.campaigns import ended_soon
from benchmarks.identify.one_curve import (
    CORRELATIONS,
    DEEPEST,
    HELD,
    THICKNESS,
    Tool,
    force_of,
    least_squares,
    noise,
    tools,
)
from benchmarks.tables import Table, options
from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.parts import Estimate, Measured, Unknown
from epsmesh_identify.experiment.curve import Curve

SEED, COUNT = 20280, 60
HOLD, STEPS = 20.0, 4000
UNKNOWNS = (
    Unknown("young", 1e3, 1e6, "Pa", is_logarithmic=True),
    Unknown("relaxation_share_1", 0.0, 0.95, "1"),
    Unknown("relaxation_time_1", 0.05, 100.0, "s", is_logarithmic=True),
    Unknown("thickness", 2.6e-3, 3.4e-3, "m", prior=(THICKNESS, 0.025 * THICKNESS), is_wanted=False),
)
WANTED = 3


@dataclass(frozen=True)
class Trial:
    """One experiment: what is true (WANTED,), what was found, and the ends (WANTED,) of least squares."""

    truth: FloatArray
    correlation: float
    found: Estimate
    squares: tuple[FloatArray, FloatArray]
    seconds: float


def experiment(tool: Tool, rng: np.random.Generator, correlation: float) -> tuple[Measured, FloatArray]:
    """Return a curve of a ramp and a hold, and the true modulus (Pa), share and time (s)."""
    young, deepest = 10 ** rng.uniform(3.5, 5.5), DEEPEST * rng.uniform(0.3, 0.95)
    share, tau, ramp = rng.uniform(0.2, 0.6), 10 ** rng.uniform(-0.3, 0.9), 10 ** rng.uniform(-0.3, 0.5)
    time = np.linspace(0.0, ramp + HOLD, int(rng.integers(250, 500)))
    air = rng.uniform(0.3, 1.0) * deepest
    # Small steps of the time from the ramp's start to its end, and what each adds to the force in its middle.
    fine = np.linspace(0.0, ramp, STEPS)
    added = np.diff(force_of(tool, rng, "", young, np.linspace(-air, deepest, STEPS)))
    past = np.maximum(time[:, None] - (fine[1:] + fine[:-1]) / 2, 0.0)
    has_been = np.clip((time[:, None] - fine[:-1]) / np.diff(fine), 0.0, 1.0)
    force = (has_been * (1 - share * (1 - np.exp(-past / tau)))) @ added
    depth = np.interp(time, [0.0, ramp], [-air, deepest])
    largest, size = float(force.max()), 10 ** rng.uniform(-2.7, -1.7)
    recorded = force + largest * (size * noise(rng, force / largest, correlation) + 0.1 * rng.normal())
    curve = Curve("ramp and hold", depth + rng.uniform(-1, 1) * 1e-3, recorded, time)
    return Measured(curve, tool.forward), np.array([young, share, tau])


def trial(tool: Tool, seed: tuple[int, int], correlation: float) -> Trial:
    """Return one experiment with its fit."""
    measured, truth = experiment(tool, np.random.default_rng(seed), correlation)
    before = process_time()
    found = identify([measured], UNKNOWNS)
    seconds = process_time() - before
    low, high = least_squares(measured, UNKNOWNS)
    return Trial(truth, correlation, found, (low[:WANTED], high[:WANTED]), seconds)


def row(name: str, trials: Sequence[Trial]) -> dict[str, object]:
    """Return how often bars held, and their half widths relative to what is true (medians)."""
    barred = [one for one in trials if one.found.fits]
    held = np.mean([_holds(one.truth, one.found.low, one.found.high) for one in barred], axis=0)
    half = np.median([(one.found.high - one.found.low)[:WANTED] / 2 / one.truth for one in barred], axis=0)
    return {
        "noise": name,
        "number": len(trials),
        "least squares": float(np.mean([_holds(one.truth, *one.squares) for one in trials])),
        "E": held[0],
        "share": held[1],
        "time": held[2],
        "half width of E": half[0],
        "of the share": half[1],
        "of the time": half[2],
        "noted": 1 - len(barred) / len(trials),
        "seconds": median(one.seconds for one in trials),
    }


def _holds(truth: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    return np.asarray((low[:WANTED] <= truth) & (truth <= high[:WANTED]))


_COLUMNS = {
    "noise": "", "number": "d", "least squares": ".1%", "E": ".1%", "share": ".1%", "time": ".1%",
    "half width of E": ".1%", "of the share": ".1%", "of the time": ".1%", "noted": ".1%", "seconds": ".2f",
}  # fmt: skip


def main() -> int:
    parser = options(__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of experiments")
    parser.add_argument("--seed", type=int, default=SEED, help="of all random numbers")
    parser.add_argument("--store", type=Path, default=Path("results/identification.nc"), help="solved cases")
    given = parser.parse_args()
    with ended_soon():
        ball, _ = tools(given.store)
        found = [trial(ball, (given.seed, k), CORRELATIONS[k % len(CORRELATIONS)]) for k in range(given.count)]
    table = Table(_COLUMNS)
    for correlation in CORRELATIONS:
        table.add(row(f"correlation {correlation:g}", [one for one in found if one.correlation == correlation]))
    table.add(row("all", found))
    table.write("identification_relaxation", given.output)
    return 0 if min(float(str(table.rows[-1][name])) for name in ("E", "share", "time")) >= HELD else 1


if __name__ == "__main__":
    sys.exit(main())
