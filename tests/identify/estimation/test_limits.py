"""Ranges that do not include the truth have no bar, and those that cut a bar have a note."""

from dataclasses import replace

import numpy as np
import pytest

from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.parts import Measured, Unknown
from tests.identify.estimation.synthetic import POISSON, YOUNG, Ball, Punch, measured, noise


def _found(low: float, high: float, seed: int = 1):
    error = 0.003 * noise(np.random.default_rng(seed), 200, 0.6)
    young = Unknown("young", low, high, "Pa", is_logarithmic=True)
    return identify([measured(Ball(), {"young": 25e3}, error, 2e-4)], [young])


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (1e3, 1e4, "E is above 10.0 kPa"),
        (4e4, 1e6, "E is below 40.0 kPa"),
        (1.0, 40.0, "times the largest force within them"),
        (1e6, 1e9, "E is below 1.00 MPa"),
    ],
)
def test_a_range_without_the_truth_has_no_bar(low, high, words):
    found = _found(low, high)
    assert found.verdict.startswith("does not fit within the ranges")
    assert words in found.verdict
    assert np.isnan(found.low).all() and np.isnan(found.part).all()
    assert not found.windows


@pytest.mark.parametrize("begins", [0.5, 0.7])
@pytest.mark.parametrize("is_zeroed", [False, True])
def test_a_curve_that_begins_deep_in_contact_has_a_bar_that_holds(begins, is_zeroed):
    """Rows from a share of the depth on; contact was as far before the first row as 1 to 2.3 times the rest."""
    widths = []
    for seed in range(3):
        error = 0.003 * noise(np.random.default_rng((seed, int(10 * begins))), 200, 0.6)
        one = measured(Ball(), {"young": 25e3}, error, 2e-4, air=0.0)
        keep = one.curve.depth >= 1e-4 + begins * 2e-4
        zero = 0.1 * np.ptp(one.curve.force)
        late = replace(one.curve, depth=one.curve.depth[keep], force=one.curve.force[keep] - zero, time=None)
        baseline = [Unknown("baseline", -0.2 * zero, 0.2 * zero, "N", False, (0.0, 0.08 * zero), False)]
        found = identify([replace(one, curve=late)], [YOUNG, *(baseline if is_zeroed else [])])
        assert found.fits
        place = found.place("contact_point")
        for at, truth in ((0, 25e3), (place, 1e-4)):
            assert found.low[at] <= truth <= found.high[at]
        widths.append((found.high[0] - found.low[0]) / 2 / 25e3)
    assert max(widths) < (0.4 if is_zeroed else 1.0)


def test_a_bar_that_its_range_cuts_is_told_of():
    found = _found(1e3, 25.05e3)
    assert found.fits
    assert found.notes == ("The error bar of E ends where its range does, at 25.1 kPa.",)
    assert found.low[0] <= 25e3 <= found.high[0]
    assert not _found(1e3, 1e6).notes


def test_a_truth_at_the_end_of_its_range_is_not_refused():
    values = {"young": 2e4, "poisson": 0.5}
    for seed in range(4):
        rng = np.random.default_rng(seed)
        curves = [
            measured(Punch(1e-3 * k, layer), values, 0.005 * noise(rng, 150, 0.9), 2e-4, name=f"punch {k}")
            for k, layer in ((1, 0.05), (5, 1.0))
        ]
        found = identify(curves, [YOUNG, POISSON])
        assert found.fits
        assert found.high[1] == pytest.approx(0.5)


def test_a_layer_may_have_the_name_of_what_each_curve_has():
    class OfDrift(Ball):
        def force(self, depth, values):
            return super().force(depth, {"young": values["drift_young"]})

    error = 0.003 * noise(np.random.default_rng(1), 200, 0.6)
    curve = measured(Ball(), {"young": 25e3}, error, 2e-4).curve
    found = identify(
        [Measured(curve, OfDrift(names=("drift_young",)))],
        [Unknown("drift_young", 1e3, 1e6, "Pa", is_logarithmic=True)],
    )
    assert found.low[0] <= 25e3 <= found.high[0]
