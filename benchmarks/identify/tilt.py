"""How often bars of `epsmesh identify` hold where baselines tilt: two punches on a pad, with much and with little air.

    python -m benchmarks.identify.tilt [--count N] [--seed N]

The baseline tilts by 1 to 5 % of the slope in contact, and drifts in time. The drift is an unknown, or none: at a
constant speed it then adds to the tilt. Forces are closed forms, in the fit as well. The exit status is 1 if fewer
bars hold than 95 %.
"""

import sys
from collections.abc import Sequence
from statistics import median

import numpy as np

from benchmarks.identification import CORRELATIONS, HELD, noise
from benchmarks.tables import Table, options
from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.parts import Estimate, Measured, Unknown, Values
from epsmesh_identify.experiment.curve import Curve

COUNT, SEED, DEEPEST = 200, 20290, 2e-4
# Air before contact, as shares of the depth in contact.
AIR = {"long air": (0.5, 1.0), "short air": (0.0, 0.2)}
_YOUNG = Unknown("young", 1e3, 1e6, "Pa", is_logarithmic=True)
_POISSON = Unknown("poisson", 0.2, 0.5, "1")
_DRIFT = Unknown("drift", -np.inf, np.inf, "N/s", is_wanted=False)


class Punch:
    """A flat punch of a ``radius`` (m) on a pad that makes it stiffer by the share ``pad``, more so near nu = .5."""

    names = ("young", "poisson")

    def __init__(self, radius: float, pad: float):
        self.radius, self.pad = radius, pad

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        poisson = values["poisson"]
        stiffer = 1 + self.pad * (1 + 4 * (poisson / 0.5) ** 4)
        return np.asarray(2 * values["young"] / (1 - poisson**2) * self.radius * stiffer * np.maximum(depth, 0.0))

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        return np.full(len(depth), 1e-3)


def curve(punch: Punch, rng: np.random.Generator, truth: Values, correlation: float, air: tuple[float, float]) -> Curve:
    """Return a curve with a tilting, drifting baseline."""
    count = int(rng.integers(100, 450))
    depth, time = np.linspace(-rng.uniform(*air) * DEEPEST, DEEPEST, count), np.linspace(0, 10, count)
    force = punch.force(depth, truth)
    tilt = rng.uniform(0.01, 0.05) * rng.choice([-1, 1]) * depth / DEEPEST
    drift = 0.02 * rng.normal() * time / 10
    error = 10 ** rng.uniform(-2.7, -2) * noise(rng, force / force.max(), correlation)
    recorded = force + force.max() * (error + tilt + drift + 0.1 * rng.normal())
    return Curve(f"punch {punch.radius}", depth + 1e-4, recorded, time)


def trial(seed: tuple[int, int], air: tuple[float, float], *, drifts: bool) -> tuple[Values, Estimate]:
    """Return what is true of an experiment, and what was found."""
    rng, correlation = np.random.default_rng(seed), CORRELATIONS[seed[1] % len(CORRELATIONS)]
    truth = {"young": 10 ** rng.uniform(3.5, 5.5), "poisson": rng.uniform(0.3, 0.48)}
    punches = (Punch(1e-3, 0.05), Punch(4e-3, 1.0))
    measured = [Measured(curve(punch, rng, truth, correlation, air), punch) for punch in punches]
    return truth, identify(measured, [_YOUNG, _POISSON, *([_DRIFT] if drifts else [])])


def row(name: str, found: Sequence[tuple[Values, Estimate]]) -> dict[str, object]:
    """Return coverage and half widths of both unknowns, of experiments that have bars."""
    barred = [(truth, one) for truth, one in found if one.fits]
    values: dict[str, object] = {"curves": name, "number": len(found), "noted": 1 - len(barred) / len(found)}
    for place, unknown in enumerate(("young", "poisson")):
        held = [one.low[place] <= truth[unknown] <= one.high[place] for truth, one in barred]
        half = median((one.high[place] - one.low[place]) / 2 / truth[unknown] for truth, one in barred)
        values |= {f"{unknown} held": float(np.mean(held)), f"{unknown} half width": half}
    return values


_COLUMNS = {
    "curves": "", "number": "d", "young held": ".1%", "young half width": ".1%", "poisson held": ".1%",
    "poisson half width": ".1%", "noted": ".1%",
}  # fmt: skip


def main() -> int:
    parser = options(__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of experiments of each row")
    parser.add_argument("--seed", type=int, default=SEED, help="of all random numbers")
    given = parser.parse_args()
    table = Table(_COLUMNS)
    for name, air in AIR.items():
        for drifts in (True, False):
            found = [trial((given.seed, k), air, drifts=drifts) for k in range(given.count)]
            table.add(row(f"{name}, drift {'an' if drifts else 'no'} unknown", found))
    table.write("identification_tilt", given.output)
    held = [float(str(one[f"{name} held"])) for one in table.rows for name in ("young", "poisson")]
    return 0 if min(held) >= HELD else 1


if __name__ == "__main__":
    sys.exit(main())
