"""Signs and segments of many kinds of curves: with and without air, hold and retract, under noise, drift and offset."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.signal import lfilter

from epsmesh.arrays import FloatArray
from epsmesh_identify.experiment.columns import Recorded
from epsmesh_identify.experiment.reading import ExperimentError, Reading
from epsmesh_identify.experiment.segments import cycles_of
from epsmesh_identify.experiment.signs import signed, signs_of

RAMP = 10.0


@dataclass(frozen=True)
class Made:
    """A recorded curve with the signs that make it positive inward, and rows of its ramp and hold."""

    curve: Recorded
    signs: tuple[int, int]
    ramp: int
    hold: int


def made(seed: int) -> Made:
    """Return a curve whose kind is chosen by the ``seed``; its depth goes over 1 m, and its force to 1 N."""
    rng = np.random.default_rng(seed)
    rows, air = int(rng.choice([40, 300, 2000])), rng.choice([0.0, 0.3, 0.9])
    hold, has_retract = int(rows * rng.choice([0, 1, 10])), bool(rng.random() < 0.5)
    up = np.linspace(0, 1, rows)
    depth = np.concatenate([up, np.ones(hold), up[::-1] if has_retract else []])
    time = RAMP * np.arange(len(depth)) / rows
    force = (np.maximum(depth - air, 0) / (1 - air)) ** rng.choice([1.0, 1.5])
    force *= np.where(time > RAMP, 0.6 + 0.4 * np.exp((RAMP - time) / 5), 1.0)
    force += noise(rng, len(depth)) + rng.choice([0, 0.1]) * time / time[-1] + rng.choice([0.0, 3.0, -2.0])
    depth = depth + rng.choice([0, 2e-3]) * rng.normal(size=len(depth))
    signs = int(rng.choice([1, -1])), int(rng.choice([1, -1]))
    lines, names = np.arange(len(depth)), {"depth": "z", "force": "F", "time": "t"}
    return Made(Recorded("a.csv", signs[0] * depth, signs[1] * force, time, lines, names), signs, rows, hold)


def noise(rng: np.random.Generator, rows: int) -> FloatArray:
    """Return noise of one or three per cent, white or correlated."""
    correlation = rng.choice([0.0, 0.9])
    white = rng.choice([0.01, 0.03]) * rng.normal(size=rows)
    correlated: FloatArray = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], white)
    return correlated


# Straight lines without air, with an offset of the force.
UNCLEAR = (3, 11, 36)


@pytest.mark.parametrize("seed", range(60))
def test_signs_and_segments(seed):
    """Of a straight line without air, and with an offset of the force, no end is clearly the deep one."""
    one = made(seed)
    assert signs_of(one.curve, Reading()) == one.signs
    curve = signed(one.curve, Reading())
    assert any("no end is clearly" in note for note in curve.notes) == (seed in UNCLEAR)
    (cycle,) = cycles_of(curve.depth, curve.time)
    tolerance = max(4, 0.05 * one.ramp)
    assert cycle.start == 0
    assert abs(cycle.hold - one.ramp) <= tolerance
    assert abs(cycle.retract - cycle.hold - one.hold) <= max(tolerance, 0.1 * one.hold)
    (without_time,) = cycles_of(curve.depth, None)
    assert abs(without_time.hold - one.ramp) <= tolerance


@pytest.mark.parametrize("drift", [-2.0, -0.5, 0.5, 2.0])
@pytest.mark.parametrize("air", [0.0, 0.5])
@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_a_baseline_that_drifts_between_strokes_does_not_turn_signs(signs, air, drift):
    """The baseline drifts by up to twice the largest force; the way back may be faster, and the load may relax."""
    up = np.linspace(0, 1, 300)
    for back, hold in ((300, 0), (100, 0), (300, 300)):
        depth = np.concatenate([up, np.ones(hold), np.linspace(1, 0.02, back)])
        force = np.maximum(depth - air, 0) ** 1.5 / (1 - air) ** 1.5
        force += drift * np.linspace(0, 1, len(depth)) + 0.01 * np.random.default_rng(back).normal(size=len(depth))
        time, lines, names = np.arange(len(depth)) * 1.0, np.arange(len(depth)), {"depth": "z", "force": "F"}
        curve = Recorded("a.csv", signs[0] * depth, signs[1] * force, time, lines, names)
        assert signs_of(curve, Reading()) == signs
        assert not any("is it" in note for note in signed(curve, Reading(depth_sign=signs[0])).notes)


def test_signs_that_contradict_each_other_are_asked_for():
    """A curve that begins and ends pressed is deep at one end by its turn, and at the other by its force."""
    depth = np.concatenate([np.linspace(1, 0, 300), np.linspace(0, 1, 300)])
    force, time, lines = np.maximum(depth - 0.5, 0) ** 1.5, np.arange(600.0), np.arange(600)
    curve = Recorded("a.csv", depth, force, time, lines, {"depth": "z", "force": "F"})
    with pytest.raises(ExperimentError, match=r"`z`: it is not clear .* write sign = \{depth = 1, force = 1\} in"):
        signs_of(curve, Reading())
    assert signs_of(curve, Reading(depth_sign=1)) == (1, 1)
