"""The active set of contact settles where sets would repeat, and is then the solution of the contact problem."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve.contact.constraint import Constraint
from epsmesh.solve.contact.deformed import solve_contact
from epsmesh.solve.contact.touching import PlacedTool
from epsmesh.solve.newton import LargeError

COUNT = 9


@dataclass
class Springs:
    """Nodes that move along z only, on springs whose ``stiffness`` couples any two of them; loads push them up.

    ``left`` is a residual inside the body that no step reduces.
    """

    stiffness: FloatArray
    loads: FloatArray
    state: FloatArray = field(default_factory=lambda: np.zeros(COUNT))
    left: float = 0.0
    is_sound, energy, slope = True, np.nan, None

    @property
    def fixed(self) -> BoolArray:
        return np.tile([True, False], (COUNT, 1))

    def positions(self) -> FloatArray:
        return np.column_stack([np.arange(COUNT, dtype=float), self.state])

    def forces(self) -> FloatArray:
        return np.column_stack([np.zeros(COUNT), self.stiffness @ self.state - self.loads])

    def unbalanced(self) -> float:
        return self.left

    def linearise(self, constraint: Constraint) -> FloatArray:
        held = constraint.held[:, 1]
        change = np.where(held, constraint.values[:, 1] * constraint.frames[:, 1, 1], 0.0)
        right = -self.forces()[:, 1] - self.stiffness @ change
        change[~held] = np.linalg.solve(self.stiffness[np.ix_(~held, ~held)], right[~held])
        self.before, self.change = self.state, change
        return self.forces() + np.column_stack([np.zeros(COUNT), self.stiffness @ change])

    def advance(self, share: float) -> bool:
        self.state = self.before + share * self.change
        return True


def ceiling(heights: FloatArray, followers: BoolArray) -> PlacedTool:
    """Return a tool above the nodes. Followers are active where the nodes on both sides are."""

    def distance(points: FloatArray) -> Distance:
        return Distance(heights - points[:, 1], np.tile([0.0, -1.0], (COUNT, 1)), np.zeros((COUNT, 2, 2)))

    def complete(active: BoolArray) -> BoolArray:
        sides = np.pad(active, 1, constant_values=True)
        return np.where(followers, sides[:-2] & sides[2:], active)

    return PlacedTool(distance, complete, followers, 1.0)


@pytest.mark.parametrize("with_followers", [False, True])
def test_sets_settle_on_springs_of_any_coupling(with_followers):
    """Here, changes of many nodes at once often repeat."""
    generator = np.random.default_rng(3)
    followers = (np.arange(COUNT) % 2 == 0) & with_followers
    for _ in range(150):
        mixed = generator.normal(size=(COUNT, COUNT + 1))
        springs = Springs(mixed @ mixed.T, generator.normal(size=COUNT) + 1.0)
        heights = 0.1 * generator.random(COUNT)
        if not (np.linalg.solve(springs.stiffness, springs.loads) > heights)[~followers].any():
            continue  # no contact
        found = solve_contact(springs, ceiling(heights, followers), np.ones(COUNT, dtype=bool))
        pressed, gap = -found.forces[:, 1], heights - springs.state
        judged = ~followers
        assert (gap[judged] > -1e-5).all()
        assert (pressed[judged] > -1e-5 * np.abs(pressed).max()).all()
        assert gap[found.active] == pytest.approx(0.0, abs=1e-7)
        assert (pressed[~found.active] == 0.0).all()


def test_sets_settle_where_they_would_repeat_for_ever():
    """I. Ben Gharbia and J. C. Gilbert, Math. Program. 134, 349, 2012: of three nodes, one after the other is active.

    Each node that leaves lets the next one enter. A fourth node is in contact.
    """
    compliance, gap = np.eye(COUNT), np.ones(COUNT)
    compliance[[0, 1, 2], [2, 0, 1]] = 2.0
    gap[3] = -1.0
    stiffness, heights = np.linalg.inv(compliance), np.full(COUNT, 0.5)
    springs, active = Springs(stiffness, stiffness @ (heights - gap)), np.isin(np.arange(COUNT), (0, 3))
    sets = []

    def complete(active: BoolArray) -> BoolArray:
        sets.append(np.flatnonzero(active).tolist())
        return active

    tool = ceiling(heights, np.zeros(COUNT, dtype=bool))
    found = solve_contact(springs, replace(tool, complete=complete), active)
    assert [0, 3] in sets[3:]  # a cycle
    assert np.flatnonzero(found.active).tolist() == [3]
    assert -found.forces[:, 1] == pytest.approx(np.maximum(-gap, 0.0))
    assert heights - springs.state == pytest.approx(np.maximum(gap, 0.0))


def test_a_rough_solution_is_close_and_takes_at_least_one_step():
    """It may end before its set settles, but not at an initial guess."""
    generator, rough = np.random.default_rng(5), []
    followers = np.zeros(COUNT, dtype=bool)
    for _ in range(100):
        mixed = generator.normal(size=(COUNT, 3 * COUNT))
        stiffness, loads = mixed @ mixed.T / COUNT, generator.normal(size=COUNT) + 1.0
        tool, all_nodes = ceiling(0.1 * generator.random(COUNT), followers), np.ones(COUNT, dtype=bool)
        if not (np.linalg.solve(stiffness, loads) > 0.1).any():
            continue  # no contact
        exact, near = (solve_contact(Springs(stiffness, loads), tool, all_nodes, limit=limit) for limit in (0.0, 0.05))
        size = np.linalg.norm(exact.forces)
        assert np.linalg.norm(near.forces - exact.forces) <= 0.1 * size
        rough.append((exact.iterations, near.iterations))
    exact_steps, rough_steps = np.array(rough).T
    assert (rough_steps >= 1).all()
    assert rough_steps.sum() < exact_steps.sum()


def test_a_residual_that_rounding_keeps_from_falling_is_enough():
    """One step more shows that it does not fall; a larger one is no rounding."""
    tool, all_nodes = ceiling(np.zeros(COUNT), np.zeros(COUNT, dtype=bool)), np.ones(COUNT, dtype=bool)
    exact, rounded = (
        solve_contact(Springs(np.eye(COUNT), np.ones(COUNT), left=left), tool, all_nodes) for left in (0.0, 1e-7)
    )
    assert rounded.iterations == exact.iterations + 1
    assert rounded.forces == pytest.approx(exact.forces)
    with pytest.raises(LargeError):
        solve_contact(Springs(np.eye(COUNT), np.ones(COUNT), left=1e-4), tool, all_nodes)
