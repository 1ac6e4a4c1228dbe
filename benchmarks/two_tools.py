"""Two discs at once: real-time models compared with quadratic elements of both, and coverage of the bars.

    python -m benchmarks.two_tools [--pairs 6] [--models box,cylinder,layers] [--finer 0.8]

A missing model is exported first, into results/two_tools/. Pairs are random: places, radii of 0.04 to 0.25 of the
available size, and depths, at both ends of the range of Poisson's ratio on one mesh. The settlement of one disc by a
force on the other is taken from the elements (``benchmarks.two_discs``), where the mesh at the edges, the main error of
a disc's own force, matters least. Together with the model's own compliances it gives the reference forces.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.realtime import model_of
from benchmarks.two_discs import Disc, forces, meshed
from epsmesh.shapes.body import Layered
from epsmesh_realtime.export.checks import random_place
from epsmesh_realtime.export.scope import Scope
from epsmesh_realtime.model import Model

_FOLDER = Path("results/two_tools")
_CHECKS, _SIZES, _DEPTHS, _SEED = 6, (0.04, 0.25), (5e-5, 2e-4), 77
# Largest distance of the centres, in units of the sum of both radii: beyond it the interaction is small.
_APART = 8.0
# A model answers for no nearer tools.
_NEAR = 2.0


@dataclass(frozen=True)
class Felt:
    """One disc of a pair: distance of both, in units of the sum of radii, and the share of its force that is lost.

    ``error`` is the relative error of the model's force, and ``bar`` its bar.
    """

    apart: float
    lost: float
    error: float
    bar: float


def main() -> None:
    """Solve, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=6, help="of each model")
    parser.add_argument("--models", default="box,cylinder,layers", help="some of them, by name")
    parser.add_argument("--finer", type=float, default=0.8, help="elements are smaller by this factor")
    asked = parser.parse_args()
    print("| body | ν | forces | apart, in both radii | lost | error: median, largest | held | bar: median |")
    print("|" + 8 * "---|")
    for name in asked.models.split(","):
        for line in _lines(name, asked.pairs, asked.finer):
            print(line, flush=True)


def _lines(name: str, pairs: int, finer: float) -> Iterator[str]:
    model, scope = model_of(name, _FOLDER, _CHECKS)
    rng, found = np.random.default_rng(_SEED), defaultdict(list)
    for _ in range(pairs):
        for poisson, felt in _solved(model, scope, _pair(model, rng), rng.uniform(*_DEPTHS, 2).tolist(), finer):
            found[poisson].extend(felt)
    for poisson, felt in found.items():
        errors, lost, apart = ([abs(getattr(each, key)) for each in felt] for key in ("error", "lost", "apart"))
        held = sum(abs(each.error) <= each.bar for each in felt)
        yield (
            f"| {name} | {poisson:g} | {len(felt)} | {min(apart):.1f} to {max(apart):.1f} | {100 * min(lost):.1f} to "
            f"{100 * max(lost):.1f} % | {100 * median(errors):.2g} %, {100 * max(errors):.2g} % | {held} | "
            f"{100 * median(each.bar for each in felt):.2g} % |"
        )


def _pair(model: Model, rng: np.random.Generator) -> list[Disc]:
    """Return two discs within the range of a model, not too far from each other."""
    while True:
        discs = []
        for _ in range(2):
            x, y = random_place(model, rng)
            discs.append((x, y, model.room(x, y) * float(np.exp(rng.uniform(*np.log(_SIZES))))))
        (x, y, a), (to_x, to_y, b) = discs
        if _NEAR < hypot(x - to_x, y - to_y) / (a + b) < _APART:
            return discs


def _solved(
    model: Model, scope: Scope, discs: list[Disc], depths: list[float], finer: float
) -> Iterator[tuple[float, list[Felt]]]:
    """Yield the forces of both, for each Poisson's ratio."""
    body = scope.body
    assert isinstance(body, Layered)
    height = body.heights[1] - body.heights[0]
    size = (body.half_sides[0], height) if body.is_round else (2 * body.half_sides[0], 2 * body.half_sides[1], height)
    ends = np.cumsum([layer.thickness for layer in body.layer[:-1]]).tolist()
    layers = [
        (layer.young / scope.young, layer.poisson, end) for layer, end in zip(body.layer, [*ends, height], strict=False)
    ]
    mesh = meshed(size, discs, finer, ends)
    (x, y, a), (to_x, to_y, b) = discs
    for poisson in sorted({*model.table.poisson}):
        alone, both = forces(mesh, poisson, depths, layers)
        felt = (depths[0] - depths[0] * both[0] / alone[0]) / both[1]
        asked = [
            {"tool": "disc", "radius": r, "at": model.origin + np.array([x, y, 0.0]) @ model.axes, "depth": depth}
            for (x, y, r), depth in zip(discs, depths, strict=True)
        ]
        own = [model.query(**tool, young=1.0, poisson=poisson) for tool in asked]
        told = model.query_all(asked, young=1.0, poisson=poisson)
        soft = [depth / float(touch.force[2]) for depth, touch in zip(depths, own, strict=True)]
        truth = np.linalg.solve([[soft[0], felt], [felt, soft[1]]], depths)
        yield (
            poisson,
            [
                Felt(
                    hypot(x - to_x, y - to_y) / (a + b),
                    1 - force / float(single.force[2]),
                    float(touch.force[2]) / force - 1,
                    touch.force_error / touch.force[2],
                )
                for force, single, touch in zip(truth.tolist(), own, told, strict=True)
            ],
        )


if __name__ == "__main__":
    main()
