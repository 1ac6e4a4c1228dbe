"""A ball on a half-space at large displacements: what a law adds to a model, and the error bar of the sum.

Strains are large next to the ball alone, so the rest of the body is taken as linear. At equal force, the ball then is
as deep as at small strain, plus the difference of a half-space of the law from a linear one. This depends on ν, on
depth over radius and on the law's parameters. It is solved on the meridian of a large cylinder, whose finite size
is subtracted as a linear compliance.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import nan

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.stages import stage
from epsmesh_realtime.export.checks import BALL, Check, check_touches, margin, on_face, random_place, with_bar
from epsmesh_realtime.export.forecast import BALL as RADIUS
from epsmesh_realtime.export.forecast import DEPTHS, DISC, RATIOS, SHALLOW, SIZES, half_space
from epsmesh_realtime.export.full import Full, Solver, Tool
from epsmesh_realtime.export.ranks import Ranks
from epsmesh_realtime.export.scope import ExportError, Scope
from epsmesh_realtime.export.tabulate import ratios_of
from epsmesh_realtime.model import Model
from epsmesh_realtime.table import Near

# Fewest depths with an equilibrium.
_FEWEST = 4
# Terms in x beyond the first, which is known.
_TERMS = 4
# F is about in proportion to the depth to this power.
_POWER = 1.5
# Depths of the checks, in radii of the ball, and the factor to the next depth if one has no answer.
_SHARES, _LESS = (0.1, 0.95), 0.9
# Least error of c by large displacements, times room²/depth: measured near a side (benchmarks/results/realtime.md).
# Largest effect of the support that a fit may have, in the units of `Near`, and the one to which its first order is
# taken.
_LEAST, _MOST_SUPPORT, _TRIAL = 0.04, 0.3, 0.05
# Seeds of calibration and test.
_SEEDS = (3, 4)


@stage("near field")
def near_field(scope: Scope, solver: Solver, ranks: Ranks) -> Near:
    """Return the half-space of the law of ``solver``. Its error of c is not known yet, and 0; collective.

    Raises:
        ExportError: if too few depths have an equilibrium.
        RuntimeError: if a linear solve fails.
    """
    ratios = ratios_of(scope.poissons, RATIOS)
    large = half_space(solver)
    small = replace(large, law={})

    def solve(one: tuple[float, float]) -> list[Full]:
        ratio, share = one
        if share == 0.0:
            return [small.press(Tool("disc", DISC), (0.0, 0.0), SHALLOW, ratio)]
        try:
            return [large.press(Tool("sphere", RADIUS, contact="unilateral"), (0.0, 0.0), share * RADIUS, ratio)]
        except RuntimeError:
            return []

    asked = [(float(ratio), share) for ratio in ratios for share in (0.0, *DEPTHS)]
    found = iter(ranks.in_turn(asked, solve, "half-spaces solved"))
    rows = [[next(found) for _ in (0.0, *DEPTHS)] for _ in ratios]
    count = min([*map(bool, row), False].index(False) for row in rows) - 1
    if count < _FEWEST:
        raise ExportError(
            f'material.law = "{solver.law["law"]}": a half-space has no equilibrium {DEPTHS[count]:g} radii of a ball '
            f"deep; a real-time model needs {DEPTHS[_FEWEST - 1]:g}"
        )
    solved = [[full for one in row[: count + 1] for full in one] for row in rows]
    curves = [_curve(row, ratio, scope.young) for row, ratio in zip(solved, ratios, strict=True)]
    most = min(float(x[-1]) for x, _ in curves)
    fits = [_fitted(x, values, most) for x, values in curves]
    values = np.tensordot(_over(ratios), np.array([fit for fit, _ in fits]), 1).swapaxes(0, 1)
    between = float(np.abs(values[0, -1]).sum()) if len(ratios) > 1 else 0.0
    bars = max(full.error for row in solved for full in row)
    return Near(values, most, bars + _POWER * (max(missed for _, missed in fits) + between), 0.0)


def _over(ratios: FloatArray) -> FloatArray:
    """Return the matrix from values at the ratios to Chebyshev coefficients."""
    first, last = ratios[0], ratios[-1]
    places = (2 * ratios - first - last) / (first - last) if len(ratios) > 1 else np.zeros(1)
    return np.asarray(np.linalg.inv(np.polynomial.chebyshev.chebvander(places, len(ratios) - 1)))


def _curve(solved: Sequence[Full], ratio: float, young: float) -> tuple[FloatArray, FloatArray]:
    """Return x (n,), and depth and contact radius (2, n) in units of Hertz's, from the solves of disc and balls."""
    disc, *balls = solved
    plane = 1 / (1 - ratio**2)
    ends = young * SHALLOW / disc.force - 0.5 / (DISC * plane)  # 1/m, for E = 1
    force, radius = np.array([(ball.force / young, ball.radius) for ball in balls]).T
    depth = np.array(DEPTHS[: len(force)]) * RADIUS - ends * force
    x = np.cbrt(force / (plane * RADIUS**2))
    hertz = 0.75 ** (1 / 3) * x * RADIUS
    return x, np.array([depth * RADIUS / hertz**2, radius / hertz])


