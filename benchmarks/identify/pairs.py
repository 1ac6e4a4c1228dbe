"""What a second tool adds to `epsmesh identify`: Poisson's ratio by two punches, a top layer by two balls.

    python -m benchmarks.identify.pairs [--count N] [--seed N]

Forces are those of the integral equation of layered bodies. Bars are compared with those that the derivatives of the
force give for noise of known covariance (bound of Cramér and Rao), and with the error. The exit status is 1 if a limit
is missed: 1.3 times that bound for two punches, 15 % for the modulus of the layer.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from statistics import median

import numpy as np

from benchmarks.tables import Table, options
from epsmesh.arrays import FloatArray
from epsmesh.study.read import parse
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.noise import Noise, whiten
from epsmesh_identify.estimation.parts import Estimate, Forward, Measured, Unknown, Values
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.surrogate.build import build
from epsmesh_identify.surrogate.cases import domain_of
from epsmesh_identify.surrogate.derived import ON_MERIDIAN
from epsmesh_identify.surrogate.wide import solve_wide

COUNT, SEED = 40, 20270
# Limits: bar over bound, and half width of the layer's modulus.
_OF_BOUND, _OF_LAYER = 1.3, 0.15
_NOISE, _SIZE, _POINTS = Noise(0.6, 0.1, 0.0), 0.003, 300

_YOUNG = Unknown("young", 1e3, 1e6, "Pa", is_logarithmic=True)
_POISSON = Unknown("poisson", 0.2, 0.5, "1")
_PAD = {"shape": "cylinder", "radius": "100 mm", "height": "4 mm", "fixed": "bottom"}
_SKINNED = _PAD | {
    "height": "40 mm",
    "layer": [{"name": "skin", "young": "50 kPa", "poisson": 0.45, "thickness": "1 mm"}],
}


@dataclass(frozen=True)
class Pair:
    """Two tools on one body, and what is to be found from them."""

    name: str
    tools: tuple[tuple[Forward, float], ...]
    unknowns: tuple[Unknown, ...]
    truth: Values
    wanted: str


def _forward(body: object, probe: Mapping[str, object], unknowns: Sequence[Unknown], deepest: float) -> Forward:
    raw = {
        "body": body,
        "material": {"young": "10 kPa", "poisson": 0.45},
        "probe": probe,
        "mesh": {"accuracy": "0.1 %"},
    }
    bounds = {unknown.name: (unknown.low, unknown.high) for unknown in unknowns}
    return build(domain_of(parse(raw, file="pair.toml"), bounds, 1.2 * deepest), solve_wide, ON_MERIDIAN)


def pairs() -> list[Pair]:
    punches = tuple(
        (_forward(_PAD, {"shape": "disc", "radius": f"{radius} mm", "depth": "0.2 mm", "contact": "frictionless"},
                  (_YOUNG, _POISSON), 2e-4), 2e-4)
        for radius in (0.4, 4)
    )  # fmt: skip
    layer = (
        Unknown("young", 5e3, 5e4, "Pa", True),
        Unknown("skin_young", 5e3, 5e5, "Pa", True),
        Unknown("skin_thickness", 0.5e-3, 2e-3, "m", True),
    )
    balls = tuple(
        (_forward(_SKINNED, {"shape": "sphere", "radius": f"{radius} mm", "depth": "0.2 mm", "contact": "unilateral"},
                  layer, deepest), deepest)
        for radius, deepest in ((1, 2e-4), (8, 1e-3))
    )  # fmt: skip
    found = [
        Pair(name, tools, (_YOUNG, _POISSON), {"young": 2e4, "poisson": 0.42}, "poisson")
        for name, tools in (("one punch", punches[:1]), ("two punches", punches))
    ]
    truth = {"young": 1.2e4, "skin_young": 6e4, "skin_thickness": 1e-3}
    return found + [
        Pair(name, tools, layer, truth, "skin_young") for name, tools in (("one ball", balls[1:]), ("two balls", balls))
    ]


def measured(pair: Pair, rng: np.random.Generator) -> list[Measured]:
    """Return a curve of each tool, with as much air as contact."""
    found = []
    for number, (forward, deepest) in enumerate(pair.tools):
        depth = np.linspace(-deepest, deepest, _POINTS)
        force = forward.force(depth, pair.truth)
        recorded = force + _SIZE * force.max() * _noise(rng)
        found.append(Measured(Curve(f"tool {number}", depth, recorded, np.linspace(0, 1, _POINTS)), forward))
    return found


def _noise(rng: np.random.Generator) -> FloatArray:
    slow = np.empty(_POINTS)
    slow[0] = rng.normal()
    for k in range(1, _POINTS):
        slow[k] = _NOISE.correlation * slow[k - 1] + np.sqrt(1 - _NOISE.correlation**2) * rng.normal()
    return np.sqrt(1 - _NOISE.white) * slow + np.sqrt(_NOISE.white) * rng.normal(size=_POINTS)


def bound(pair: Pair, curves: Sequence[Measured]) -> FloatArray:
    """Return the half widths (u,), in coordinates, of 95 % bars if the covariance of the noise were known."""
    model = Model.of(curves, pair.unknowns)
    x = np.array([0.5] * len(model.names))
    for place, unknown in enumerate(model.space.unknowns):
        value = 0.0 if " of " in unknown.name or unknown.name in ("contact_point", "baseline") else None
        x[place] = model.space.coordinate(place, pair.truth[unknown.name] if value is None else value)
    information = np.zeros((len(x), len(x)))
    for number in range(len(curves)):
        force = model.predict(number, model.space.values(x))
        jacobian, _ = whiten(model.jacobian(number, x, force), np.zeros(len(force)), _NOISE)
        information += jacobian.T @ jacobian / (_SIZE * force.max()) ** 2
    return np.asarray(1.96 * np.sqrt(np.diag(np.linalg.inv(information + 1e-9 * np.eye(len(x))))))


def row(pair: Pair, found: Sequence[Estimate], bounds: Sequence[FloatArray]) -> dict[str, object]:
    """Return how bars of the pair compare with the error and with the bound, for all shared unknowns."""
    place, count = found[0].place(pair.wanted), len(pair.unknowns)
    truth = np.array([pair.truth[unknown.name] for unknown in pair.unknowns])
    barred = [one for one in found if one.fits]
    held = [(one.low[:count] <= truth) & (truth <= one.high[:count]) for one in barred]
    model_free = [_coordinates(one, count) / own[:count] for one, own in zip(found, bounds, strict=True) if one.fits]
    seen = [bool(one.seen[place]) for one in found]
    half = median((one.high[place] - one.low[place]) / 2 / pair.truth[pair.wanted] for one in barred)
    return {
        "tools": pair.name,
        "unknown": pair.wanted,
        "number": len(found),
        "held": float(np.mean(held)),
        "half width": half,
        "bar / bound": float(np.median(model_free)) if all(seen) else inf,
        "seen": float(np.mean(seen)),
        "noted": 1 - len(barred) / len(found),
    }


def _coordinates(found: Estimate, count: int) -> FloatArray:
    """Return half widths (count,) in coordinates, as those of ``bound``."""
    halves = []
    for unknown, low, high in zip(found.unknowns[:count], found.low, found.high, strict=False):
        if unknown.is_logarithmic:
            halves.append(np.log(high / low) / np.log(unknown.high / unknown.low) / 2)
        else:
            halves.append((high - low) / (unknown.high - unknown.low) / 2)
    return np.array(halves)


_COLUMNS = {
    "tools": "", "unknown": "", "number": "d", "held": ".1%", "half width": ".1%", "bar / bound": ".2f",
    "seen": ".0%", "noted": ".0%",
}  # fmt: skip


def main() -> int:
    parser = options(__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help="number of experiments of each pair")
    parser.add_argument("--seed", type=int, default=SEED, help="of all random numbers")
    given = parser.parse_args()
    table = Table(_COLUMNS)
    for pair in pairs():
        curves = [measured(pair, np.random.default_rng((given.seed, k))) for k in range(given.count)]
        found = [identify(own, pair.unknowns) for own in curves]
        table.add(row(pair, found, [bound(pair, own) for own in curves]))
    table.write("identification_pairs", given.output)
    rows = {str(one["tools"]): one for one in table.rows}
    is_good = (
        rows["two punches"]["bar / bound"] <= _OF_BOUND
        and rows["one punch"]["seen"] == 0
        and rows["two balls"]["half width"] <= _OF_LAYER
    )
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
