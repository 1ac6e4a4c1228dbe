"""Coulomb's law at nodes, without a body: directions of slip that swing, and what damping leaves of the residual."""

import numpy as np
import pytest

from epsmesh.solve.contact.coulomb import Damping, Slide
from epsmesh.solve.contact.friction_step import FrictionIteration, FrictionStep, Placed
from epsmesh.solve.contact.surface import Neighbours

YES = np.array([True])
ALONE = Neighbours(~YES, np.empty((0, 2), dtype=np.int64), ~YES)


def towards(angle):
    return Slide(YES, np.array([[np.cos(angle), np.sin(angle)]]), np.ones(1))


@pytest.mark.parametrize("rate", [-1.5, -0.95, -0.3, 0.5])
def test_directions_settle_whatever_their_changes_are_followed_by(rate):
    slide, damping = towards(0.1), Damping(4)
    for iteration in range(1, 30):
        (along,) = slide.directions
        slide = damping.towards(slide, towards(rate * np.arctan2(along[1], along[0])), iteration)
    assert abs(slide.directions[0, 1]) < 1e-6


def test_friction_that_damping_holds_back_is_a_residual(monkeypatch):
    """The forces obey a direction that the law does not want: they are no equilibrium, however little it may change."""
    monkeypatch.setattr(Damping, "towards", lambda _, before, *__: before)
    normal, load, friction = np.array([[0.0, 0.0, 1.0]]), 2.0, 0.5
    before = Slide(YES, np.array([[1.0, 0.0, 0.0]]), np.ones(1))
    step = FrictionStep(
        friction, np.zeros((1, 3)), np.array([1.0]), ALONE, before, np.array([load]), np.zeros((1, 3), dtype=bool), 0.1
    )
    iteration, place = FrictionIteration(step), Placed(np.array([[0.0, -9.0, 0.0]]), normal)
    forces = np.array([[friction * load, 0.0, load]])
    iteration.update(1, place, forces, YES, YES)
    assert iteration.slide is before
    wanted = friction * load * np.array([1.0, 9.0, 0.0]) / 82**0.5
    assert iteration.exerted(place, forces, YES) == pytest.approx(wanted[None])


def test_friction_of_a_corner_is_continuous_in_that_of_its_neighbours():
    """Round the apex of a ball tissue slides apart: a unit vector there would turn with rounding."""
    beside = np.array([[0, 1], [0, 2]])
    star = Neighbours(np.array([True, False, False]), beside, np.array([True, False, False]))
    every, most = np.ones(3, dtype=bool), np.ones(3)
    before, found = Slide(every, np.zeros((3, 2)), most), {}
    for change in (-1e-3, 1e-3):
        trial = np.array([[np.nan, np.nan], [2.0, change], [-2.0, change]])
        found[change] = before.following(trial, most, every, star).directions
        assert np.linalg.norm(found[change][1:], axis=1) == pytest.approx(1.0)
        assert found[change][0] == pytest.approx([0.0, change / 2], rel=1e-3)
    aligned = before.following(np.array([[0.0, 0.0], [2.0, 1.0], [2.0, 1.0]]), most, every, star).directions
    assert aligned[0] == pytest.approx(aligned[1])
