"""The hereditary integral: closed forms, limits, energies."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epsmesh.shapes.history import History
from epsmesh.viscoelastic import Motion, follow, moduli, respond

TERMS = ((0.4, 2.0), (0.2, 30.0))
RAMP = Motion((0.0, 1.0, 11.0), (0.0, 2.0, 2.0))


def test_a_step_relaxes_as_the_modulus_does():
    times = np.linspace(0, 100, 41)
    force, _ = respond(Motion((0.0, 100.0), (1.0, 1.0)), TERMS, times)
    assert force == pytest.approx(0.4 + 0.4 * np.exp(-times / 2) + 0.2 * np.exp(-times / 30), rel=1e-13)


def test_fast_and_slow_ramps_are_those_of_both_moduli():
    for duration, modulus in ((1e-6, 1.0), (1e8, 0.4)):
        force, _ = respond(Motion((0.0, duration), (0.0, 1.0)), TERMS, np.array([duration]))
        assert force[0] == pytest.approx(modulus, rel=1e-5)


def test_without_terms_the_force_follows_the_depth_and_nothing_is_lost():
    times = np.linspace(0, 11, 50)
    force, lost = respond(RAMP, (), times)
    assert force == pytest.approx(RAMP.at(times))
    assert not lost.any()


def test_after_its_end_a_motion_has_no_force():
    force, lost = respond(RAMP, TERMS, np.array([11.0, 11.1]))
    assert np.isfinite([force[0], lost[0]]).all()
    assert np.isnan([force[1], lost[1]]).all()


@given(
    st.lists(st.tuples(st.floats(0.01, 10), st.floats(-1, 1)), min_size=1, max_size=6),
    st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.45)),
    st.tuples(st.floats(0.01, 1), st.floats(2, 100)),
)
def test_work_is_stored_or_dissipated(rows, shares, taus):
    """The work of the force is the energy of all springs and what is lost; a coarser table is the same motion."""
    times = np.concatenate([[0.0], np.cumsum([step for step, _ in rows])])
    values = np.array([0.0, *(depth for _, depth in rows)])
    motion, terms = Motion(tuple(times), tuple(values)), tuple(zip(shares, taus, strict=True))
    fine = np.unique(np.concatenate([np.linspace(a, b, 2001) for a, b in pairwise(times)]))
    force, lost = respond(motion, terms, fine)
    depth = motion.at(fine)
    work = np.sum((force[1:] + force[:-1]) / 2 * np.diff(depth))
    springs = [(respond(motion, ((0.999999, tau),), fine)[0][-1] - 1e-6 * depth[-1]) / 0.999999 for tau in taus]
    stored = (1 - sum(shares)) * depth[-1] ** 2 / 2 + sum(g * q**2 / 2 for g, q in zip(shares, springs, strict=True))
    assert lost[-1] == pytest.approx(work - stored, abs=1e-5)
    assert (np.diff(lost) >= -1e-12).all()


@pytest.mark.parametrize("frequency", [0.01, 0.3, 5.0])
def test_a_steady_sine_has_storage_and_loss_modulus(frequency):
    """Of the last of so many periods that the transient is gone; a period loses pi E'' A^2."""
    periods = max(10.0, np.ceil(700 * frequency))
    motion = Motion((0.0,), (0.0,), 0.1, frequency, periods)
    last = (periods - 1 + np.linspace(0, 1, 65)) / frequency
    force, lost = respond(motion, TERMS, last)
    wave = 2 * np.mean((force * np.exp(-2j * np.pi * frequency * last))[:-1]) * 1j
    storage, loss = moduli(TERMS, frequency)
    assert (wave.real, wave.imag) == pytest.approx((0.1 * storage, 0.1 * loss), rel=1e-7)
    assert lost[-1] - lost[0] == pytest.approx(np.pi * loss * 0.1**2, rel=1e-6)


def test_a_table_of_a_sine_is_the_sine():
    motion = Motion((0.0, 1.0), (0.0, 1.0), 0.3, 0.5, 2.0)
    fine = 1 + np.linspace(0, 4, 4001)
    table = Motion((0.0, *fine), (0.0, *(1 + 0.3 * np.sin(np.pi * (fine - 1)))))
    at = np.linspace(0, 5, 23)
    for one, other in zip(respond(motion, TERMS, at), respond(table, TERMS, at), strict=True):
        assert one == pytest.approx(other, abs=1e-6)


def test_short_steps_lose_as_much_as_one_long_step():
    """Where a series replaces differences of nearly equal numbers."""
    many = Motion(tuple(np.linspace(0, 1, 3001)), tuple(np.linspace(0, 2, 3001)))
    one = Motion((0.0, 1.0), (0.0, 2.0))
    assert respond(many, TERMS, np.ones(1))[1] == pytest.approx(respond(one, TERMS, np.ones(1))[1], rel=1e-9)


# ---- contact that grows and shrinks: shares of depths, and an elastic curve that is no power of the depth ----

DEPTHS = np.array([0.1, 0.17, 0.43, 0.81, 1.0])
TOUCH = Motion((0.0, 1.0, 4.0, 6.0), (0.0, 1.0, 1.0, 0.0))


def curve(depth):
    return depth**1.5 * (1 + 0.3 * np.sqrt(depth) + 0.1 * depth)


def modulus(time):
    return 0.4 + 0.4 * np.exp(-time / 2) + 0.2 * np.exp(-time / 30)


def loaded(until, time):
    """Integrate E(t - s) dF over the loading, by quadrature in the depth."""
    points, weights = np.polynomial.legendre.leggauss(60)
    end = min(until, 1.0)
    depth = end * (1 + points) / 2
    slope = 1.5 * depth**0.5 + 0.6 * depth + 0.25 * depth**1.5
    return end / 2 * np.sum(weights * modulus(time - depth) * slope)


def test_growing_contact_is_the_hereditary_integral_of_the_elastic_force():
    times = np.array([0.3, 0.7, 1.0, 2.5, 4.0])
    found = follow(TOUCH, TERMS, times, DEPTHS, 1.5)
    assert found.weights @ curve(DEPTHS) == pytest.approx([loaded(time, time) for time in times], rel=1e-5)
    assert found.depth == pytest.approx(np.minimum(times, 1.0))


def test_shrinking_contact_forgets_what_came_after_it_had_that_area():
    """Only the loading before t1 counts, and the integral of E(t - s) d'(s) from t1 to t is zero (Ting)."""
    times = np.array([4.1, 4.6, 5.0])
    found = follow(TOUCH, TERMS, times, DEPTHS, 1.5)
    for time, force, t1 in zip(times, found.weights @ curve(DEPTHS), found.depth, strict=True):
        s = np.concatenate([np.linspace(t1, 1, 20001), np.linspace(4, time, 20001)])
        rate = np.where(s <= 1, 1.0, -0.5)
        steps = np.diff(s) * (np.diff(s) < 2)  # not over the hold
        both = modulus(time - s) * rate
        assert np.sum(steps * (both[1:] + both[:-1]) / 2) == pytest.approx(0, abs=2e-4)
        assert force == pytest.approx(loaded(t1, time), rel=1e-4)


