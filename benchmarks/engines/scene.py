"""The scene of all engines: a ball presses into a pad and is dragged along it, without friction and gravity.

The ball's place over time is prescribed. Modules of engines import this one and numpy alone: they run in a venv of
their own (scripts/engines.sh). Lengths are in m, forces in N, times in s.
"""

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

RADIUS, DEPTH = 5e-3, 2e-3
SIDE, HEIGHT = 40e-3, 20e-3  # of the pad; its bottom is fixed
YOUNG, POISSON = 50e3, 0.45
SPEED, WAY = 20e-3, 8e-3  # of the drag
RAMP, HOLD = 0.2, 0.2
END = RAMP + HOLD + WAY / SPEED
GAP = 1e-4  # above the pad at first
WATER = 1e3  # kg/m³


def place(t: float) -> tuple[float, float]:
    """Return x and the depth of the ball's lowest point at a time."""
    share = min(1.0, t / RAMP)
    smooth = share * share * (3 - 2 * share)
    return max(0.0, t - RAMP - HOLD) * SPEED, smooth * (DEPTH + GAP) - GAP


def lame(poisson: float = POISSON) -> tuple[float, float]:
    """Return μ and λ (Pa)."""
    return YOUNG / 2 / (1 + poisson), YOUNG * poisson / (1 + poisson) / (1 - 2 * poisson)


@dataclass(frozen=True)
class Outcome:
    """What an engine says: means over the end of the hold and of the drag.

    ``force`` and ``dragged`` (3,) are those of the pad on the ball; ``jitter`` is the standard deviation of the first
    one's z. ``radius`` is that of the farthest contact from the ball's axis, NaN if the engine does not tell contacts.
    ``sunk``: how much deeper the ball is in the pad than the pad's surface, if the engine tells.
    """

    force: list[float]
    dragged: list[float]
    jitter: float
    radius: float
    sunk: float
    step_ms: float
    tick: float
    unknowns: int
    version: str


@dataclass
class Log:
    """Forces (3,), contact radii and penetrations over time."""

    tick: float
    version: str
    unknowns: int

    def __post_init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []
        self.spent = 0.0

    def times(self) -> Iterator[float]:
        """Yield the times at the ends of all steps."""
        for number in range(1, round(END / self.tick) + 1):
            yield number * self.tick

    def add(self, t: float, force: Any, radius: float = np.nan, sunk: float = np.nan) -> None:
        """Note what is known at a time."""
        self.rows.append((t, *map(float, force), radius, sunk))

    def outcome(self) -> Outcome:
        """Return the outcome.

        Raises:
            ArithmeticError: if a force is not finite, or if there is none.
        """
        found = np.array(self.rows)
        hold = found[(found[:, 0] > RAMP + 0.75 * HOLD) & (found[:, 0] <= RAMP + HOLD + 1e-9)]
        drag = found[found[:, 0] > END - 0.1 * WAY / SPEED]
        if not (len(hold) and len(drag) and np.isfinite(found[:, 1:4]).all()):
            raise ArithmeticError("the simulation is not stable: its forces are not finite")
        return Outcome(
            hold[:, 1:4].mean(axis=0).tolist(),
            drag[:, 1:4].mean(axis=0).tolist(),
            float(hold[:, 3].std()),
            float(np.mean(hold[:, 4])),
            float(np.mean(hold[:, 5])),
            1e3 * self.spent / round(END / self.tick),
            self.tick,
            self.unknowns,
            self.version,
        )


class Timed:
    """Adds the processor time of a block, an engine's own step, to a log."""

    def __init__(self, log: Log):
        self.log = log

    def __enter__(self) -> None:
        self.start = time.process_time()

    def __exit__(self, *_: object) -> None:
        self.log.spent += time.process_time() - self.start


def tetrahedra(size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) and tetrahedra (m, 4) of the pad: each cube of ``size`` is six about a diagonal."""
    counts = [round(length / size) for length in (SIDE, SIDE, HEIGHT)]
    grid = np.meshgrid(*(np.arange(count + 1) for count in counts), indexing="ij")
    points = size * np.stack(grid, axis=-1).reshape(-1, 3) - [SIDE / 2, SIDE / 2, HEIGHT]
    number = np.arange(len(points)).reshape([count + 1 for count in counts])
    corners = [
        number[i : i + counts[0], j : j + counts[1], k : k + counts[2]].ravel()
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    around = (1, 3, 2, 6, 4, 5, 1)
    cells = np.vstack([np.column_stack([corners[n] for n in (0, a, b, 7)]) for a, b in pairwise(around)])
    volume = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])
    cells[volume < 0] = cells[volume < 0][:, [0, 2, 1, 3]]
    return points, cells


def serve(simulate: Callable[..., Outcome]) -> None:
    """Answer settings on standard input, a list in JSON, with a line each; the engine's own output goes to stderr."""
    settings = json.load(sys.stdin)
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for setting in settings:
        try:
            found = asdict(simulate(**setting))
        except Exception as error:  # a setting that fails does not end the others
            found = {"failed": f"{type(error).__name__}: {error}"[:300]}
        print(json.dumps({"setting": setting, **found}), file=out, flush=True)
