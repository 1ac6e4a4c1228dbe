"""Bars hold, parts add up, and what curves do not tell is said."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.parts import SOURCES, Measured, Unknown
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.reading import ExperimentError
from tests.identify.estimation.synthetic import POISSON, YOUNG, Ball, Punch, measured, noise


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.99])
def test_bars_hold_whatever_the_correlation_of_the_noise_and_the_tilt_of_the_baseline(correlation):
    held, ratio = [], []
    for seed in range(20):
        rng = np.random.default_rng((seed, int(100 * correlation)))
        young = 10 ** rng.uniform(3.5, 5.5)
        error = 0.01 * noise(rng, int(rng.integers(120, 300)), correlation, rng.uniform(0, 0.4))
        air, tilt = rng.uniform(0.3, 1.0), rng.uniform(0.01, 0.05) * rng.choice([-1, 1])
        found = identify([measured(Ball(), {"young": young}, error, 2e-4, air, tilt=tilt)], [YOUNG])
        held.append(found.low[0] <= young <= found.high[0] or not found.fits)
        ratio.append((found.high[0] - found.low[0]) / 2 / abs(found.estimate[0] - young))
    assert sum(held) >= 17  # of 20: fewer happen by chance once in 60 times if 95 % hold
    assert np.nanmedian(ratio) < 12


def test_a_baseline_tilts_where_there_is_air_and_is_level_by_assumption_elsewhere():
    error, values = 0.003 * noise(np.random.default_rng(1), 300, 0.6), {"young": 2e4}
    tilted = measured(Ball(), values, error, 2e-4, 1.0, tilt=0.04)
    slope = np.ptp(Ball().force(np.array([0.0, 2e-4]), values)) / 2e-4
    found = identify([tilted], [YOUNG])
    place = found.place("tilt")
    assert found.low[place] <= 0.04 * slope <= found.high[place]
    assert found.low[0] <= 2e4 <= found.high[0]
    assert found.part[0, SOURCES.index("contact")] > found.part[0, SOURCES.index("thickness")] == 0
    level = identify([replace(tilted, may_tilt=False)], [YOUNG])
    assert "tilt" not in [unknown.name for unknown in level.unknowns]
    assert not level.fits or level.high[0] < 2e4 or level.low[0] > 2e4
    # Little air tells little of the tilt: the bar is that of what is known beforehand.
    short = identify([measured(Punch(names=("young",)), values, error, 2e-4, 0.03, tilt=0.04)], [YOUNG])
    assert short.low[0] <= 2e4 <= short.high[0]
    assert not any("taken for level" in sentence for sentence in short.notes)
    deep = identify([measured(Ball(), values, error, 2e-4, 0.0)], [YOUNG])
    assert any("taken for level" in sentence for sentence in deep.notes)
    assert not any("taken for level" in sentence for sentence in found.notes)
    # Nothing may be hidden: there is one bar.
    assert np.all(found.low_hidden == found.low) and np.all(found.high_hidden == found.high)


def test_parts_add_up_and_the_mesh_is_one_of_them():
    error = 0.003 * noise(np.random.default_rng(1), 200, 0.6)
    found = identify([measured(Ball(), {"young": 2e4}, error, 2e-4)], [YOUNG])
    assert np.sqrt((found.part**2).sum(axis=1)) == pytest.approx((found.high - found.low) / 2)
    assert found.part[0, SOURCES.index("mesh")] == pytest.approx(1e-3 * found.estimate[0], rel=0.3)
    assert found.part[0, SOURCES.index("contact")] > found.part[0, SOURCES.index("machine")] == 0


def test_one_punch_does_not_tell_poissons_ratio_and_two_do():
    rng, values = np.random.default_rng(2), {"young": 2e4, "poisson": 0.42}
    curves = [
        measured(Punch(1e-3 * k, layer), values, 0.003 * noise(rng, 200, 0.6), 2e-4, name=f"punch {k}")
        for k, layer in ((1, 0.05), (5, 1.0))
    ]
    one, two = identify(curves[:1], [YOUNG, POISSON]), identify(curves, [YOUNG, POISSON])
    assert not one.seen[1]
    (sentence,) = one.notes
    assert re.fullmatch(r"This curve sees E / \(1 - ν²\)\S* to ± [\d.]+ %, and not ν\.", sentence)
    assert not two.notes
    assert two.seen[:2].all()
    for found in (one, two):
        assert found.low[0] <= 2e4 <= found.high[0]
        assert found.low[1] <= 0.42 <= found.high[1]
    assert two.high[1] - two.low[1] < 0.1
    # Of one punch, E is what E / (1 - nu²) and the range of nu leave.
    modulus = 2e4 / (1 - 0.42**2)
    assert one.low[0] < modulus * (1 - 0.5**2)


def test_a_soft_machine_is_taken_off():
    young, stiffness = 2e5, 300.0
    rigid = measured(Ball(), {"young": young}, 0.002 * noise(np.random.default_rng(3), 200, 0.6), 2e-4)
    force = rigid.forward.force(rigid.curve.depth - 1e-4, {"young": young})
    curve = Curve("soft", rigid.curve.depth + force / stiffness, rigid.curve.force, rigid.curve.time)
    for compliance, unknowns in (
        (1 / stiffness, [YOUNG]),
        (None, [YOUNG, Unknown("machine_stiffness", 150.0, 600.0, "N/m", True, (300.0, 8.0), False)]),
    ):
        found = identify([Measured(curve, rigid.forward, compliance)], unknowns)
        assert found.low[0] <= young <= found.high[0]
        assert (found.part[0, SOURCES.index("machine")] > 0) == (compliance is None)
    ignored = identify([Measured(curve, rigid.forward)], [YOUNG])
    assert not ignored.fits or ignored.high[0] < young


def test_shares_and_times_of_relaxation_are_found():
    time = np.concatenate([np.linspace(0, 1, 150), np.linspace(1.05, 20, 250)])
    depth = np.interp(time, [0.3, 1.0], [0.0, 2e-4])
    elastic = Ball().force(depth, {"young": 3e4})
    fine = np.linspace(0, 20, 40001)
    rates = np.gradient(Ball().force(np.interp(fine, [0.3, 1.0], [0.0, 2e-4]), {"young": 3e4}), fine)
    # The hereditary integral by quadrature, which knows nothing of recursion.
    lost = []
    for t in time:
        past = fine[fine <= t]
        lost.append(trapezoid(rates[: len(past)] * (1 - np.exp(-(t - past) / 3.0)), past))
    force = elastic - 0.35 * np.array(lost)
    force = force + force.max() * 0.003 * noise(np.random.default_rng(4), 400, 0.5)
    unknowns = [
        YOUNG,
        Unknown("relaxation_share_1", 0.0, 0.9, "1"),
        Unknown("relaxation_time_1", 0.1, 100.0, "s", is_logarithmic=True),
    ]
    found = identify([Measured(Curve("hold", depth, force, time), Ball())], unknowns)
    assert found.fits
    for place, truth in enumerate((3e4, 0.35, 3.0)):
        assert found.low[place] <= truth <= found.high[place]
        assert found.high[place] - found.low[place] < 0.4 * truth
    assert {"relaxation_share_1", "relaxation_time_1"} <= found.profiles.keys()


def stiffening(by):
    """Return a curve whose force is larger than Hertz's, by a share that goes as the square of the depth."""
    error = 0.001 * noise(np.random.default_rng(5), 300, 0.3)
    curve = measured(Ball(), {"young": 2e4}, error, 2e-4).curve
    contact = np.maximum(curve.depth - 1e-4, 0.0) / 2e-4
    return replace(curve, force=curve.force * (1 + by * contact**2))


