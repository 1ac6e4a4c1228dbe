"""Coverage of the bars of `epsmesh identify` on synthetic force curves, made by another model than that of the fit.

    python -m benchmarks.identify.one_curve [--count N] [--seed N] [--store FILE]

Curves are from the integral equation of layered bodies; the fit has a surrogate of finite-element solves on the
meridian. Contact point, baseline, drift, and the stiffness of the machine (± 10 %) are unknown, the thickness is known
to ± 5 %. The noise is autoregressive and white, in a third of the curves larger with the force. Every third body is not
as declared: it has a layer on top, its base is nearer, or its law stiffens. Besides, there are balls with a worn tip,
which no second bar is for. The exit status is 1 if a limit is missed.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
from mpi4py import MPI

from benchmarks.campaigns import ended_soon
from benchmarks.tables import Table, options
from epsmesh.arrays import FloatArray
from epsmesh.shapes.probe import Probe
from epsmesh.study.read import parse
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.fit import prior
from epsmesh_identify.estimation.forward import stored_in
from epsmesh_identify.estimation.may_hide import KINDS, hidden_parts
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.parts import Estimate, Forward, Measured, Unknown
from epsmesh_identify.estimation.start import start
from epsmesh_identify.estimation.tools import tip_of_probe
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.layered.body import RIGID, LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from epsmesh_identify.surrogate.build import build
from epsmesh_identify.surrogate.cases import domain_of
from epsmesh_identify.surrogate.derived import ON_MERIDIAN
from epsmesh_identify.surrogate.wide import profile_of

SEED, COUNT = 20260, 300
WORN = "worn ball"
CORRELATIONS = (0.0, 0.6, 0.9, 0.99)
POISSON, THICKNESS, DEEPEST = 0.45, 3e-3, 3e-4
# With so many experiments each row of the table has some.
_LEAST = 24
# A fit may be deeper than the true depth: forces are computed so much deeper, as in the command.
_DEEPER = 1.6
# Limits: coverage, median of bar over error, verdicts on wrong laws, and false ones.
HELD, WIDE, NOTED, FALSE = 0.95, 4.0, 0.4, 0.02

_BODY = {"shape": "cylinder", "radius": "60 mm", "height": "3 mm", "fixed": "bottom"}
_TOOLS = {
    "ball": {"shape": "sphere", "radius": "2 mm", "depth": "0.2 mm", "contact": "unilateral"},
    "punch": {"shape": "disc", "radius": "1 mm", "depth": "0.2 mm", "contact": "frictionless"},
}


@dataclass(frozen=True)
class Tool:
    """A tool on the declared body: its study and the surrogate of its force."""

    name: str
    study: Study
    forward: Forward

    @property
    def probe(self) -> Probe:
        return next(self.study.cases()).probe


@dataclass(frozen=True)
class Trial:
    """One experiment: what is true, what was found, the interval of least squares; ``hides`` is "" for right laws."""

    young: float
    correlation: float
    hides: str
    tool: str
    found: Estimate
    squares: tuple[float, float]
    seconds: float

    def holds(self, low: float, high: float) -> bool:
        return low <= self.young <= high

    @property
    def ratio(self) -> float:
        """Half width of the bar over the error."""
        return (self.found.high[0] - self.found.low[0]) / 2 / abs(self.found.estimate[0] - self.young)


def tools(store: Path) -> list[Tool]:
    """Return both tools with surrogates that are solved on the meridian, once."""
    found = []
    for name, probe in _TOOLS.items():
        raw = {
            "body": _BODY,
            "material": {"young": "10 kPa", "poisson": POISSON},
            "probe": probe,
            "mesh": {"accuracy": "0.1 %"},
        }
        study = parse(raw, file=f"{name}.toml")
        domain = domain_of(study, {"young": (1e3, 1e6), "thickness": (2.6e-3, 3.4e-3)}, _DEEPER * DEEPEST)
        found.append(Tool(name, study, build(domain, stored_in(store, MPI.COMM_SELF), ON_MERIDIAN)))
    return found


def noise(rng: np.random.Generator, share: FloatArray, correlation: float) -> FloatArray:
    """Return noise (n,) of unit variance at no force; ``share`` (n,) is F / F_max."""
    count, white, growth = len(share), rng.uniform(0, 0.4), rng.choice([0.0, 0.0, 2.0])
    steps = rng.normal(size=count) * np.sqrt(1 - correlation**2)
    slow = np.empty(count)
    slow[0] = rng.normal()
    for k in range(1, count):
        slow[k] = correlation * slow[k - 1] + steps[k]
    return (np.sqrt(1 - white) * slow + np.sqrt(white) * rng.normal(size=count)) * (1 + growth * share)


def force_of(tool: Tool, rng: np.random.Generator, hides: str, young: float, depth: FloatArray) -> FloatArray:
    """Return the true force (N), by the integral equation, of a body that hides something; "" for nothing."""
    profile, thickness = profile_of(tool.probe), THICKNESS * (1 + 0.025 * rng.normal())
    assert profile is not None  # both tools are round
    contact = np.sqrt(2e-3 * depth.max()) if tool.name == "ball" else 1e-3
    if hides == WORN:
        flat = contact * rng.uniform(0.5, 1.0)
        profile = Profile(lambda r: np.where(r > flat, r / 2e-3, 0.0), limit=profile.limit, flat=flat)
    layers: tuple[Layer, ...] = (Layer(young, POISSON, thickness),)
    if hides == "layer":
        stiffer = np.exp(rng.choice([-1, 1]) * rng.uniform(np.log(1.5), np.log(5)))
        layers = (Layer(young * stiffer, POISSON, contact * np.exp(rng.uniform(np.log(0.2), np.log(1.5)))), *layers)
    if hides == "base":
        layers = (Layer(young, POISSON, thickness * rng.uniform(0.35, 0.75)),)
    force = LayeredBody(layers, RIGID).force(profile, np.maximum(depth, 0.0))
    return force * (_fung(depth, rng.uniform(1.0, 8.0)) if hides == "strain" else 1.0)


def _fung(depth: FloatArray, stiffening: float) -> FloatArray:
    """Return the stiffening of a ball's force on Fung's solid (D. C. Lin et al., J. Biomech. Eng. 131, 2009)."""
    a = np.sqrt(np.maximum(depth, 0.0) / 2e-3)
    return np.exp(stiffening * (a**3 - 15 * a**2) / (25 * a - 125))


def experiment(tool: Tool, rng: np.random.Generator, correlation: float, hides: str) -> tuple[Measured, float, Unknown]:
    """Return a curve, the true modulus (Pa) and the unknown stiffness of the machine."""
    young, deepest = 10 ** rng.uniform(3.5, 5.5), DEEPEST * rng.uniform(0.3, 0.95)
    if hides == WORN:
        deepest *= 0.75  # the fit is deeper, since it takes the flat for earlier contact
    count = int(rng.integers(150, 450))
    depth = np.linspace(-deepest * rng.uniform(0.3, 1.0), deepest, count)
    force = force_of(tool, rng, hides, young, depth)
    largest, time = float(force.max()), np.linspace(0, 10, count)
    stiffness = largest / deepest * 10 ** rng.uniform(0.3, 1.5)
    size = 10 ** rng.uniform(-2.7, -1.7)
    recorded = force + largest * size * noise(rng, force / largest, correlation)
    recorded += largest * (rng.normal() * 0.1 + rng.normal() * 0.02 * time / 10)
    machine = stiffness * (1 + 0.05 * rng.normal())
    unknown = Unknown("machine_stiffness", machine / 2, 2 * machine, "N/m", True, (machine, 0.05 * machine), False)
    curve = Curve(tool.name, depth + force / stiffness + rng.uniform(-1, 1) * 1e-3, recorded, time)
    (hidden,) = hidden_parts(KINDS, [tip_of_probe(tool.probe, DEEPEST)], [deepest], POISSON)
    return Measured(curve, tool.forward, None, hidden), young, unknown


def least_squares(measured: Measured, unknowns: Sequence[Unknown]) -> tuple[FloatArray, FloatArray]:
    """Return the ends (u,) of the 95 % intervals by least squares with the usual covariance."""
    model = Model.of([measured], unknowns)
    x = start(model)
    force = model.predict(0, model.space.values(x))
    jacobian, residual = model.jacobian(0, x, force), measured.curve.force - force
    variance = residual @ residual / (len(force) - len(x))
    spread = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian / variance + prior(model)[1])))
    low, high = (
        np.array([float(model.space.value(k, at)) for k, at in enumerate(x + side * 1.96 * spread)]) for side in (-1, 1)
    )
    return low, high


def trial(tool: Tool, seed: tuple[int, int], correlation: float, hides: str) -> Trial:
    """Return one experiment with its fit."""
    measured, young, machine = experiment(tool, np.random.default_rng(seed), correlation, hides)
    thickness = Unknown("thickness", 2.6e-3, 3.4e-3, "m", prior=(THICKNESS, 0.025 * THICKNESS), is_wanted=False)
    drift = Unknown("drift", -inf, inf, "N/s", is_wanted=False)
    unknowns = [Unknown("young", 1e3, 1e6, "Pa", is_logarithmic=True), thickness, machine, drift]
    before = process_time()
    found = identify([measured], unknowns)
    seconds = process_time() - before
    low, high = least_squares(measured, unknowns)
    return Trial(young, correlation, hides, tool.name, found, (float(low[0]), float(high[0])), seconds)


def trials(both: Sequence[Tool], count: int, seed: int) -> Iterator[Trial]:
    """Yield ``count`` experiments, of which every third hides something, and some with a worn ball."""
    hidden = [(tool, kind) for kind in KINDS for tool in both if kind != "strain" or tool.name == "ball"]
    for number in range(count):
        correlation = CORRELATIONS[number % len(CORRELATIONS)]
        tool, hides = (hidden[number // 3 % len(hidden)]) if number % 3 == 2 else (both[number // 12 % 2], "")
        yield trial(tool, (seed, number), correlation, hides)
    for number in range(count, count + count // 6):
        yield trial(both[0], (seed, number), CORRELATIONS[number % len(CORRELATIONS)], WORN)


def row(name: str, found: Sequence[Trial]) -> dict[str, object]:
    """Return coverage and verdicts of some trials; bars are those of the trials that have one."""
    barred = [one for one in found if one.found.fits]
    bars = [one.holds(one.found.low[0], one.found.high[0]) for one in barred]
    second = [one.holds(one.found.low_hidden[0], one.found.high_hidden[0]) for one in barred]
    wide = [(one.found.high_hidden[0] - one.found.low_hidden[0]) / 2 / one.found.estimate[0] for one in barred]
    return {
        "curves": name,
        "number": len(found),
        "least squares": sum(one.holds(*one.squares) for one in found) / len(found),
        "bar": sum(bars) / max(len(bars), 1),
        "bar / error": median(one.ratio for one in barred) if barred else inf,
        "second bar": sum(second) / max(len(second), 1),
        "its half width": median(wide) if wide else inf,
        "noted": 1 - len(barred) / len(found),
        "seconds": median(one.seconds for one in found),
    }


_COLUMNS = {
    "curves": "",
    "number": "d",
    "least squares": ".1%",
    "bar": ".1%",
    "bar / error": ".1f",
    "second bar": ".1%",
    "its half width": ".0%",
    "noted": ".1%",
    "seconds": ".2f",
}


def main() -> int:
    parser = options(__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of experiments")
    parser.add_argument("--seed", type=int, default=SEED, help="of all random numbers")
    parser.add_argument("--store", type=Path, default=Path("results/identification.nc"), help="solved cases")
    given = parser.parse_args()
    if given.count < _LEAST:
        parser.error(f"--count must be at least {_LEAST}: each row of the table has experiments")
    with ended_soon():
        both = tools(given.store)
        found = list(trials(both, given.count, given.seed))
    right = [one for one in found if not one.hides]
    wrong = [one for one in found if one.hides in KINDS]
    table = Table(_COLUMNS)
    for correlation in CORRELATIONS:
        some = [one for one in right if one.correlation == correlation]
        table.add(row(f"right law, correlation {correlation:g}", some))
    table.add(row("right law", right))
    for kind in KINDS:
        table.add(row(f"hidden {kind}", [one for one in wrong if one.hides == kind]))
    table.add(row("hidden, all", wrong))
    table.add(row(WORN, [one for one in found if one.hides == WORN]))
    table.write("identification", given.output)
    rows = {str(one["curves"]): one for one in table.rows}
    bars = [rows[f"right law, correlation {correlation:g}"]["bar"] for correlation in CORRELATIONS]
    is_good = (
        min(bars) >= HELD
        and rows["right law"]["bar / error"] <= WIDE
        and rows["right law"]["noted"] <= FALSE
        and rows["hidden, all"]["second bar"] >= HELD
        and rows[WORN]["noted"] >= NOTED
    )
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