def test_contact_is_lost_before_the_tool_is_back():
    found = follow(TOUCH, TERMS, np.array([5.3, 5.6, 6.0, 7.0]), DEPTHS, 1.5)
    assert found.weights[0] @ curve(DEPTHS) > 0
    assert not found.weights[1:3].any()
    assert np.isnan(found.weights[3]).all()


def test_elastic_contact_follows_its_curve_both_ways():
    times = np.array([0.25, 0.5, 1.0, 3.0, 5.0, 5.5])
    found = follow(TOUCH, (), times, DEPTHS, 1.5)
    assert found.depth == pytest.approx(TOUCH.at(times))
    assert found.weights @ curve(DEPTHS) == pytest.approx(curve(TOUCH.at(times)), rel=1e-4)


def test_growing_contact_dissipates_what_the_work_does_not_store():
    """Of a force proportional to the depth as of prescribed contact; of others, the work of a slow ramp is stored."""
    times = np.linspace(0, 4, 9)
    found = follow(TOUCH, TERMS, times, DEPTHS, 1.0)
    assert found.dissipated @ DEPTHS == pytest.approx(respond(TOUCH, TERMS, times)[1], rel=1e-5, abs=1e-12)
    for duration in (1e-4, 1e5):
        ramp = Motion((0.0, duration), (0.0, 1.0))
        lost = follow(ramp, TERMS, np.array([duration]), DEPTHS, 1.5).dissipated @ curve(DEPTHS)
        assert 0 < lost[0] < 1e-3
    held = follow(Motion((0.0, 1e-4, 1e4), (0.0, 1.0, 1.0)), TERMS, np.array([1e4]), DEPTHS, 1.5)
    energy = 1 / 2.5 + 0.3 / 3 + 0.1 / 3.5
    assert (held.dissipated @ curve(DEPTHS))[0] == pytest.approx(0.6 * energy, rel=1e-3)


def test_a_step_of_found_contact_relaxes_as_the_modulus_does():
    times = np.array([0.0, 1.0, 9.0])
    found = follow(Motion((0.0, 10.0), (1.0, 1.0)), TERMS, times, DEPTHS, 1.5)
    assert found.weights @ curve(DEPTHS) == pytest.approx(curve(1.0) * modulus(times), rel=1e-7)


def test_a_force_proportional_to_the_depth_is_that_of_prescribed_contact():
    """Until it would pull: contact of a flat tool has one area."""
    times = np.linspace(0, 4.5, 31)
    found = follow(TOUCH, TERMS, times, DEPTHS, 1.0)
    assert found.weights @ DEPTHS == pytest.approx(respond(TOUCH, TERMS, times)[0], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("time", [0.01, 0.1, 1.0])
def test_a_line_between_the_times_of_a_hold_follows_a_decay_of_any_duration(time):
    """The hold is as long as the slowest decay; equal steps would be off by more than half of the fastest."""
    times = History(ramp="1 s", hold="100 s").times()
    dense = np.linspace(1.0, 101.0, 20001)
    decay = np.exp(-(dense - 1) / (100 * time))
    line = np.interp(dense, times, np.exp(-(np.maximum(times, 1.0) - 1) / (100 * time)))
    assert np.abs(line - decay).max() < 0.015