def test_a_law_that_does_not_fit_has_no_bar_but_windows():
    found = identify([Measured(stiffening(0.6), Ball())], [YOUNG])
    assert found.verdict.startswith("does not fit")
    assert np.isnan(found.low).all() and np.isnan(found.high_hidden).all()
    young = [window.young for window in found.windows]
    assert young[0] == pytest.approx(2e4, rel=0.15)
    assert young[-1] > 1.1 * 2e4


class Shallow(Ball):
    """A force that is known down to 0.21 mm."""

    def error(self, depth, values):
        return np.where(depth > 0.21e-3, np.inf, 1e-3)


def test_values_of_a_law_that_does_not_fit_are_told_to_be_extrapolated():
    """Least squares takes what softens for earlier contact, so that the depth is beyond that of the known forces."""
    found = identify([Measured(stiffening(-0.3), Shallow())], [YOUNG])
    assert not found.fits
    assert any("values are an extrapolation" in sentence for sentence in found.notes)


class Base:
    """A rigid base under the body, to first order in the contact radius over the thickness."""

    kind = "base"
    unknowns = (Unknown("hidden_base_depth", 0.5e-3, 50e-3, "m", is_logarithmic=True, is_wanted=False),)

    def factor(self, depth, values):
        ratio = np.sqrt(1e-3 * np.maximum(depth, 0.0)) / values["hidden_base_depth"]
        return 1 + 1.133 * ratio + 1.283 * ratio**2


