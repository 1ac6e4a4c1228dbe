"""A crack that a rigid cylinder holds open: closed forms of its energy, and of what follows from it."""

from math import pi

import numpy as np
import pytest

from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.crack import LEVELS, open_crack, section
from epsmesh.solve.plane.opening import Opening
from tests.verification.known import thin_needle
from tests.verification.needles import shaft_pressure


@pytest.fixture(scope="module")
def opened():
    """A crack in compressible tissue, on the coarse mesh."""
    return open_crack(MaterialLaw.of_moduli(2.6, 0.3, "neo-hookean"), 0.3, LEVELS[0])


def test_a_thin_cylinder_opens_the_crack_as_two_concentrated_forces_do(opened):
    """K = P/√(πb) (H. Tada), while G is from the change of the energies."""
    ratio, thrust = opened.ratios[2], opened.thrusts[2]
    assert opened.release(ratio) == pytest.approx((1 - 0.3) * thrust**2 / (2 * pi * ratio), rel=0.03)


def test_the_pressure_on_a_thin_needle_is_that_of_hertz_contact_in_its_crack(opened):
    """In compressible tissue 4μ is E/(1 − ν²)."""
    modulus, toughness = 1 / (2 * (1 - 0.3)), 0.01
    half, pressure = thin_needle(toughness / modulus)
    assert shaft_pressure(opened, toughness) == pytest.approx(modulus * pressure, rel=0.01)
    assert 1 / opened.ratio(toughness) == pytest.approx(half, rel=0.01)


def test_the_pressure_does_the_work_that_is_stored(opened):
    """Two results of each state: the energy, and the sum of the reactions."""
    work = np.log(opened.energies[1:] / opened.energies[:-1])
    exponents = opened.ratios * opened.slopes / opened.energies
    steps = np.diff(np.log(opened.ratios))
    assert work == pytest.approx(steps * (exponents[1:] + exponents[:-1]) / 2, rel=0.01)


def test_the_face_that_is_drawn_lies_round_the_cylinder():
    places, moved = section(MaterialLaw.of_moduli(3.0, 0.5, "neo-hookean"), 0.1)
    face = np.isclose(places[..., 1], 0.0, atol=1e-12) & (places[..., 0] < 1)
    distances = np.hypot(*(places + moved)[face].T)
    assert distances.min() == pytest.approx(0.1, rel=1e-3)
    middle = np.isclose(places[..., 0], 0.0, atol=1e-12)
    assert np.unique((places + moved)[face & middle].round(4), axis=0) == pytest.approx(np.array([[0.0, -0.1]]))


def test_what_holds_the_tissue_ahead_of_the_tips_carries_the_thrust(opened):
    assert opened.balance < 1e-6


def test_a_tougher_tissue_has_a_shorter_crack_and_needs_more_energy(opened):
    toughness = np.array([0.02, 0.1, 0.3])
    ratios = np.array([opened.ratio(each) for each in toughness])
    assert np.all(np.diff(ratios) > 0)
    needed = [2 * each / r + opened.energy(r) / r**2 for each, r in zip(toughness, ratios, strict=True)]
    assert np.all(np.diff(needed) > 0)


def test_the_crack_at_the_toughness_needs_the_least_energy():
    """With f = ρ³ the least of 2γ/ρ + f/ρ² is at ρ² = 2γ."""
    ratios = np.array([0.1, 0.5, 1.0, 3.0])
    power = Opening(ratios, ratios**3, 3 * ratios**2, np.zeros(4), np.zeros(4))
    assert power.ratio(0.5) == pytest.approx(1.0)
    around = np.linspace(0.8, 1.2, 5)
    needed = [2 * 0.5 / r + power.energy(r) / r**2 for r in around]
    assert np.argmin(needed) == 2
    assert power.pressure(2.0) == pytest.approx(12.0)


def test_a_toughness_beyond_the_solved_states_is_refused():
    power = Opening(np.array([0.1, 1.0]), np.array([1e-3, 1.0]), np.array([0.03, 3.0]), np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match=r"0\.005 to 0\.5 is solved"):
        power.ratio(0.6)
