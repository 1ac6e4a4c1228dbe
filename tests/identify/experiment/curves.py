"""Force curves as files of testing machines have them, made for the tests."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from epsmesh.arrays import FloatArray

# A ball of 3 mm on tissue of 20 kPa: 1 mm of air, then 1 mm of contact, in 20 s, and 0.2 mN of noise.
RADIUS, MODULUS, AIR, DEEP, RAMP, NOISE = 3e-3, 20e3 / 0.75, 1e-3, 1e-3, 20.0, 2e-5


def approach(rows: int = 200, *, seed: int = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return time (s), depth (m) and force (N) of an approach through air into contact."""
    noise = np.random.default_rng(seed).normal(0, NOISE, rows)
    depth = np.linspace(0, AIR + DEEP, rows)
    return np.linspace(0, RAMP, rows), depth, hertz(depth) + noise


def hertz(depth: FloatArray) -> FloatArray:
    """Return the force (N) of the ball at depths (m) from its start in air."""
    return 4 / 3 * MODULUS * RADIUS**0.5 * np.maximum(depth - AIR, 0) ** 1.5


def cycle(rows: int = 200, hold: int = 0, *, seed: int = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return an approach, a hold of so many rows in which the force relaxes, and a retract."""
    time, depth, _ = approach(rows)
    step = time[1]
    depth = np.concatenate([depth, np.full(hold, depth[-1]), depth[::-1]])
    time = step * np.arange(len(depth))
    share = np.where(time > RAMP, 0.7 + 0.3 * np.exp(-(time - RAMP) / 5.0), 1.0)
    noise = np.random.default_rng(seed).normal(0, NOISE, len(depth))
    return time, depth, hertz(depth) * share + noise


def write(
    path: Path,
    columns: dict[str, Iterable[float]],
    *,
    separator: str = ",",
    decimal: str = ".",
    before: str = "",
    encoding: str = "utf-8",
    change: Callable[[list[str]], list[str]] = lambda lines: lines,
) -> Path:
    """Write columns by header to a file; ``change`` is done to its lines."""
    rows = zip(*columns.values(), strict=True)
    lines = [separator.join(columns)] if any(columns) else []
    lines += [separator.join(f"{value:.9g}".replace(".", decimal) for value in row) for row in rows]
    path.write_text(before + "\n".join(change(lines)) + "\n", encoding=encoding)
    return path