def test_the_second_bar_holds_a_hidden_base():
    found = []
    for seed in range(5):
        error = 0.01 * noise(np.random.default_rng(seed), 200, 0.9)
        right = measured(Ball(), {"young": 2e4}, error, 2e-4)
        depth = right.curve.depth - 1e-4
        factor = Base().factor(depth, {"hidden_base_depth": 1.5e-3})
        curve = replace(right.curve, force=right.curve.force * factor)
        found.append(identify([replace(right, curve=curve, hidden=(Base(),))], [YOUNG]))
    for one in found:
        assert one.low_hidden[0] <= one.low[0] or not one.fits
        assert one.low_hidden[0] <= 2e4 <= one.high_hidden[0] or not one.fits


def test_a_modulus_beyond_its_range_is_no_fit():
    error = 0.003 * noise(np.random.default_rng(6), 200, 0.3)
    found = identify([measured(Ball(), {"young": 5e6}, error, 2e-4)], [YOUNG])
    assert found.verdict.startswith("does not fit within the ranges")
    assert any("E is the end of its range, 1.00 MPa" in sentence for sentence in found.notes)


@pytest.mark.parametrize("air", [0.0, 0.5])
@pytest.mark.parametrize("law", [Ball(), Punch(names=("young",))])
def test_curves_of_simulations_fit_with_small_bars(law, air):
    """Without noise: exact, of another shape by 0.3 % of the force or 0.02 %, and rounded."""
    depth = np.linspace(-air * 2e-4, 2e-4, 60)
    share, force = np.clip(depth / 2e-4, 0.0, 1.0), law.force(depth, {"young": 2e4})
    for other in (
        force,
        force * (1 + 3e-3 * share),
        force * (1 + 2e-4 * np.sin(6 * share)),
        np.array([float(f"{one:.4g}") for one in force]),
    ):
        found = identify([Measured(Curve("simulated", depth, other), law)], [YOUNG])
        assert found.fits
        assert found.low[0] <= 2e4 <= found.high[0]
        assert found.high[0] - found.low[0] < 0.01 * 2e4


def test_noise_without_contact_tells_nothing():
    depth, force = np.linspace(0, 1e-3, 200), 1e-5 * noise(np.random.default_rng(7), 200, 0.3)
    found = identify([Measured(Curve("air", depth, force), Ball())], [YOUNG])
    assert not found.seen[0]


@pytest.mark.parametrize(
    ("force", "words"),
    [(np.zeros(50), "constant"), (np.linspace(0, 1, 5), "5 points"), (np.full(50, np.nan), "not finite")],
)
def test_what_is_no_curve_is_refused(force, words):
    with pytest.raises(ExperimentError, match=words):
        identify([Measured(Curve("wrong", np.linspace(0, 1e-3, len(force)), force), Ball())], [YOUNG])
