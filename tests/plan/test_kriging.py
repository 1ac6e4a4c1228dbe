"""Kriging: exact at smooth values, constants are kept, and bars contain what is held out."""

from types import SimpleNamespace

import numpy as np
import pytest

from epsmesh.plan.kriging import Field, cover
from epsmesh.plan.place_path import PlacePath

X, Y = (grid.ravel() for grid in np.meshgrid(np.linspace(-24, 24, 20), np.linspace(-16, 16, 20)))
PLACES = np.stack([X, Y, 0.01 * Y**2], axis=1)


def bump(depth, radius, height, centre):
    """Return a field (n,) over something stiff below the surface, and the distance (n,) to it."""
    away = np.sqrt((X - centre[0]) ** 2 + (Y - centre[1]) ** 2 + (depth + radius) ** 2)
    return height * ((depth + radius) / away) ** 4 + 0.02 * X / 24, away - radius


@pytest.mark.parametrize(("depth", "radius", "height"), [(5, 7, 0.6), (8, 4, 0.3), (3, 3, 0.7)])
def test_bars_contain_what_is_held_out_and_the_bump_is_found(depth, radius, height):
    """Scatter of 5e-4, as that of meshes; depths and centres are not those that the constants were chosen on."""
    random = np.random.default_rng(11)
    values, away = bump(depth, radius, height, random.uniform(-10, 10, 2))
    scales = away + 2.0
    known = cover(PLACES, 0.5 * scales, np.zeros(0, int), np.ones(len(PLACES), bool))
    assert len(known) < 100
    field = Field(PLACES[known], scales[known], values[known] + 5e-4 * random.standard_normal(len(known)), 5e-4)
    held_out = np.setdiff1d(np.arange(len(PLACES)), known)
    weights = field.weights(PLACES[held_out], scales[held_out])
    np.testing.assert_allclose(weights.sum(axis=1), 1, rtol=1e-9)
    missed = np.abs(weights @ field.values - values[held_out])
    bars = field.bars(PLACES[held_out], scales[held_out])
    assert np.mean(missed <= bars) >= 0.95
    assert missed.max() < 1.5 * bars.max()
    assert bars.max() < 0.5 * height


def test_a_value_that_the_others_do_not_predict_widens_all_bars():
    values, away = bump(8.0, 4.0, 0.3, (0.0, 0.0))
    known = cover(PLACES, 0.5 * away, np.zeros(0, int), np.ones(len(PLACES), bool))
    wrong = values[known].copy()
    wrong[len(known) // 2] += 0.1
    bars, wide = (Field(PLACES[known], away[known], found).bars(PLACES, away) for found in (values[known], wrong))
    assert np.median(wide) > 3 * np.median(bars)


def test_a_cover_is_denser_where_the_scale_is_small_and_leaves_out_what_is_not_possible():
    scales = np.where(X > 0, 3.0, 12.0)
    possible = Y > -10
    chosen = cover(PLACES, scales, np.array([0]), possible)
    assert possible[chosen].all()
    away = np.linalg.norm(PLACES[:, None] - PLACES[None, [0, *chosen]], axis=-1).min(axis=1)
    assert (away[possible] <= scales[possible]).all()
    assert (X[chosen] > 0).sum() > 4 * (X[chosen] < 0).sum()


def interpolated(x, scales, values, random, error=0.01):
    """Return how far interpolated values along a line are off, in units of their bars, and how many were solved.

    Meshes have bars of 1e-2, and scatter by 5e-4.
    """
    path = PlacePath(tuple(SimpleNamespace(key=number) for number in range(len(x))))
    vars(path).update(places=np.stack([x, 0 * x, 0 * x], axis=1), scales=scales)
    measured, found = values + 5e-4 * random.normal(size=len(x)), {}
    while further := path.missing(found, error):
        found |= {
            solve.key: SimpleNamespace(force=np.exp(measured[solve.key]), force_error=1e-2, is_ok=True)
            for solve in further
        }
    of_meshes = np.log1p(1e-2)
    rest = path.interpolated(found)
    return [abs(np.log(f) - values[n]) / (np.log1p(bar) - of_meshes) for n, (f, bar) in rest.items()], len(found)


def test_a_path_over_small_tumours_just_below_the_surface_has_bars_that_hold():
    """To first order F changes by the energy of the healthy body within a tumour; the tool is a half width wide."""
    random = np.random.default_rng(1)
    ratios, solved, count = [], 0, 0
    for _ in range(60):
        x = np.linspace(0, random.uniform(20, 100), random.integers(21, 80))
        half, far = random.uniform(0.5, 3), random.uniform(10, 40)
        scales, values = np.full(len(x), far), 0.1 * random.normal() * np.sin(x / far + random.uniform(0, 6))
        for _ in range(2):
            radius, depth, at = random.uniform(0.5, 6), random.uniform(0.3, 6), random.uniform(0.1, 0.9) * x[-1]
            inside = random.normal(size=(300, 3))
            inside *= (radius * random.uniform(size=300) ** (1 / 3) / np.linalg.norm(inside, axis=1))[:, None]
            below = depth + radius + inside[:, 2]
            squares = (x[:, None] - at - inside[:, 0]) ** 2 + inside[:, 1] ** 2 + (below + half / 2) ** 2
            energy = ((below / squares) ** 4).mean(axis=1)
            values += np.log1p(random.uniform(-0.3, 0.6) * energy / energy.max())
            scales = np.minimum(scales, np.abs(np.hypot(x - at, depth + radius) - radius))
        off, some = interpolated(x, scales + half, values, random)
        ratios, solved, count = [*ratios, *off], solved + some, count + len(x)
    assert np.mean(np.array(ratios) <= 1) > 0.995
    assert max(ratios) < 1.3
    assert solved < 0.5 * count
