"""Newton's loop: steps that reduce the energy, on a body of one unknown whose energy is a quartic."""

import numpy as np
import pytest

from epsmesh.solve.newton import HALVINGS, LargeError, advance, forcing, hold, is_less

FAR = 3.0


class Spring:
    """A free unknown x with the energy (x² - 1)² / 4, inside out beyond ``FAR``, beside one that goes to a ``goal``."""

    is_compared = True

    def __init__(self, x: float, goal: float = 0.0, *, has_energy: bool = True):
        self.x, self.held, self.goal, self.has_energy = x, 0.0, goal, has_energy
        self.slope: float | None = None
        self.shares: list[float] = []

    @property
    def energy(self) -> float:
        return (self.x**2 - 1) ** 2 / 4 if abs(self.x) < FAR else np.nan

    @property
    def is_there(self) -> bool:
        return self.held == self.goal

    def residual(self) -> tuple[float, float]:
        return abs(self.x**3 - self.x), 1.0

    def rounding(self) -> float:
        return 0.0

    def linearise(self, tolerance: float) -> None:
        """Take the curvature's size: a step down, as a truncated one is."""
        force = self.x**3 - self.x
        self.step = -force / abs(3 * self.x**2 - 1)
        self.before, self.to = (self.x, self.held), self.goal - self.held
        self.slope = -force * self.step if self.has_energy else None

    def advance(self, share: float) -> bool:
        self.x, self.held = self.before[0] + share * self.step, self.before[1] + share * self.to
        self.shares.append(share)
        return bool(np.isfinite(self.energy))


@pytest.mark.parametrize("start", [0.5, 0.58, -0.57, 2.5])
def test_steps_reduce_the_energy_to_a_minimum(start):
    body = Spring(start)
    before = body.energy
    assert hold(body, 1e-12, 40) > 1
    assert abs(body.x) == pytest.approx(1.0, abs=1e-11)
    assert body.energy < before


def test_a_step_beyond_the_minimum_is_halved_until_it_gains():
    body = Spring(0.58)  # the curvature is next to nothing: a full step turns tissue inside out
    hold(body, 1e-12, 40)
    assert body.shares[0] == 1.0
    assert min(body.shares) < 0.5


def test_without_a_least_energy_the_residual_falls():
    body = Spring(0.9, has_energy=False)
    hold(body, 1e-12, 40)
    assert body.x == pytest.approx(1.0, abs=1e-11)


def test_steps_that_are_not_compared_are_whole_though_the_residual_rises():
    body = Spring(0.65)
    body.is_compared = False
    (left, _), _ = body.residual(), hold(body, 1e-12, 40)
    assert body.x == pytest.approx(1.0, abs=1e-11)
    assert set(body.shares) == {1.0}
    first = Spring(0.65)
    first.linearise(0.1)
    first.advance(1.0)
    assert first.residual()[0] > left


def test_a_step_that_moves_what_is_held_is_whole_or_ends_the_load_step():
    body = Spring(0.9, goal=1.0)
    hold(body, 1e-12, 40, on_the_way=1)
    assert body.held == 1.0
    with pytest.raises(LargeError, match="inside out"):
        hold(Spring(0.578, goal=1.0), 1e-12, 40, on_the_way=1)
    hold(Spring(0.578, goal=1.0), 1e-12, 40)


def test_what_is_inside_out_or_does_not_settle_is_told():
    with pytest.raises(LargeError, match="inside out"):
        hold(Spring(4.0), 1e-12, 40)
    with pytest.raises(LargeError, match="no equilibrium after 2 iterations"):
        hold(Spring(2.5), 1e-12, 2)
    body = Spring(0.5)
    body.linearise(0.1)
    with pytest.raises(LargeError, match="inside out"):
        advance(body, HALVINGS, lambda share: False)


def test_a_decrease_is_a_share_of_what_the_slope_promises():
    assert is_less(0.5, 1.0, 1.0, 1.0)
    assert not is_less(1.0, 1.0, 1.0, 1.0)
    assert not is_less(np.nan, 1.0, 1.0, 1.0)


def test_linear_solves_are_as_exact_as_the_last_gain_and_the_end_need():
    assert forcing(0.5) == 0.1
    assert forcing(0.05) == pytest.approx(0.0025)
    assert forcing(1e-6) == 1e-4
    assert forcing(1e-6, 0.5) == pytest.approx(0.05)
