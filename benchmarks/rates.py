"""Queries a second of real-time models, one by one and many at once, and the errors of derivatives of forces.

    python -m benchmarks.rates [--models box,liver] [--queries 20000] [--output results]

A missing model is exported first (:mod:`benchmarks.realtime`). Times are of one core's processor. Derivatives are
compared with central differences of fourth order, whose own rounding is the most of what is left.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from benchmarks.tables import markdown, options, write
from epsmesh.arrays import FloatArray
from epsmesh_realtime.model import Model
from epsmesh_realtime.query import Query, packed_each

# Sizes in units of a twentieth of the thickness.
TOOLS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "disc": {"radius": 1.0},
        "sphere": {"radius": 1.0},
        "cone": {"radius": 1.0, "angle": 1.2},
        "blade": {"length": 2.0, "width": 0.4, "along": (1.0, 0.3, 0.0)},
        "bonded": {"radius": 1.0, "contact": "bonded"},
    }
)
# Steps of differences, and units in which errors are measured, of the numbers of a query.
STEPS = {"at": 1e-6, "depth": 4e-9, "young": 4.0, "poisson": 4e-6, "radius": 4e-8, "angle": 4e-5}
STEPS |= {"length": 4e-8, "width": 4e-8, "along": 1e-5}
UNITS = {"at": 1e-2, "depth": 1e-4, "young": 1e4, "poisson": 0.1, "radius": 1e-3, "angle": 1.0}
UNITS |= {"length": 1e-3, "width": 1e-3, "along": 1.0}
_SINGLE, _CHECKED, _DEEP, _WITHIN = 4000, 100, 0.04, 0.6


def asked_of(model: Model, tool: str, count: int) -> dict[str, Any]:
    """Return the keywords of ``count`` queries of a ``tool`` at random places of a model, with its name."""
    rng, size = np.random.default_rng(1), 0.05 * model.thickness
    x, y = _WITHIN * rng.uniform(-1, 1, (2, count)) * np.array(model.table.reach)[:, None]
    heights = [model.spot(*place).height for place in zip(x.tolist(), y.tolist(), strict=True)]
    low, high = model.table.poisson
    sizes = {
        name: value if isinstance(value, str) or name in ("angle", "along") else value * size
        for name, value in TOOLS[tool].items()
    }
    return {
        "tool": "disc" if tool == "bonded" else tool,
        "at": model.origin + np.column_stack([x, y, heights]) @ model.axes,
        "depth": _DEEP * size * rng.uniform(0.5, 1, count),
        "young": model.young,
        "poisson": low + (high - low) * rng.uniform(0.05, 0.95, count),
        **sizes,
    }


def difference(model: Model, asked: Mapping[str, Any], name: str) -> FloatArray:
    """Return dF/d(number) of queries: (n, 3), or (n, 3, 3) of a place or direction."""
    value, step = np.asarray(asked[name], dtype=float), STEPS[name]
    ways = [*np.eye(3)] if name in ("at", "along") else [np.ones(())]

    def slope(along: FloatArray) -> FloatArray:
        up, down = (model.query_many(**{**asked, name: value + sign * along}).force for sign in (1, -1))
        return (up - down) / 2

    slopes = [(8 * slope(step * one) - slope(2 * step * one)) / (6 * step) for one in ways]
    return np.stack(slopes, axis=-1) if len(ways) > 1 else slopes[0]


def errors(model: Model, asked: Mapping[str, Any]) -> dict[str, float]:
    """Return for each number of queries the largest error of a derivative, in units of the force per UNITS."""
    model = replace(model, off=1e-3)  # a step of `at` may leave the face
    is_fixed = model.table.poisson[0] == model.table.poisson[1]
    by = [name for name in STEPS if name in asked and not (name == "poisson" and is_fixed)]
    found = model.gradient(by=by, **asked)
    size = np.linalg.norm(found.touches.force, axis=1)[:, None]
    return {
        name: float(
            (np.abs(found.of[name] - difference(model, asked, name)).reshape(len(size), -1) * UNITS[name] / size).max()
        )
        for name in by
    }


def _rate(work: Callable[[], Any], count: int) -> float:
    """Return how often a second ``work`` does one of its ``count`` parts, the best of three."""
    took = []
    for _ in range(3):
        begin = time.thread_time()
        work()
        took.append(time.thread_time() - begin)
    return count / min(took)


def rates(model: Model, asked: Mapping[str, Any]) -> dict[str, float]:
    """Return queries a second of a core: one by one from Python, in C alone, and of many in one call."""
    count = len(asked["depth"])
    packed = packed_each(Query(**asked), model.young, model.poisson)
    own = [
        {key: value[k] if key in ("at", "depth", "poisson") else value for key, value in asked.items()}
        for k in range(min(_SINGLE, count))
    ]
    return {
        "one by one, Python": _rate(lambda: [model.query(**one) for one in own], len(own)),
        "in C": _rate(lambda: model.evaluator.touch_each(packed), count),
        "query_many": _rate(lambda: model.query_many(**asked), count),
        "with derivatives": _rate(lambda: model.gradient(by=("at", "depth"), **asked), count),
    }


def table(models: Mapping[str, Model], queries: int) -> tuple[dict[str, Any], str]:
    """Return what is measured of models by name, and its tables."""
    fast, exact = [], []
    for body, model in models.items():
        for tool in TOOLS:
            asked = asked_of(model, tool, queries)
            if {*model.query_many(**asked).status} != {"ok"}:
                continue
            few = asked_of(model, tool, _CHECKED)
            fast.append({"body": body, "tool": tool, **rates(model, asked)})
            exact.append({"body": body, "tool": tool, **errors(model, few)})
    columns = {name: "" if name in ("body", "tool") else ",.0f" for name in fast[0]}
    numbers = [name for name in STEPS if any(name in row for row in exact)]
    cells = [
        {key: row[key] for key in ("body", "tool")} | {key: f"{row[key]:.0e}" if key in row else "" for key in numbers}
        for row in exact
    ]
    text = (
        "Queries a second of one core's processor; derivatives are those with place and depth:\n\n"
        f"{markdown(fast, columns)}\n"
        "Largest error of dF/d(number), against differences, in units of F per 10 mm (`at`), 0.1 mm (`depth`),\n"
        "10 kPa, 0.1 (`poisson`), 1 mm, 1 rad or 1 (`along`):\n\n"
        f"{markdown(cells, dict.fromkeys(('body', 'tool', *numbers), ''))}"
    )
    return {"rates": fast, "errors": exact}, text


def main() -> None:
    """Measure, print, write."""
    from benchmarks.realtime import CHECKS, FOLDER, model_of

    parser = options(__doc__)
    parser.add_argument("--models", default="box,liver", help="of `benchmarks.realtime`")
    parser.add_argument("--queries", type=int, default=20_000, help="in one call")
    asked = parser.parse_args()
    found, text = table({name: model_of(name, FOLDER, CHECKS)[0] for name in asked.models.split(",")}, asked.queries)
    print(text)
    write("rates", Path(asked.output), found, text)


if __name__ == "__main__":
    main()