def _fitted(x: FloatArray, values: FloatArray, most: float) -> tuple[FloatArray, float]:
    """Return coefficients (2, terms) over 2x/``most`` - 1 of curves (2, n) that are 1 at 0, and the first's error."""
    powers = (x / most)[:, None] ** np.arange(1, _TERMS + 1)
    slopes = np.linalg.lstsq(powers, (values - 1).T, rcond=None)[0]
    missed = float(np.abs(powers @ slopes - (values - 1).T)[:, 0].max())
    series = np.vstack([np.ones(2), slopes])  # in powers of x/most
    places = np.cos(np.pi * (np.arange(_TERMS + 1) + 0.5) / (_TERMS + 1))
    inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(places, _TERMS))
    return np.asarray((inverse @ np.polynomial.polynomial.polyvander((1 + places) / 2, _TERMS) @ series).T), missed


def with_near(
    bare: Model, near: Near, solver: Solver, counts: Sequence[int], ranks: Ranks
) -> tuple[Model, list[Check], list[Check]]:
    """Return a linear model with the half-space of a law, and two sets of balls: of its calibration and of its test.

    They have ``counts`` touches. Collective.

    Raises:
        ExportError: if a ball fits nowhere.
        RuntimeError: if a full solve fails.
    """
    # Balls that have an answer whatever the effect of the support.
    stiff = replace(bare, near=replace(near, support=_MOST_SUPPORT))
    touches = [_random_balls(stiff, count, seed) for count, seed in zip(counts, _SEEDS, strict=True)]
    checked = check_touches(stiff, solver, touches, ranks)
    model = replace(bare, near=calibrated(bare, near, checked[0]))
    fitted, judged = ([with_bar(model, check) for check in each] for each in checked)
    return model, fitted, judged


def calibrated(bare: Model, near: Near, checks: Sequence[Check]) -> Near:
    """Return the half-space with the effect of the support that fits full solves best, and the error that is left."""
    plain, some = (_errors(bare, replace(near, support=support), checks) for support in (0.0, _TRIAL))
    slope = (some - plain) / _TRIAL
    support = float(np.clip(-(plain @ slope) / (slope @ slope), 0.0, _MOST_SUPPORT))
    of_room = [
        [with_bar(replace(bare, near=replace(near, support=support, room=room)), check) for check in checks]
        for room in (1.0, 0.0)
    ]
    return replace(near, support=support, room=needed_room(of_room[0], [check.bar for check in of_room[1]]))


def _errors(bare: Model, near: Near, checks: Sequence[Check]) -> FloatArray:
    model = replace(bare, near=near)
    return np.array([with_bar(model, check).error for check in checks])


def needed_room(checks: Sequence[Check], without: Sequence[float]) -> float:
    """Return the error of c, times room²/depth, that covers all errors, with a margin; ``checks`` have 1 of it.

    ``without`` are their bars with none of it.
    """
    needed = max((abs(check.error) - bar) / (check.bar - bar) for check, bar in zip(checks, without, strict=True))
    return max(_LEAST, margin(len(checks)) * needed)


def _random_balls(model: Model, count: int, seed: int) -> list[Check]:
    rng = np.random.default_rng(seed)
    return [_random_ball(model, rng) for _ in range(count)]


def _random_ball(model: Model, rng: np.random.Generator) -> Check:
    """Return a random touch, not solved yet: contact as large as in other checks, depth a random part of the radius."""
    x, y = random_place(model, rng)
    size = model.largest * model.room(x, y) * float(np.exp(rng.uniform(*np.log(SIZES))))
    share, poisson = float(rng.uniform(*_SHARES)), float(rng.uniform(*model.table.poisson))
    radius, (at, _) = size / np.sqrt(share), on_face(model, x, y)
    while True:
        touch = model.query("sphere", at=at.tolist(), depth=share * radius, poisson=poisson, radius=radius)
        if touch.status == "ok":
            break
        share *= _LESS
        if share < _LESS * _SHARES[0] * size / radius:
            raise ExportError(f"a ball of {1e3 * radius:.3g} mm has no answer: {touch.message}")
    tool = Tool("sphere", radius, contact="unilateral")
    asked = Check(x, y, radius, share * radius, poisson, nan, nan, nan, nan, BALL, tool)
    return with_bar(model, asked)
