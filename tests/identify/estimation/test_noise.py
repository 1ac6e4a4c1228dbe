"""Whitening by recursion is that of the dense covariance; the deviation vanishes with the depth."""

import numpy as np
import pytest

from epsmesh.viscoelastic import Motion, respond
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.noise import Noise, deviation, whiten
from epsmesh_identify.estimation.parts import Measured
from epsmesh_identify.estimation.relaxing import relaxed
from epsmesh_identify.experiment.curve import Curve
from tests.identify.estimation.synthetic import DRIFT, YOUNG, Ball, covariance, measured, noise


@pytest.mark.parametrize(
    "one", [Noise(0.0, 1.0, 1.0), Noise(0.9, 0.0, 4.0), Noise(0.95, 0.3, 0.0), Noise(0.6, 0.6, 1.0)]
)
def test_whitening_inverts_the_dense_covariance(one):
    rng, share = np.random.default_rng(0), np.linspace(0, 1, 200)
    columns, dense = rng.normal(size=(200, 3)), covariance(one, share)
    white, half = whiten(columns, share, one)
    assert white.T @ white == pytest.approx(columns.T @ np.linalg.solve(dense, columns), rel=1e-9)
    assert half == pytest.approx(np.linalg.slogdet(dense)[1] / 2, rel=1e-9)


def test_deviations_vanish_faster_than_the_force():
    depth = np.array([-1e-4, 0.0, 1e-6, 1e-5, 1e-3])
    force = np.maximum(depth, 0.0) ** 1.5
    bent = deviation(force, depth)
    assert not bent[:2].any()
    relative = np.abs(bent[2:] / force[2:, None])
    assert (relative[0] < 1.01e-3).all()
    assert relative[2] == pytest.approx(1.0)


def test_relaxation_over_recorded_times_is_the_hereditary_integral():
    times = np.sort(np.random.default_rng(1).uniform(0, 12, 300))
    times[0] = 0.0
    motion, terms = Motion((0.0, 1.0, 12.0), (0.0, 2.0, 2.0)), ((0.4, 0.5), (0.2, 30.0))
    times = np.unique(np.append(times, 1.0))
    expected, _ = respond(motion, terms, times)
    assert relaxed(motion.at(times), times, terms) == pytest.approx(expected, rel=1e-12)


def test_long_curves_are_averaged_and_lose_nothing():
    rng = np.random.default_rng(3)
    fine = measured(Ball(), {"young": 2e4}, 0.02 * noise(rng, 12000, 0.5), 2e-4)
    # Every eighth mean is a curve by itself.
    means = {name: getattr(fine.curve, name).reshape(-1, 8).mean(axis=1) for name in ("depth", "force", "time")}
    short = Measured(Curve("means", **means), Ball())
    assert len(Model.of([fine], [YOUNG]).thinned(fine.curve.force)) == 1500
    long, other = identify([fine], [YOUNG, DRIFT]), identify([short], [YOUNG, DRIFT])
    assert long.high[0] - long.low[0] == pytest.approx(other.high[0] - other.low[0], rel=0.05)
    assert long.low[0] <= 2e4 <= long.high[0]
    assert long.curves[0].residual.shape == (12000,)
